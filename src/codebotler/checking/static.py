"""Static analysis: certain errors in code that is reached and not guarded, and skills that are misused."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence

from codebotler.checking.problems import Problem, no_room
from codebotler.checking.room_names import fixed_drives
from codebotler.core.program import TASK, Flaw, flaws_of, nodes
from codebotler.core.skills.table import SkillTable
from codebotler.simulator.sampled_robot import RoomMap

EVERYTHING = frozenset({"Exception", "BaseException"})
ENDS = (ast.Return, ast.Raise, ast.Continue, ast.Break)


def static_problems(program: str, tree: ast.Module, room_map: RoomMap, skills: SkillTable) -> list[Problem]:
    """The certain errors of a program, one problem a line."""
    flaws = list(flaws_of(tree, program, skills))
    try:
        if not room_map.guessed:
            flaws += [
                Flaw(line, "GoToInvalidLocation", no_room(request, room_map))
                for line, request in fixed_drives(tree, skills)
                if room_map.room(request) is None
            ]
        never = {line for node in _never(tree) for line in _lines([node])}
        caught = list(_caught(tree))
    except RecursionError:
        never, caught = set(), []
    by_line: dict[int | None, list[Flaw]] = {}
    for flaw in flaws:
        kinds = frozenset().union(*(kinds for lines, kinds in caught if flaw.line in lines))
        is_hidden = bool(kinds & EVERYTHING) and not flaw.is_misuse
        if flaw.line not in never and flaw.kind not in kinds and not is_hidden:
            by_line.setdefault(flaw.line, []).append(flaw)
    return [
        Problem(same[0].kind, "; ".join(dict.fromkeys(flaw.message for flaw in same)), line)
        for line, same in by_line.items()
    ]


def _never(tree: ast.Module) -> Iterator[ast.stmt]:
    """The statements that never run: after a return, below what is never true, in functions never named."""
    named = {node.id for node in nodes(tree) if isinstance(node, ast.Name)} | {TASK}
    for node in nodes(tree):
        match node:
            case ast.FunctionDef(name, body=body, decorator_list=[]) if name not in named:
                yield from body
            case ast.If(ast.Constant(value), body, orelse):
                yield from orelse if value else body
            case ast.While(ast.Constant(value), body) if not value:
                yield from body
        for block in ("body", "orelse", "finalbody"):
            statements = getattr(node, block, [])
            if isinstance(statements, list):
                ends = (i for i, statement in enumerate(statements) if isinstance(statement, ENDS))
                yield from statements[next(ends, len(statements)) + 1 :]


def _caught(tree: ast.Module) -> Iterator[tuple[range, frozenset[str]]]:
    """The lines in a `try` or `with`, and the kinds of errors that it may catch."""
    for node in nodes(tree):
        if isinstance(node, ast.Try | ast.TryStar) and node.handlers:
            yield _lines(node.body), frozenset().union(*map(_kinds, node.handlers))
        elif isinstance(node, ast.With):  # which may swallow anything
            yield _lines(node.body), EVERYTHING


def _kinds(handler: ast.ExceptHandler) -> frozenset[str]:
    if handler.type is None:
        return EVERYTHING
    return frozenset(node.id for node in ast.walk(handler.type) if isinstance(node, ast.Name))


def _lines(statements: Sequence[ast.stmt]) -> range:
    return range(statements[0].lineno, (statements[-1].end_lineno or statements[-1].lineno) + 1)
