"""Groups failing programs by cause, each with its reason and the most similar program that passes."""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache
from itertools import count
from typing import Any, TypeAlias

from codebotler.core.program import TASK_FUNCTION, names_bound, parsed
from roboeval.evaluation.explanation import error_sentence, reason
from roboeval.evaluation.failures import NO_PROGRAM
from roboeval.evaluation.runs.completions import Key, name_of
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import Row, failure_of, key_of

Lines: TypeAlias = tuple[str, ...]
Change: TypeAlias = tuple[str, str]  # of a difference: `-`, `+` or a space, and the line
Ground: TypeAlias = tuple[str, str, str, str | None]  # task, class, kind and failed check

ALIKE = 0.6  # of their lines two shapes share to be of one group
LONGEST = 20_000  # characters of a program whose shape is looked at, and lines are compared
CONTEXT = 2  # lines around a change


@dataclass(frozen=True)
class Fix:
    """What turns a program that fails into one that passes."""

    name: str  # of the one that passes
    changed: int  # lines that go or come
    changes: tuple[Change, ...]  # with some lines around; a line of dots where some are left out


@dataclass(frozen=True)
class Cluster:
    """Completions of one task that fail by the same check or error with similar programs."""

    task: str
    failure: Mapping[str, Any]  # of the representative
    members: tuple[Key, ...]
    representative: Key  # the first of those with the most frequent program
    program: str | None  # of the representative; None if it is gone
    told: Mapping[str, Any]  # why it fails, in which world and line
    fix: Fix | None  # None where no program of the task passes, and where there was no program

    @property
    def has_no_program(self) -> bool:
        """Whether these are replies without a program, which no robot ran."""
        return str(self.failure["class"]) == NO_PROGRAM

    @property
    def why(self) -> str:
        """Why the representative fails, in a sentence."""
        if self.told["explanation"] is not None:
            return str(self.told["explanation"])
        return error_sentence(self.told) if self.told["error"] else ""

    @property
    def prompts(self) -> list[int]:
        """The prompts of its completions, sorted."""
        return sorted({prompt for _, prompt, _ in self.members})


def groups(failed: Iterable[Row], programs: Mapping[Key, str]) -> list[list[Row]]:
    """Put failing completions together, the largest groups first; of one size, tasks take turns.

    Replies without a program are one group for each task and kind, whatever their text.
    """
    grounds: defaultdict[Ground, list[Row]] = defaultdict(list)
    for row in failed:
        why = failure_of(row)
        grounds[row["task"], why["class"], why["kind"], why["check"]].append(row)
    shape_of = cache(shape)
    found = (group for rows in grounds.values() for group in _grouped(rows, programs, shape_of))
    turns: defaultdict[tuple[int, str], Iterator[int]] = defaultdict(count)
    ordered = sorted(found, key=lambda rows: key_of(rows[0]))
    placed = [(-len(rows), next(turns[len(rows), rows[0]["task"]]), rows) for rows in ordered]
    return [rows for _, _, rows in sorted(placed, key=lambda one: one[:2])]


def clusters(groups: Iterable[Sequence[Row]], results: Results) -> Iterator[Cluster]:
    """Say of each group why it fails and what would have helped."""
    programs = results.programs
    right: defaultdict[str, list[tuple[str, str]]] = defaultdict(list)
    for key in sorted(results.passed):
        if key in programs:
            right[key[0]].append((name_of(key), programs[key]))
    candidates = {task: passing(named) for task, named in right.items()}
    for rows in groups:
        often = Counter(programs.get(key_of(row)) for row in rows)
        most = max(often.values())
        row = next(row for row in rows if often[programs.get(key_of(row))] == most)
        program = programs.get(key_of(row))
        has_none = program is None or failure_of(row)["class"] == NO_PROGRAM
        yield Cluster(
            task=row["task"],
            failure=failure_of(row),
            members=tuple(sorted(map(key_of, rows))),
            representative=key_of(row),
            program=program,
            told=reason(row, results.suite, ablated=results.is_ablated),
            fix=None if has_none else shortest_fix(str(program), candidates.get(row["task"], [])),
        )


def nearest_fix(results: Results, key: Key) -> Fix | None:
    """What turns one completion into one that passes; None if its program is gone or no other passes."""
    programs = results.programs
    if key not in programs:
        return None
    right = (other for other in sorted(results.passed) if other[0] == key[0] and other in programs)
    return shortest_fix(programs[key], passing((name_of(other), programs[other]) for other in right))


def _grouped(
    rows: Sequence[Row], programs: Mapping[Key, str], shape_of: Callable[[str], Lines]
) -> Iterator[list[Row]]:
    """Rows of one ground, those of similar programs together."""
    if failure_of(rows[0])["class"] == NO_PROGRAM:
        yield sorted(rows, key=key_of)
        return
    of_shape: defaultdict[Lines, list[Row]] = defaultdict(list)
    for row in sorted(rows, key=key_of):
        of_shape[shape_of(programs.get(key_of(row), ""))].append(row)
    leaders: list[tuple[Counter[str], list[Row]]] = []
    for lines, those in sorted(of_shape.items(), key=lambda item: (-len(item[1]), key_of(item[1][0]))):
        counts = Counter(lines)
        near = next((group for leader, group in leaders if similarity(leader, counts) >= ALIKE), None)
        if near is None:
            leaders.append((counts, those))
        else:
            near += those
    yield from (group for _, group in leaders)


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


# --- programs that are alike


def shape(program: str) -> Lines:
    """The lines of a program, alike for those that differ in names, comments and layout only."""
    tree = parsed(program) if len(program) <= LONGEST else None
    if not isinstance(tree, ast.Module):
        return _lines(program)
    try:
        nodes = list(ast.walk(tree))
        bound = names_bound(tree) - {TASK_FUNCTION}
        numbers = {name: f"name{number}" for number, name in enumerate(_chosen(nodes, bound), 1)}
        for node in nodes:
            _rename(node, numbers)
        return _lines(ast.unparse(tree))
    except (RecursionError, MemoryError, ValueError):
        return _lines(program)


def _lines(text: str) -> Lines:
    return tuple(line.rstrip() for line in text[:LONGEST].splitlines() if line.strip())


# Where in a syntax tree a chosen name stands.
CHOOSES: Mapping[type[ast.AST], str] = {
    **dict.fromkeys((ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.ExceptHandler), "name"),
    ast.Name: "id",
    ast.arg: "arg",
}
REPEATS: Mapping[type[ast.AST], str] = {**CHOOSES, ast.MatchAs: "name", ast.MatchStar: "name"}


def _chosen(nodes: Iterable[ast.AST], bound: Container[str]) -> list[str]:
    """The names that a program binds, but for its entry, in the order in which they stand there."""
    named = [(node, getattr(node, CHOOSES[type(node)])) for node in nodes if type(node) in CHOOSES]
    found = sorted((node.lineno, node.col_offset, name) for node, name in named if name in bound)  # type: ignore[attr-defined]  # all that are named have a place
    return list(dict.fromkeys(name for _, _, name in found))


def _rename(node: ast.AST, numbers: Mapping[str, str]) -> None:
    """Replace its name; a text that stands alone, such as a docstring, becomes a `pass`."""
    if (field := REPEATS.get(type(node))) is not None:
        old = getattr(node, field)
        setattr(node, field, numbers.get(old, old))
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        node.value = ast.Name("pass") if isinstance(node.value.value, str) else node.value


def similarity(one: Counter[str], other: Counter[str]) -> float:
    """How much two programs share, from 0 to 1: lines of both in both, over lines of both (Dice)."""
    total = one.total() + other.total()
    return 2 * (one & other).total() / total if total else 1.0


@dataclass(frozen=True)
class Passing:
    """A program that passes, to be compared with others."""

    name: str  # for people
    lines: Lines  # as they stand
    counts: Counter[str]  # how often each line stands in it


def passing(named: Iterable[tuple[str, str]]) -> list[Passing]:
    """Different programs, each under the first of its names."""
    first: dict[Lines, str] = {}
    for name, program in named:
        first.setdefault(_as_written(program), name)
    return [Passing(name, lines, Counter(lines)) for lines, name in first.items()]


def _as_written(program: str) -> Lines:
    return tuple(line.rstrip() for line in program[:LONGEST].strip("\n").splitlines())


def shortest_fix(program: str, candidates: Sequence[Passing]) -> Fix | None:
    """The candidate that differs in the fewest lines, the first of equally near ones; None without any."""
    lines = _as_written(program)
    counts = Counter(lines)
    best: tuple[int, int] | None = None
    at_least = sorted((_far(counts, one.counts), number) for number, one in enumerate(candidates))
    for bound, number in at_least:
        if best is not None and bound >= best[0]:
            break
        changed = _changed(lines, candidates[number].lines)
        if best is None or changed < best[0]:
            best = changed, number
    if best is None:
        return None
    chosen = candidates[best[1]]
    return Fix(chosen.name, best[0], tuple(_changes(lines, chosen.lines)))


def _far(one: Counter[str], other: Counter[str]) -> int:
    """How many lines two programs differ in at the least, wherever they stand."""
    return ((one - other) + (other - one)).total()


def _changed(one: Lines, other: Lines) -> int:
    matcher = SequenceMatcher(None, one, other, autojunk=False)
    return len(one) + len(other) - 2 * sum(block.size for block in matcher.get_matching_blocks())


def _changes(one: Lines, other: Lines) -> Iterator[Change]:
    matcher = SequenceMatcher(None, one, other, autojunk=False)
    for number, group in enumerate(matcher.get_grouped_opcodes(CONTEXT)):
        if number or group[0][1] > 0:
            yield " ", "..."
        for tag, a, b, c, d in group:
            if tag == "equal":
                yield from ((" ", line) for line in one[a:b])
            else:
                yield from (("-", line) for line in one[a:b])
                yield from (("+", line) for line in other[c:d])
