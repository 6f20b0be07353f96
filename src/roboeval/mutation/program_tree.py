"""Programs as syntax trees that operators read and rewrite; no tree is ever changed in place."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

from codebotler.core.cachedproperty import cached_property
from codebotler.core.program import Flaw, parsed
from codebotler.core.skills.declaration import by_name
from codebotler.simulator.isolated_call import IsolatedCallError, isolated

Node = TypeVar("Node", bound=ast.AST)
Edit: TypeAlias = Mapping[Any, ast.AST | list[ast.stmt]]  # replacements of nodes; a list for a statement


@dataclass(frozen=True, eq=False)
class ProgramTree:
    """A program that parses."""

    tree: ast.Module
    text: str  # without comments: all programs with the same tree share it

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes, always in the same order."""
        return tuple(ast.walk(self.tree))

    @cached_property
    def blocks(self) -> tuple[list[ast.stmt], ...]:
        """All sequences of statements, the innermost too."""
        names = ("body", "orelse", "finalbody")
        fields = (getattr(node, name, None) for node in self.nodes for name in names)
        return tuple(field for field in fields if isinstance(field, list) and field)

    @cached_property
    def loops(self) -> tuple[ast.For | ast.While, ...]:
        """All loops, without comprehensions."""
        return tuple(node for node in self.nodes if isinstance(node, ast.For | ast.While))

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


def read(program: str) -> ProgramTree | None:
    """The tree of a program; None if it does not parse, or is nested too deeply to be unparsed."""
    tree = parsed(program)
    try:
        return (
            None if isinstance(tree, Flaw) or not compiles(program) else ProgramTree(tree, ast.unparse(tree))
        )
    except (RecursionError, ValueError):  # nested too deeply, or a number with too many digits
        return None


def compiles(program: str) -> bool:
    """Whether a program compiles, within a few seconds and half a gigabyte."""
    try:
        return _compiles(program)
    except IsolatedCallError:
        return False


@isolated("def task_program():\n    pass\n")
def _compiles(program: str) -> bool:
    return not isinstance(parsed(program, compiled=True), Flaw)


def rewritten(node: Node, edit: Edit) -> Node:
    """A copy of a tree with some nodes replaced; a block that loses all statements gets a `pass`."""
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


def changed(program: ProgramTree, edit: Edit) -> str | None:
    """The text of an edited program; None if it no longer compiles, such as with a stray `break`."""
    try:
        text = ast.unparse(ast.fix_missing_locations(rewritten(program.tree, edit)))
    except (RecursionError, ValueError):
        return None
    return text if compiles(text) else None


# --- what stands in a tree


def skill_of(node: ast.AST) -> str | None:
    """The skill that an expression calls."""
    match node:
        case ast.Call(ast.Name(name)) if by_name(name) is not None:
            return name
    return None


def skills_in(node: ast.AST) -> frozenset[str]:
    """The skills that are called anywhere in a node."""
    return frozenset(name for inner in ast.walk(node) if (name := skill_of(inner)))


def argument(call: ast.Call, position: int) -> ast.expr | None:
    """The argument for a skill's parameter number `position`, from 0, passed by place or by name."""
    if position < len(call.args):
        starred = any(isinstance(a, ast.Starred) for a in call.args[: position + 1])
        return None if starred else call.args[position]
    skill = by_name(skill_of(call) or "")
    assert skill is not None, "it calls a skill"
    name = skill.parameters[position].name
    return next((keyword.value for keyword in call.keywords if keyword.arg == name), None)


def text_of(node: ast.AST | None) -> str | None:
    """The value of a string literal; None for other nodes."""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def is_pause(node: ast.AST) -> bool:
    """Whether a node only lets time pass."""
    match node:
        case ast.Expr(ast.Call(ast.Name("sleep") | ast.Attribute(_, "sleep"))):
            return True
    return False


def names_in(node: ast.AST, context: type[ast.expr_context]) -> frozenset[str]:
    """The variables that are read (`ast.Load`) or set (`ast.Store`) anywhere in a node."""
    return frozenset(n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, context))


# --- new nodes


def statement(template: str, **parts: ast.expr) -> ast.stmt:
    """The statement that a template spells, with expressions in place of some names."""
    tree = ast.parse(template).body[0]
    names = (node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in parts)
    return rewritten(tree, {name: parts[name.id] for name in names})


def expression(template: str, **parts: ast.expr) -> ast.expr:
    """The expression that a template spells, with others in place of some names."""
    tree = statement(template, **parts)
    assert isinstance(tree, ast.Expr)
    return tree.value
