"""Static analysis: find definite, uncaught errors and misuse of skills.

Programs are parsed in an isolated process with a time limit.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import replace

from codebotler.checking.problems import Problem, no_room
from codebotler.checking.source.room_names import fixed_drives, lists_rooms, named_rooms
from codebotler.core.program import Flaw, find_tree_flaws, nodes, parse_leniently, parse_program
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.skills.values import ValueType
from codebotler.simulator.process.isolated_call import IsolatedCallError, isolated
from codebotler.simulator.worlds.room_map import RoomMap

EVERYTHING = frozenset({"Exception", "BaseException"})
EXAMPLE_PROGRAM = "def task_program():\n    if is_in_rom('mug'):\n        say('a mug')\n"


def read_program(program: str, room_map: RoomMap, skills: SkillTable) -> tuple[bool, tuple[Problem, ...]]:
    """Return whether a program compiles, and the errors that it will certainly have, at most one per line."""
    try:
        compiles, problems = _findings(program, room_map, _without_functions(skills))
    except IsolatedCallError as error:
        message = f"the program cannot be read: {error.message}"
        return False, (Problem(error.kind, message),)
    return compiles, tuple(Problem(*each) for each in problems)


def read_rooms(program: str, skills: SkillTable) -> tuple[tuple[str, ...], bool]:
    """Return the rooms that a program names, and whether it asks for the list of all rooms."""
    try:
        rooms, lists_all = _rooms(program, _without_functions(skills))
    except IsolatedCallError:
        return (), False
    return tuple(rooms), lists_all


@isolated(EXAMPLE_PROGRAM, RoomMap(("start_loc",), "start_loc"), SKILLS)
def _findings(
    program: str, room_map: RoomMap, skills: SkillTable
) -> tuple[bool, list[tuple[str, str, int | None]]]:
    tree = parse_program(program, compiled=True)
    if isinstance(tree, Flaw):
        return False, [(tree.kind, tree.message, tree.line)]
    return True, _definite_errors(program, tree, room_map, skills)


@isolated(EXAMPLE_PROGRAM, SKILLS)
def _rooms(program: str, skills: SkillTable) -> tuple[list[str], bool]:
    tree = parse_leniently(program)
    return list(named_rooms(tree, skills)), lists_rooms(tree)


def _without_functions(skills: SkillTable) -> SkillTable:
    """Return the skills without the users' functions, which isolated processes cannot import."""

    def plain(value: ValueType) -> ValueType:
        return replace(value, enum=None)

    def declared(skill: Skill) -> Skill:
        parameters = tuple(replace(one, type=plain(one.type)) for one in skill.parameters)
        return replace(skill, does=None, parameters=parameters, returns=plain(skill.returns))

    return SkillTable(tuple(one if SKILLS.get(one.name) is one else declared(one) for one in skills.rows))


def _definite_errors(
    program: str, tree: ast.Module, room_map: RoomMap, skills: SkillTable
) -> list[tuple[str, str, int | None]]:
    """Return the kind, message and line of the definite errors in a parsed program, one per line."""
    flaws = list(find_tree_flaws(tree, program, skills))
    try:
        if not room_map.guessed:
            flaws += [
                Flaw(line, "GoToInvalidLocation", no_room(request, room_map))
                for line, request in fixed_drives(tree, skills)
                if room_map.room(request) is None
            ]
        caught = list(_guarded_lines(tree))
    except RecursionError:
        caught = []
    by_line: dict[int | None, list[Flaw]] = {}
    for flaw in flaws:
        kinds = frozenset().union(*(kinds for lines, kinds in caught if flaw.line in lines))
        is_hidden = bool(kinds & EVERYTHING) and not flaw.is_misuse
        if flaw.kind not in kinds and not is_hidden:
            by_line.setdefault(flaw.line, []).append(flaw)
    return [
        (same[0].kind, "; ".join(dict.fromkeys(flaw.message for flaw in same)), line)
        for line, same in by_line.items()
    ]


def _guarded_lines(tree: ast.Module) -> Iterator[tuple[range, frozenset[str]]]:
    """Yield the lines of each `try` or `with` block, and the kinds of errors that it may catch."""
    for node in nodes(tree):
        if isinstance(node, ast.Try | ast.TryStar) and node.handlers:
            yield _lines(node.body), frozenset().union(*map(_caught_kinds, node.handlers))
        elif isinstance(node, ast.With):  # a context manager may suppress any error
            yield _lines(node.body), EVERYTHING


def _caught_kinds(handler: ast.ExceptHandler) -> frozenset[str]:
    if handler.type is None:
        return EVERYTHING
    return frozenset(node.id for node in ast.walk(handler.type) if isinstance(node, ast.Name))


def _lines(statements: Sequence[ast.stmt]) -> range:
    return range(statements[0].lineno, (statements[-1].end_lineno or statements[-1].lineno) + 1)
