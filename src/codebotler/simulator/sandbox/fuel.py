"""Fuel, a deterministic limit on computation: each loop iteration and each function call uses some."""

from __future__ import annotations

import ast
import types
from collections import defaultdict
from unicodedata import normalize

from codebotler.simulator.sandbox import BY_NAME, CAUGHT, ENTER, ENTRY, FUEL, PROGRAM
from codebotler.simulator.sandbox.tame import is_tame

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

TASK_NAME = "task_program"
PROGRAM_TOO_LARGE = "the program is too large, or nested too deeply"
MAX_TREE_DEPTH = 250
MAX_NESTED_BLOCKS = 20
BLOCK_NODES = (ast.For, ast.AsyncFor, ast.While, ast.With, ast.AsyncWith, ast.Try, ast.TryStar)
LEAF_FIELDS = frozenset({"ctx", "op", "ops"})  # fields that hold operators and contexts
FUELED_BLOCKS: tuple[tuple[str, str, tuple[type[ast.AST], ...]], ...] = (
    (FUEL, "body", (ast.For, ast.AsyncFor, ast.While)),
    (CAUGHT, "body", (ast.ExceptHandler,)),
    (CAUGHT, "finalbody", (ast.Try, ast.TryStar)),
)
SCOPE_NODES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.ClassDef)


def prepared(
    source: str, *, lowercase: bool, skills: frozenset[str] | None = None
) -> tuple[types.CodeType, bool]:
    """Compile a program so that its steps are counted. Also return whether it may share a process.

    `lowercase` makes its string literals lowercase. Without the names of the `skills`, no process is shared.
    """
    if "\0" in source:
        line = source.count("\n", 0, source.index("\0")) + 1
        raise SyntaxError("source code cannot contain null characters", (PROGRAM, line, 1, None))
    try:
        tree = ast.parse(normalize("NFC", source), PROGRAM)
        nodes = nodes_of(tree)
        if lowercase:
            _lower_literals(nodes)
        tame = skills is not None and is_tame(tree, nodes, skills)
        _use_fuel(nodes)
        for statement in tree.body:
            _note_entries(statement)
        return compile(tree, PROGRAM, "exec", dont_inherit=True, optimize=0), tame
    except (RecursionError, MemoryError):
        raise MemoryError(PROGRAM_TOO_LARGE) from None


def nodes_of(tree: ast.AST) -> dict[type[ast.AST], list[Any]]:
    """Return the nodes of a tree by type, without operators and contexts.

    Raise MemoryError or SyntaxError if the tree is nested too deeply, since Python's limits vary by version.
    """
    nodes: defaultdict[type[ast.AST], list[Any]] = defaultdict(list)
    waiting: list[tuple[ast.AST, int, int]] = [(tree, 0, 0)]
    while waiting:
        node, depth, blocks = waiting.pop()
        kind = type(node)
        if depth > MAX_TREE_DEPTH:
            raise MemoryError
        if kind in SCOPE_NODES:
            blocks = 0
        elif kind in BLOCK_NODES:
            blocks += 1
            if blocks > MAX_NESTED_BLOCKS:
                raise SyntaxError("too many statically nested blocks", (PROGRAM, node.lineno, 1, None))  # type: ignore[attr-defined]  # all block nodes have it
        nodes[kind].append(node)
        depth += 1
        for name in kind._fields:
            if name not in LEAF_FIELDS:
                child = getattr(node, name, None)
                if type(child) is list:
                    waiting += [(each, depth, blocks) for each in child if isinstance(each, ast.AST)]
                elif isinstance(child, ast.AST):
                    waiting.append((child, depth, blocks))
    return nodes


def _lower_literals(nodes: dict[type[ast.AST], list[Any]]) -> None:
    """Convert all string literals to lowercase, except for format specifications in f-strings."""
    specifications = {
        id(part)
        for node in nodes.get(ast.FormattedValue, ())
        if isinstance(node.format_spec, ast.JoinedStr)
        for part in node.format_spec.values
    }
    for node in nodes.get(ast.Constant, ()):
        if isinstance(node.value, str) and id(node) not in specifications:
            node.value = node.value.lower()


def _use_fuel(nodes: dict[type[ast.AST], list[Any]]) -> None:
    """Insert calls that use fuel wherever code may repeat, and calls that record a call of the task."""
    for node in (*nodes.get(ast.FunctionDef, ()), *nodes.get(ast.AsyncFunctionDef, ())):
        _insert_head(node, ENTRY)
    for name, part, kinds in FUELED_BLOCKS:
        for node in (node for kind in kinds for node in nodes.get(kind, ())):
            block = getattr(node, part)
            if block:
                block.insert(0, _call(name, block[0]))
    for node in nodes.get(ast.Lambda, ()):
        node.body = _call_before(ENTRY, node.body)
    for node in nodes.get(ast.comprehension, ()):
        spend = _call(FUEL, node.iter).value
        node.ifs.insert(0, ast.copy_location(ast.UnaryOp(ast.Not(), spend), node.iter))
    for node in nodes.get(ast.Call, ()):
        if isinstance(node.func, ast.Name) and node.func.id == TASK_NAME:
            node.func = _call_before(BY_NAME, node.func)


def _note_entries(statement: ast.stmt) -> None:
    """Insert calls that record each entry of a module function, which may be the task by another name."""
    waiting: list[ast.AST] = [statement]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            _insert_head(node, ENTER)
        elif isinstance(node, ast.Lambda):
            node.body = _call_before(ENTER, node.body)
        if not isinstance(node, SCOPE_NODES):
            waiting.extend(ast.iter_child_nodes(node))


def _insert_head(node: ast.FunctionDef | ast.AsyncFunctionDef, name: str) -> None:
    at = 1 if ast.get_docstring(node, clean=False) is not None else 0
    node.body.insert(at, _call(name, node.body[0]))


def _call(name: str, where: ast.AST) -> ast.Expr:
    function = ast.copy_location(ast.Name(name, ast.Load()), where)
    return ast.copy_location(ast.Expr(ast.copy_location(ast.Call(function, [], []), where)), where)


def _call_before(name: str, node: ast.expr) -> ast.expr:
    """Return the expression `name() or node`, which equals `node` because our functions return None."""
    return ast.copy_location(ast.BoolOp(ast.Or(), [_call(name, node).value, node]), node)
