"""Programs as syntax trees that operators search and rewrite; trees are never changed in place."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

from codebotler.core.cachedproperty import cached_property
from codebotler.core.program import Flaw, parse_program
from codebotler.core.skills.declaration import by_name
from codebotler.simulator.isolated_call import IsolatedCallError, isolated

Node = TypeVar("Node", bound=ast.AST)
Edit: TypeAlias = Mapping[Any, ast.AST | list[ast.stmt]]  # replacements by node; a list replaces a statement


@dataclass(frozen=True, eq=False)
class ProgramTree:
    """A program that parses."""

    tree: ast.Module
    text: str  # normalised by `ast.unparse`

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes in a fixed order."""
        return tuple(ast.walk(self.tree))

    @cached_property
    def blocks(self) -> tuple[list[ast.stmt], ...]:
        """All sequences of statements, including nested ones."""
        names = ("body", "orelse", "finalbody")
        fields = (getattr(node, name, None) for node in self.nodes for name in names)
        return tuple(field for field in fields if isinstance(field, list) and field)

    @cached_property
    def loops(self) -> tuple[ast.For | ast.While, ...]:
        """All loops except comprehensions."""
        return tuple(node for node in self.nodes if isinstance(node, ast.For | ast.While))

    def calls(self, *skills: str) -> Iterator[ast.Call]:
        """The calls of the skills."""
        for node in self.nodes:
            if isinstance(node, ast.Call) and skill_of(node) in skills:
                yield node

    def steps(self, *skills: str) -> Iterator[tuple[ast.Expr, ast.Call]]:
        """The statements that only call one of the skills."""
        for node in self.nodes:
            match node:
                case ast.Expr(ast.Call() as call) if skill_of(call) in skills:
                    yield node, call


def parse_tree(program: str) -> ProgramTree | None:
    """Parse a program; None if that fails or if it is nested too deeply."""
    tree = parse_program(program)
    if isinstance(tree, Flaw) or not is_compilable(program):
        return None
    try:
        return ProgramTree(tree, ast.unparse(tree))
    except (RecursionError, ValueError):  # nested too deeply, or a number with too many digits
        return None


def is_compilable(program: str) -> bool:
    """Whether a program compiles, within limits of time and memory."""
    try:
        return _compiles(program)
    except IsolatedCallError:
        return False


@isolated("def task_program():\n    pass\n")
def _compiles(program: str) -> bool:
    return not isinstance(parse_program(program, compiled=True), Flaw)


def rewrite(node: Node, edit: Edit) -> Node:
    """Copy a tree and replace some nodes; an empty block gets a `pass`."""
    fields: dict[str, object] = {}
    for name, value in ast.iter_fields(node):
        if isinstance(value, list):
            new: list[object] = []
            for item in value:
                new_item = _replace(item, edit)
                new += new_item if isinstance(new_item, list) else [new_item]
            fields[name] = new or ([ast.Pass()] if name == "body" and value else [])
        else:
            fields[name] = _replace(value, edit)
    return type(node)(**fields)


def _replace(value: object, edit: Edit) -> object:
    if not isinstance(value, ast.AST):
        return value
    return edit[value] if value in edit else rewrite(value, edit)


def apply_edit(program: ProgramTree, edit: Edit) -> str | None:
    """Return the text of an edited program; None if it does not compile, as with a stray `break`."""
    try:
        text = ast.unparse(ast.fix_missing_locations(rewrite(program.tree, edit)))
    except (RecursionError, ValueError):
        return None
    return text if is_compilable(text) else None


# --- queries


def skill_of(node: ast.AST) -> str | None:
    """The skill that an expression calls; None if it calls none."""
    match node:
        case ast.Call(ast.Name(name)) if by_name(name) is not None:
            return name
    return None


def skills_in(node: ast.AST) -> frozenset[str]:
    """The skills that a node calls."""
    return frozenset(name for inner in ast.walk(node) if (name := skill_of(inner)))


def argument(call: ast.Call, position: int) -> ast.expr | None:
    """The argument for a skill's parameter at `position`, from 0, passed by position or by name."""
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
    """Whether a node only waits."""
    match node:
        case ast.Expr(ast.Call(ast.Name("sleep") | ast.Attribute(_, "sleep"))):
            return True
    return False


def names_in(node: ast.AST, context: type[ast.expr_context]) -> frozenset[str]:
    """The variables that a node reads (`ast.Load`) or sets (`ast.Store`)."""
    return frozenset(n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, context))


# --- new nodes


def statement(template: str, **parts: ast.expr) -> ast.stmt:
    """Parse a statement and replace some of its names by expressions."""
    tree = ast.parse(template).body[0]
    names = (node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in parts)
    return rewrite(tree, {name: parts[name.id] for name in names})


def expression(template: str, **parts: ast.expr) -> ast.expr:
    """Parse an expression and replace some of its names by other expressions."""
    tree = statement(template, **parts)
    assert isinstance(tree, ast.Expr)
    return tree.value
