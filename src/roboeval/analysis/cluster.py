"""Failing completions put together by what went wrong, with the reason and a near program that passes."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from codebotler.terminal import shortened, visible
from roboeval.analysis.similarity import Change, Fix, Lines, Passing, passing, shape, shortest_fix, similarity
from roboeval.evaluation.completions import Key, how_many, name_of
from roboeval.evaluation.explanation import GONE, reason
from roboeval.evaluation.tables import RowData, key_of, kind_of
from roboeval.suites.load import Suite

ALIKE = 0.6  # of their lines two shapes share to be of one group
MOST_LINES = 60  # of a difference that people are shown

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


def trimmed(row: RowData) -> RowData:
    """A row with only those traces that say why it fails: the deciding world's."""
    why = row["failure"]
    deciding = None if why is None else why["world"]
    verdicts = [
        verdict if number == deciding else {"world": verdict["world"]}
        for number, verdict in enumerate(row["verdicts"])
    ]
    return {**row, "verdicts": verdicts if why else []}


def groups(failed: Iterable[RowData], programs: Mapping[Key, str]) -> list[list[RowData]]:
    """Put failing completions together, the largest groups first.

    Args:
        failed: rows of those that failed, as `trimmed` leaves them.
        programs: what was judged; what is gone is not there.
    """
    grounds: defaultdict[Ground, list[RowData]] = defaultdict(list)
    for row in failed:
        why = row["failure"]
        grounds[row["task"], why["class"], why["kind"], why["check"]].append(row)
    shapes: dict[str, Lines] = {}
    found = (group for rows in grounds.values() for group in _grouped(rows, programs, shapes))
    return sorted(found, key=lambda rows: (-len(rows), key_of(rows[0])))


def clusters(
    groups: Iterable[Sequence[RowData]],
    passed: Iterable[Key],
    programs: Mapping[Key, str],
    suite: Suite,
    *,
    ablated: bool = False,
) -> Iterator[Cluster]:
    """Say of each group why it fails and what would have helped.

    Args:
        groups: of rows, as `groups` puts them together.
        passed: completions that passed, among which fixes are looked for.
        programs: what was judged; what is gone is not there.
        suite: by which it was judged.
        ablated: whether common sense only was required.
    """
    right: defaultdict[str, list[tuple[str, str]]] = defaultdict(list)
    for key in sorted(passed):
        if key in programs:
            right[key[0]].append((name_of(key), programs[key]))
    candidates = {task: passing(named) for task, named in right.items()}
    for rows in groups:
        yield _cluster(rows, programs, candidates.get(rows[0]["task"], []), suite, ablated=ablated)


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
    suite: Suite,
    *,
    ablated: bool,
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
        told=reason(row, suite, ablated=ablated),
        fix=None if program is None else shortest_fix(program, candidates),
    )


# --- for machines and people


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


def cluster_view(cluster: Cluster) -> RenderableType:
    """A group for a person: how many, why, and what would have helped."""
    size = how_many(len(cluster.members))
    name = visible(name_of(cluster.representative))
    head = Text.assemble((size, "bold"), f" of {visible(cluster.task)}, ", kind_of(cluster.failure))
    lines = [Text(f'such as {name}, in "{visible(str(cluster.told["world"]))}"', "dim")]
    check = cluster.failure["check"]
    lines.append(Text(shortened(f"{check}: {cluster.why}" if check else cluster.why)))
    if cluster.program is None:
        lines.append(Text(GONE, "yellow"))
    if cluster.fix is not None:
        changed = f"{cluster.fix.changed} line{'s' * (cluster.fix.changed != 1)}"
        lines.append(Text(f"{visible(cluster.fix.name)} passes, and differs in {changed}:", "dim"))
        lines += map(_change, cluster.fix.changes[:MOST_LINES])
        left = len(cluster.fix.changes) - MOST_LINES
        lines += [Text(f"... {left} more lines", "dim")] if left > 0 else []
    return Group(head, *(Padding(line, (0, 0, 0, 2)) for line in lines), Text())


def _change(change: Change) -> Text:
    sign, line = change
    style = {"-": "red", "+": "green"}.get(sign, "dim")
    return Text(f"{sign} {shortened(line.expandtabs(4))}", style)
