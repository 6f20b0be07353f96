"""Find the rooms that a program names, by following its variables without running it."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from typing import TypeAlias

from codebotler.core.program import all_bound_names, nodes
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable

ROOMS_SKILL, ROOM_SKILL = "get_all_rooms", "get_current_location"
MAX_NAMED_ROOMS = 100
PROPAGATION_ROUNDS = 6  # steps from variable to variable; longer chains are unusual
SAME_VALUES = frozenset({"sorted", "list", "set", "tuple", "reversed", "iter", "filter", "frozenset"})
ELEMENT_METHODS = frozenset({"copy", "keys", "lower", "strip", "casefold", "title", "pop"})
COMPARISON_METHODS = frozenset({"startswith", "endswith"})

TextLiteral: TypeAlias = tuple[int, int, str]
"""A string in a program: its line (from 1), its column (from 0) and the text."""

A_ROOM: TextLiteral = (0, 0, "")  # the placeholder for the name of a room that a skill returns


def named_rooms(tree: ast.Module, skills: SkillTable = SKILLS) -> tuple[str, ...]:
    """Return the names that a program drives to or compares with rooms, in the order of its source."""
    try:
        return tuple(dict.fromkeys(_Variables(tree, skills).rooms()))[:MAX_NAMED_ROOMS]
    except RecursionError:
        return ()


def fixed_drives(tree: ast.Module, skills: SkillTable = SKILLS) -> list[tuple[int, str]]:
    """Return the line and the request of each drive whose room is a literal.

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


class _Variables:
    """Finds the texts that the variables of a program may contain, without regard to scopes."""

    def __init__(self, tree: ast.Module, skills: SkillTable) -> None:
        self.tree, self.drives = tree, _drives(skills)
        self.held: defaultdict[str, set[TextLiteral]] = defaultdict(set)
        self.functions = {
            node.name: [*node.args.posonlyargs, *node.args.args]
            for node in nodes(tree)
            if isinstance(node, ast.FunctionDef)
        }
        for _ in range(PROPAGATION_ROUNDS):
            before = sum(map(len, self.held.values()))
            for node in nodes(tree):
                self._pass_on(node)
            if sum(map(len, self.held.values())) == before:
                break

    def rooms(self) -> list[str]:
        """Return the names of rooms, in the order of the program's source."""
        found = {text for _, request in _requests(self.tree, self.drives) for text in self.texts(request)}
        driven = {_variable(request) for _, request in _requests(self.tree, self.drives)} - {None}
        for node in nodes(self.tree):
            found |= self._compared(node, driven)
        return [text for _, _, text in sorted(found - {A_ROOM}) if any(map(str.isalpha, text))]

    def texts(self, node: ast.expr) -> set[TextLiteral]:
        """Return the possible values of an expression or of its elements."""
        match node:
            case ast.Constant(str(value)):
                return {(node.lineno, node.col_offset, value.strip())}
            case ast.Name(name):
                return self.held[name]
            case ast.Call(ast.Name(name)) if name in {ROOMS_SKILL, ROOM_SKILL}:
                return {A_ROOM}
        return self._all(_parts(node))

    def _all(self, nodes: list[ast.expr]) -> set[TextLiteral]:
        return set().union(*map(self.texts, nodes))

    def _pass_on(self, node: ast.AST) -> None:
        match node:
            case ast.Assign(targets, value):
                for target in targets:
                    self._bind(target, value)
            case (
                ast.AnnAssign(target, value=ast.expr() as value)
                | ast.AugAssign(target, ast.Add(), value)
                | ast.NamedExpr(target, value)
            ):
                self._bind(target, value)
            case ast.For(target, over) | ast.comprehension(target, over):
                self._bind_each(target, over)
            case ast.Call(ast.Attribute(ast.Name(name), "append" | "add" | "extend"), [value]):
                self.held[name] |= self.texts(value)
            case ast.Call(ast.Name(name), arguments) if name in self.functions:
                given = {p.arg: value for p, value in zip(self.functions[name], arguments, strict=False)}
                given |= {k.arg: k.value for k in node.keywords if k.arg is not None}
                for parameter, argument in given.items():
                    self.held[parameter] |= self.texts(argument)

    def _bind(self, target: ast.expr, value: ast.expr) -> None:
        match target, value:
            case ast.Name(name), _:
                self.held[name] |= self.texts(value)
            case ((ast.Tuple(targets) | ast.List(targets)), (ast.Tuple(values) | ast.List(values))):
                for one, its in zip(targets, values, strict=False):
                    self._bind(one, its)
            case ((ast.Tuple(targets) | ast.List(targets)), _):
                for one in targets:
                    self._bind(one, value)

    def _bind_each(self, target: ast.expr, over: ast.expr) -> None:
        match target, over:
            case ast.Tuple([_, second]), ast.Call(ast.Name("enumerate"), [many, *_]):
                self._bind_each(second, many)
            case ast.Tuple(targets), ast.Call(ast.Name("zip"), many):
                for one, those in zip(targets, many, strict=False):
                    self._bind_each(one, those)
            case ast.Tuple([first, second]), ast.Call(ast.Attribute(ast.Dict() as pairs, "items")):
                self._bind_each(first, pairs)
                self._bind_each(second, ast.List(pairs.values))
            case ast.Tuple([first, _]), ast.Call(ast.Attribute(value, "items")):
                self._bind_each(first, value)
            case ast.Tuple(), ast.List(rows) | ast.Tuple(rows) | ast.Set(rows):
                for row in rows:
                    self._bind(target, row)
            case _:
                self._bind(target, over)

    def _compared(self, node: ast.AST, driven: set[str | None]) -> set[TextLiteral]:

        def is_room(side: ast.expr) -> bool:
            return A_ROOM in self.texts(side) or _variable(side) in driven

        match node:
            case ast.Compare(left, _, [right]):
                sides = ((left, right), (right, left))
                return {text for one, other in sides if is_room(one) for text in self.texts(other)}
            case ast.Call(ast.Attribute(value, name), [text]) if name in COMPARISON_METHODS and is_room(
                value
            ):
                return self.texts(text)
        return set()


def _parts(node: ast.expr) -> list[ast.expr]:
    """Return the parts of an expression that may be its value or an element of it."""
    parts: list[ast.expr] = []
    match node:
        case ast.List(some) | ast.Tuple(some) | ast.Set(some) | ast.BoolOp(_, some):
            parts = some
        case ast.Dict(keys):
            parts = [key for key in keys if key is not None]
        case ast.IfExp(_, one, other):
            parts = [one, other]
        case ast.BinOp(one, ast.Add(), other) if not _is_text(one) and not _is_text(other):
            parts = [one, other]
        case ast.ListComp(part) | ast.SetComp(part) | ast.GeneratorExp(part):
            parts = [part]
        case ast.Subscript(part) | ast.Starred(part) | ast.NamedExpr(_, part):
            parts = [part]
        case ast.Call(ast.Name(name), some) if name in SAME_VALUES:
            parts = some[-1:]
        case ast.Call(ast.Attribute(part, name)) if name in ELEMENT_METHODS:
            parts = [part]
    return parts


def _variable(node: ast.expr) -> str | None:
    """Return the variable that an expression consists of or reads from, or None."""
    match node:
        case ast.Name(name):
            return name
        case ast.Subscript(value) | ast.Call(ast.Attribute(value)):
            return _variable(value)
    return None


def _is_text(node: ast.expr) -> bool:
    match node:
        case ast.Constant(str()) | ast.JoinedStr() | ast.Call(ast.Name("str")):
            return True
        case ast.BinOp(left, _, right):
            return _is_text(left) or _is_text(right)
    return False
