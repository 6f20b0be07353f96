"""Programs that are alike: shapes without chosen names, what two share, and what turns one into another."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import TypeAlias

from codebotler.program import TASK, names_bound, parsed

Lines: TypeAlias = tuple[str, ...]
Change: TypeAlias = tuple[str, str]
"""A line of a difference: `-`, `+` or a space, and its text."""

LONGEST = 20_000  # characters of a program whose shape is looked at, and lines are compared
CONTEXT = 2  # lines around a change


def shape(program: str) -> Lines:
    """The lines of a program without comments, with the names that it chose replaced by numbers.

    Two programs of one shape differ in nothing but names, comments and layout. Of a text that is no Python,
    and of a very long one, the lines are taken as they stand.
    """
    tree = parsed(program) if len(program) <= LONGEST else None
    if not isinstance(tree, ast.Module):
        return _lines(program)
    try:
        nodes = list(ast.walk(tree))
        bound = names_bound(tree) - {TASK}
        numbers = {name: f"name{number}" for number, name in enumerate(_chosen(nodes, bound), 1)}
        for node in nodes:
            _rename(node, numbers)
        return _lines(ast.unparse(tree))
    except (RecursionError, MemoryError, ValueError):
        return _lines(program)


def _lines(text: str) -> Lines:
    return tuple(line.rstrip() for line in text[:LONGEST].splitlines() if line.strip())


CHOOSES: Mapping[type[ast.AST], str] = {
    **dict.fromkeys((ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.ExceptHandler), "name"),
    ast.Name: "id",
    ast.arg: "arg",
}
"""Where in a syntax tree a chosen name stands."""
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
    """How much two programs share, from 0 to 1: lines of both in both, over lines of both (Dice).

    Args:
        one: how often each line stands in a program.
        other: the same of another.
    """
    total = one.total() + other.total()
    return 2 * (one & other).total() / total if total else 1.0


@dataclass(frozen=True)
class Passing:
    """A program that passes, to be compared with others.

    Args:
        name: how a person names it.
        lines: as they stand.
        counts: how often each line stands in it.
    """

    name: str
    lines: Lines
    counts: Counter[str]


def passing(named: Iterable[tuple[str, str]]) -> list[Passing]:
    """Different programs, each under the first of its names."""
    first: dict[Lines, str] = {}
    for name, program in named:
        first.setdefault(_as_written(program), name)
    return [Passing(name, lines, Counter(lines)) for lines, name in first.items()]


def _as_written(program: str) -> Lines:
    return tuple(line.rstrip() for line in program[:LONGEST].strip("\n").splitlines())


@dataclass(frozen=True)
class Fix:
    """What turns a program that fails into one that passes.

    Args:
        name: of the one that passes.
        changed: how many lines go or come.
        changes: the difference, with some lines around; a line of dots where some are left out.
    """

    name: str
    changed: int
    changes: tuple[Change, ...]


def shortest_fix(program: str, candidates: Sequence[Passing]) -> Fix | None:
    """The candidate that differs in the fewest lines; None if there is none.

    Args:
        program: that fails.
        candidates: that pass; of equally near ones the first counts.
    """
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
