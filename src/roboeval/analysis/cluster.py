"""Failing completions put together by what went wrong, with the reason and a near program that passes."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from roboeval.analysis.similarity import Fix, Lines, Passing, passing, shape, shortest_fix, similarity
from roboeval.evaluation.explanation import reason
from roboeval.evaluation.runs.completions import Key, name_of
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import RowData, key_of

ALIKE = 0.6  # of their lines two shapes share to be of one group

Ground: TypeAlias = tuple[str, str, str, str | None]
"""Of which task and why: class, kind and failed check."""


@dataclass(frozen=True)
class Cluster:
    """Completions of one task that fail by the same check or error with similar programs.

    Args:
        task: its name.
        failure: the failure, as a row of an evaluation writes it, of the representative.
        members: the completions, by prompt and index.
        representative: the first of those whose program is the most frequent one.
        program: of the representative; None if it is gone.
        told: why it fails, in which world and at which line.
        fix: the nearest program that passes; None where no program of the task does.
    """

    task: str
    failure: Mapping[str, Any]
    members: tuple[Key, ...]
    representative: Key
    program: str | None
    told: Mapping[str, Any]
    fix: Fix | None

    @property
    def why(self) -> str:
        """Why the representative fails, in a sentence."""
        if self.told["explanation"] is not None:
            return str(self.told["explanation"])
        error = self.told["error"]
        where = "" if self.told["line"] is None else f"line {self.told['line']}: "
        return f"{where}{error['message']}" if error else ""

    @property
    def prompts(self) -> list[int]:
        """The prompts of its completions, sorted."""
        return sorted({prompt for _, prompt, _ in self.members})


def groups(failed: Iterable[RowData], programs: Mapping[Key, str]) -> list[list[RowData]]:
    """Put failing completions together, the largest groups first.

    Args:
        failed: rows of those that failed.
        programs: what was judged; what is gone is not there.
    """
    grounds: defaultdict[Ground, list[RowData]] = defaultdict(list)
    for row in failed:
        why = row["failure"]
        grounds[row["task"], why["class"], why["kind"], why["check"]].append(row)
    shapes: dict[str, Lines] = {}
    found = (group for rows in grounds.values() for group in _grouped(rows, programs, shapes))
    return sorted(found, key=lambda rows: (-len(rows), key_of(rows[0])))


def clusters(groups: Iterable[Sequence[RowData]], results: Results) -> Iterator[Cluster]:
    """Say of each group why it fails and what would have helped."""
    programs = results.programs
    right: defaultdict[str, list[tuple[str, str]]] = defaultdict(list)
    for key in sorted(results.passed):
        if key in programs:
            right[key[0]].append((name_of(key), programs[key]))
    candidates = {task: passing(named) for task, named in right.items()}
    for rows in groups:
        yield _cluster(rows, programs, candidates.get(rows[0]["task"], []), results)


def _grouped(
    rows: Sequence[RowData], programs: Mapping[Key, str], shapes: dict[str, Lines]
) -> Iterator[list[RowData]]:
    """Rows of one ground, those of similar programs together."""
    of_shape: defaultdict[Lines, list[RowData]] = defaultdict(list)
    for row in sorted(rows, key=key_of):
        program = programs.get(key_of(row), "")
        if program not in shapes:
            shapes[program] = shape(program)
        of_shape[shapes[program]].append(row)
    leaders: list[tuple[Counter[str], list[RowData]]] = []
    for lines, those in sorted(of_shape.items(), key=lambda item: (-len(item[1]), key_of(item[1][0]))):
        counts = Counter(lines)
        near = next((group for leader, group in leaders if similarity(leader, counts) >= ALIKE), None)
        if near is None:
            leaders.append((counts, those))
        else:
            near += those
    yield from (group for _, group in leaders)


def _cluster(
    rows: Sequence[RowData],
    programs: Mapping[Key, str],
    candidates: Sequence[Passing],
    results: Results,
) -> Cluster:
    often = Counter(programs.get(key_of(row)) for row in rows)
    most = max(often.values())
    row = next(row for row in rows if often[programs.get(key_of(row))] == most)
    program = programs.get(key_of(row))
    return Cluster(
        task=row["task"],
        failure=row["failure"],
        members=tuple(sorted(map(key_of, rows))),
        representative=key_of(row),
        program=program,
        told=reason(row, results.suite, ablated=results.is_ablated),
        fix=None if program is None else shortest_fix(program, candidates),
    )


def cluster_data(cluster: Cluster) -> dict[str, Any]:
    """A group as plain data."""
    fix = cluster.fix
    return {
        "task": cluster.task,
        "size": len(cluster.members),
        "failure": dict(cluster.failure),
        "world": cluster.told["world"],
        "why": cluster.why,
        "representative": name_of(cluster.representative),
        "members": list(map(name_of, cluster.members)),
        "program": cluster.program,
        "fix": None
        if fix is None
        else {"program": fix.name, "changed": fix.changed, "difference": list(map("".join, fix.changes))},
    }
