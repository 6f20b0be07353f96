"""Find the rooms that a program names, by following its variables without running it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import TypeAlias

from codebotler.checking.source.possible_values import PossibleValues
from codebotler.core.program import all_bound_names, nodes
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable

ROOMS_SKILL, ROOM_SKILL = "get_all_rooms", "get_current_location"
MAX_NAMED_ROOMS = 100
COMPARISON_METHODS = frozenset({"startswith", "endswith"})

TextLiteral: TypeAlias = tuple[int, int, str]
"""A string in a program: its line (from 1), its column (from 0) and the text."""

A_ROOM: TextLiteral = (0, 0, "")  # the placeholder for the name of a room that a skill returns


def named_rooms(tree: ast.Module, skills: SkillTable = SKILLS) -> tuple[str, ...]:
    """Return the names of rooms that a program drives to or compares, in the order of its source."""
    try:
        return tuple(dict.fromkeys(_RoomNames(tree, skills).rooms()))[:MAX_NAMED_ROOMS]
    except RecursionError:
        return ()


def fixed_drives(tree: ast.Module, skills: SkillTable = SKILLS) -> list[tuple[int, str]]:
    """Return the line, from 1, and the room of each drive with a fixed room, such as `go_to("hall")`.

    Drives to rooms that the program uses in comparisons are omitted, since it may check that they exist.
    """
    bound = all_bound_names(tree)
    if "*" in bound:
        return []
    compared = {text for node in nodes(tree) if isinstance(node, ast.Compare) for text in _texts(node)}
    drives = {name: skill for name, skill in _drives(skills).items() if name not in bound}
    return [
        (call.lineno, request.value)
        for call, request in _requests(tree, drives)
        if isinstance(request, ast.Constant) and isinstance(request.value, str)
        if request.value.strip().casefold() not in compared
    ]


def lists_rooms(tree: ast.Module) -> bool:
    """Whether a program asks for the list of all rooms."""
    return any(isinstance(node, ast.Name) and node.id == ROOMS_SKILL for node in nodes(tree))


def _texts(expression: ast.expr) -> Iterator[str]:
    for node in ast.walk(expression):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value.strip().casefold()


def _drives(skills: SkillTable) -> dict[str, Skill]:
    return {row.name: row for row in skills.rows if row.is_drive and row.recording and row.recording.text}


def _requests(tree: ast.Module, drives: dict[str, Skill]) -> Iterator[tuple[ast.Call, ast.expr]]:
    for node in nodes(tree):
        match node:
            case ast.Call(ast.Name(name), arguments, keywords) if name in drives:
                recording = drives[name].recording
                assert recording is not None, "a drive is recorded"
                at = [one.name for one in drives[name].parameters].index(recording.text)
                if not any(isinstance(one, ast.Starred) for one in arguments[:at]):
                    yield from ((node, one) for one in arguments[at : at + 1])
                yield from ((node, one.value) for one in keywords if one.arg == recording.text)


class _RoomNames:
    """Finds the names of rooms in a program: where it drives, and what it compares with rooms."""

    def __init__(self, tree: ast.Module, skills: SkillTable) -> None:
        self.tree, self.drives = tree, _drives(skills)
        self.values = PossibleValues(tree, guess_entries=True)

    def rooms(self) -> list[str]:
        """Return the rooms that the program drives to or compares with a room, in source order."""
        found = {text for _, request in _requests(self.tree, self.drives) for text in self.texts(request)}
        driven = {self._variable(request) for _, request in _requests(self.tree, self.drives)} - {None}
        for node in nodes(self.tree):
            found |= self._compared(node, driven)
        return [text for _, _, text in sorted(found - {A_ROOM}) if any(map(str.isalpha, text))]

    def texts(self, node: ast.expr) -> set[TextLiteral]:
        """Return the strings that a node, or an element of its value, may be: their line, column and text."""
        found = set()
        for value in self.values.of(node):
            match value:
                case ast.Constant(str(text)):
                    found.add((value.lineno, value.col_offset, text.strip()))
                case ast.Call(ast.Name(name)) if name in {ROOMS_SKILL, ROOM_SKILL}:
                    found.add(A_ROOM)
        return found

    def _compared(self, node: ast.AST, driven: set[str | None]) -> set[TextLiteral]:

        def is_room(side: ast.expr) -> bool:
            return A_ROOM in self.texts(side) or self._variable(side) in driven

        match node:
            case ast.Compare(left, _, [right]):
                sides = ((left, right), (right, left))
                return {text for one, other in sides if is_room(one) for text in self.texts(other)}
            case ast.Call(ast.Attribute(value, name), [text]) if name in COMPARISON_METHODS and is_room(
                value
            ):
                return self.texts(text)
        return set()

    def _variable(self, node: ast.expr) -> str | None:
        """Return the variable that an expression consists of or reads from, or None."""
        match node:
            case ast.Name():
                return self.values.variable(node)
            case ast.Subscript(value) | ast.Call(ast.Attribute(value)):
                return self._variable(value)
        return None
