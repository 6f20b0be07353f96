"""Programs as trees that operators read and rewrite; no tree is ever changed in place."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from codebotler.cachedproperty import cached_property
from codebotler.program import Problem, parsed
from codebotler.skills import SKILLS

Replacement: TypeAlias = ast.AST | list[ast.stmt]
Edit: TypeAlias = Mapping[
    Any, Replacement
]  # keys are nodes; a Mapping[ast.AST, ...] takes no dict of one kind
"""What stands in place of some nodes of a tree; for a statement also several statements, or none."""


@dataclass(frozen=True, eq=False)
class Source:
    """A program that parses, and what operators ask of it.

    Args:
        tree: of the whole program.
        text: that all programs with the same tree share, without comments.
    """

    tree: ast.Module
    text: str

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes, always in the same order."""
        return tuple(ast.walk(self.tree))

    @cached_property
    def blocks(self) -> tuple[list[ast.stmt], ...]:
        """All sequences of statements, the innermost too."""
        fields = (
            getattr(node, name, None) for node in self.nodes for name in ("body", "orelse", "finalbody")
        )
        return tuple(field for field in fields if isinstance(field, list) and field)

    @cached_property
    def statements(self) -> tuple[ast.stmt, ...]:
        """All statements."""
        return tuple(node for node in self.nodes if isinstance(node, ast.stmt))

    @cached_property
    def loops(self) -> tuple[ast.For | ast.While, ...]:
        """All loops, without comprehensions."""
        return tuple(node for node in self.nodes if isinstance(node, ast.For | ast.While))

    @cached_property
    def starts(self) -> frozenset[str]:
        """The variables that keep a place in which the robot was."""
        found = set()
        for node in self.nodes:
            match node:
                case ast.Assign(targets=[ast.Name(name)], value=value) if (
                    skill_of(value) == "get_current_location"
                ):
                    found.add(name)
        return frozenset(found)

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """All texts that stand in the program, in small letters."""
        values = (text_of(node) for node in self.nodes)
        return tuple(value.lower() for value in values if value is not None)

    def calls(self, *skills: str) -> Iterator[ast.Call]:
        """The calls of some skills."""
        for node in self.nodes:
            if isinstance(node, ast.Call) and skill_of(node) in skills:
                yield node

    def steps(self, *skills: str) -> Iterator[tuple[ast.Expr, ast.Call]]:
        """The statements that do nothing but call one of some skills."""
        for node in self.nodes:
            match node:
                case ast.Expr(ast.Call() as call) if skill_of(call) in skills:
                    yield node, call


def read(program: str) -> Source | None:
    """A program as operators read it; None where it does not parse, or is nested too deeply to be written."""
    tree = parsed(program, compiled=True)
    if isinstance(tree, Problem):
        return None
    try:
        return Source(tree, ast.unparse(tree))
    except RecursionError:
        return None


def rewritten(node: ast.AST, edit: Edit) -> ast.AST:
    """A copy of a tree with some of its nodes replaced; a block that loses all statements gets a `pass`."""
    fields: dict[str, object] = {}
    for name, value in ast.iter_fields(node):
        if isinstance(value, list):
            new: list[object] = []
            for item in value:
                put = _put(item, edit)
                new += put if isinstance(put, list) else [put]
            fields[name] = new or ([ast.Pass()] if name == "body" and value else [])
        else:
            fields[name] = _put(value, edit)
    return type(node)(**fields)


def _put(value: object, edit: Edit) -> object:
    if not isinstance(value, ast.AST):
        return value
    return edit[value] if value in edit else rewritten(value, edit)


def changed(source: Source, edit: Edit) -> str | None:
    """The text of an edited program; None where it is no program any more, such as with a stray `break`."""
    try:
        text = ast.unparse(ast.fix_missing_locations(rewritten(source.tree, edit)))
    except RecursionError:
        return None
    return None if isinstance(parsed(text, compiled=True), Problem) else text


def skill_of(node: ast.AST) -> str | None:
    """The skill that an expression calls."""
    match node:
        case ast.Call(ast.Name(name)) if name in SKILLS:
            return name
    return None


def skills_in(node: ast.AST) -> frozenset[str]:
    """The skills that are called anywhere in a node."""
    return frozenset(name for inner in ast.walk(node) if (name := skill_of(inner)))


def argument(call: ast.Call, position: int) -> ast.expr | None:
    """What a call of a skill passes for its parameter number `position`, from 0, by place or by name."""
    if position < len(call.args):
        return (
            None
            if any(isinstance(a, ast.Starred) for a in call.args[: position + 1])
            else call.args[position]
        )
    skill = SKILLS[skill_of(call) or ""]
    name = skill.parameters[position].name
    return next((keyword.value for keyword in call.keywords if keyword.arg == name), None)


def text_of(node: ast.AST | None) -> str | None:
    """The text that a literal is."""
    match node:
        case ast.Constant(str(text)):
            return text
    return None


def is_pause(node: ast.AST) -> bool:
    """Whether a node does nothing but let time pass."""
    match node:
        case ast.Expr(ast.Call(ast.Name("sleep") | ast.Attribute(_, "sleep"))):
            return True
    return False


def names_in(node: ast.AST) -> frozenset[str]:
    """The variables that are read anywhere in a node."""
    return frozenset(n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load))


def names_set_in(node: ast.AST) -> frozenset[str]:
    """The variables that are set anywhere in a node."""
    return frozenset(n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))


def step(skill: str, *arguments: ast.expr) -> ast.Expr:
    """A statement that calls a skill."""
    return ast.Expr(ast.Call(ast.Name(skill, ast.Load()), list(arguments), []))


def literal(value: str | float) -> ast.Constant:
    """A literal."""
    return ast.Constant(value)


def sliced(items: ast.expr, lower: int | None, upper: int | None) -> ast.expr:
    """A part of what can be gone through, as `list(items)[lower:upper]`."""
    whole = ast.Call(ast.Name("list", ast.Load()), [items], [])
    return ast.Subscript(whole, ast.Slice(_bound(lower), _bound(upper)), ast.Load())


def _bound(number: int | None) -> ast.expr | None:
    if number is None:
        return None
    return literal(number) if number >= 0 else ast.UnaryOp(ast.USub(), literal(-number))
