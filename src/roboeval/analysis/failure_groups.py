"""Groups programs that fail in the same way, and finds the most similar passing program for each group."""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache, partial
from typing import Any, TypeAlias

from codebotler.core.program import TASK_FUNCTION, all_bound_names, parse_program
from roboeval.evaluation.judging.explanation import error_sentence, reason
from roboeval.evaluation.judging.failures import NO_PROGRAM_CLASS
from roboeval.evaluation.runs.completions import CompletionKey, name_of
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import Row, failure_of, key_of

ProgramLines: TypeAlias = tuple[str, ...]
DiffLine: TypeAlias = tuple[str, str]  # the prefix `-`, `+` or a space, and the text of the line
Cause: TypeAlias = tuple[str, str, str, str | None]  # task, class, kind and failed check

MIN_SIMILARITY = 0.6  # minimum similarity of a program to the first program of its group
MAX_COMPARED_CHARACTERS = 20_000  # the rest of a longer program is ignored
DIFF_CONTEXT = 2  # number of unchanged lines shown around a change


@dataclass(frozen=True)
class Fix:
    """The difference between a failing program and a passing program of the same task."""

    name: str  # name of the passing completion
    changed: int  # number of removed and added lines
    changes: tuple[DiffLine, ...]  # changed lines with context; "..." marks omitted lines


@dataclass(frozen=True)
class FailureGroup:
    """Completions of one task whose programs are similar and fail because of the same check or error."""

    task: str
    failure: Mapping[str, Any]  # class, kind and check of the representative's failure
    members: tuple[CompletionKey, ...]
    representative: CompletionKey  # first completion that contains the most frequent program
    program: str  # program of the representative
    reason: Mapping[str, Any]  # explanation of the representative's failure, with world and line
    fix: Fix | None  # None if the reply has no program or no program passes

    @property
    def has_no_program(self) -> bool:
        """Whether the replies contained no program."""
        return str(self.failure["class"]) == NO_PROGRAM_CLASS

    @property
    def why(self) -> str:
        """A sentence that explains why the group's most frequent program fails. Empty if this is unknown."""
        if self.reason["explanation"] is not None:
            return str(self.reason["explanation"])
        return error_sentence(self.reason) if self.reason["error"] else ""

    @property
    def prompts(self) -> list[int]:
        """The numbers of the prompts of these completions, in ascending order."""
        return sorted({prompt for _, prompt, _ in self.members})


def group_failures(failed: Iterable[Row], programs: Mapping[CompletionKey, str]) -> list[list[Row]]:
    """Group completions with the same failure and similar programs, the largest groups first.

    Replies without a program form one group for each task and kind of failure.
    """
    causes: defaultdict[Cause, list[Row]] = defaultdict(list)
    for row in failed:
        why = failure_of(row)
        causes[row["task"], why["class"], why["kind"], why["check"]].append(row)
    shape_of = cache(normalised_lines)
    found = (group for rows in causes.values() for group in _group_similar(rows, programs, shape_of))
    return sorted(found, key=lambda rows: (-len(rows), key_of(rows[0])))


def describe_groups(groups: Iterable[Sequence[Row]], results: Results) -> Iterator[FailureGroup]:
    """Yield a description of each group, with the reason for its failure and the smallest fix."""
    programs = results.programs
    candidates = cache(partial(_passing_in, results))
    for rows in groups:
        program = Counter(programs[key_of(row)] for row in rows).most_common(1)[0][0]
        row = next(row for row in rows if programs[key_of(row)] == program)
        failure = failure_of(row)
        has_none = failure["class"] == NO_PROGRAM_CLASS
        right = {} if has_none else candidates(row["task"], row.get("mission_world"))
        yield FailureGroup(
            task=row["task"],
            failure=failure,
            members=tuple(sorted(map(key_of, rows))),
            representative=key_of(row),
            program=program,
            reason=reason(row, results.suite, ablated=results.is_ablated),
            fix=smallest_difference(program, right),
        )


def _passing_in(results: Results, task: str, world: int | None) -> dict[ProgramLines, str]:
    """Return the passing programs of a task or, for missions of an agent, those in one world."""
    programs = results.programs
    of_task = [key for key in results.passed if key[0] == task]
    right = sorted(key for key in of_task if results.completions[key].more.get("world") == world)
    return passing_programs((name_of(key), programs[key]) for key in right)


def _group_similar(
    rows: Sequence[Row], programs: Mapping[CompletionKey, str], shape_of: Callable[[str], ProgramLines]
) -> Iterator[list[Row]]:
    if failure_of(rows[0])["class"] == NO_PROGRAM_CLASS:
        yield sorted(rows, key=key_of)
        return
    of_shape: defaultdict[ProgramLines, list[Row]] = defaultdict(list)
    for row in sorted(rows, key=key_of):
        of_shape[shape_of(programs[key_of(row)])].append(row)
    leaders: list[tuple[Counter[str], list[Row]]] = []
    for lines, those in sorted(of_shape.items(), key=lambda item: (-len(item[1]), key_of(item[1][0]))):
        counts = Counter(lines)
        similar = (group for leader, group in leaders if similarity(leader, counts) >= MIN_SIMILARITY)
        near = next(similar, None)
        if near is None:
            leaders.append((counts, those))
        else:
            near += those
    yield from (group for _, group in leaders)


def group_data(group: FailureGroup) -> dict[str, Any]:
    """Convert a group to JSON data, for `roboeval find --json`."""
    fix = group.fix
    return {
        "task": group.task,
        "size": len(group.members),
        "failure": dict(group.failure),
        "world": group.reason["world"],
        "why": group.why,
        "representative": name_of(group.representative),
        "members": list(map(name_of, group.members)),
        "program": group.program,
        "fix": None
        if fix is None
        else {"program": fix.name, "changed": fix.changed, "difference": list(map("".join, fix.changes))},
    }


# --- similar programs


def normalised_lines(program: str) -> ProgramLines:
    """Return a program's lines for comparison: names become `name1`, comments and layout are dropped."""
    tree = parse_program(program) if len(program) <= MAX_COMPARED_CHARACTERS else None
    if isinstance(tree, ast.Module):
        with suppress(RecursionError, MemoryError, ValueError):
            shape = _Normaliser(all_bound_names(tree) - {TASK_FUNCTION}).visit(deepcopy(tree))
            return _lines(ast.unparse(shape))
    return _lines(program)


NAMES_OF_OTHERS = ast.keyword | ast.alias  # nodes whose names a program does not choose


class _Normaliser(ast.NodeTransformer):
    """Numbers the names that a program binds, and replaces docstrings and other bare strings by `pass`."""

    def __init__(self, bound: Container[str]) -> None:
        self._bound = bound
        self._numbers: dict[str, int] = {}

    def visit(self, node: ast.AST) -> ast.AST:
        for field in ("id", "arg", "name"):
            name = getattr(node, field, None)
            if isinstance(name, str) and name in self._bound and not isinstance(node, NAMES_OF_OTHERS):
                setattr(node, field, f"name{self._numbers.setdefault(name, len(self._numbers) + 1)}")
        match node:
            case ast.Expr(ast.Constant(str())):
                return ast.Pass()
        visited: ast.AST = self.generic_visit(node)
        return visited


def _lines(text: str) -> ProgramLines:
    return tuple(line.rstrip() for line in text[:MAX_COMPARED_CHARACTERS].splitlines() if line.strip())


def similarity(one: Counter[str], other: Counter[str]) -> float:
    """Return how similar two programs are, from 0 to 1 (Dice coefficient of the counts of their lines)."""
    total = one.total() + other.total()
    return 2 * (one & other).total() / total if total else 1.0


def passing_programs(named: Iterable[tuple[str, str]]) -> dict[ProgramLines, str]:
    """Map each program's lines to its name, given (name, program) pairs. The first of equal programs wins."""
    first: dict[ProgramLines, str] = {}
    for name, program in named:
        first.setdefault(_split(program), name)
    return first


def _split(program: str) -> ProgramLines:
    return tuple(line.rstrip() for line in program[:MAX_COMPARED_CHARACTERS].strip("\n").splitlines())


def smallest_difference(program: str, candidates: Mapping[ProgramLines, str]) -> Fix | None:
    """Return the smallest change that turns a program into one of `candidates`, or None if there are none."""
    lines = _split(program)
    counts = Counter(lines)

    def least_changes(other: ProgramLines) -> int:
        """Return a lower bound on the number of differing lines, ignoring their order."""
        theirs = Counter(other)
        return ((counts - theirs) + (theirs - counts)).total()

    best: Fix | None = None
    for bound, other in sorted(((least_changes(one), one) for one in candidates), key=lambda pair: pair[0]):
        if best is not None and bound >= best.changed:
            break
        matcher = SequenceMatcher(None, lines, other, autojunk=False)
        changed = len(lines) + len(other) - 2 * sum(block.size for block in matcher.get_matching_blocks())
        if best is None or changed < best.changed:
            best = Fix(candidates[other], changed, tuple(_changes(lines, other, matcher)))
    return best


def _changes(one: ProgramLines, other: ProgramLines, matcher: SequenceMatcher[str]) -> Iterator[DiffLine]:
    for number, group in enumerate(matcher.get_grouped_opcodes(DIFF_CONTEXT)):
        if number or group[0][1] > 0:
            yield " ", "..."
        for tag, a, b, c, d in group:
            if tag == "equal":
                yield from ((" ", line) for line in one[a:b])
            else:
                yield from (("-", line) for line in one[a:b])
                yield from (("+", line) for line in other[c:d])
