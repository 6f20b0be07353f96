"""Fuel, the deterministic limit of computing: a program is compiled so that each loop and call uses some."""

from __future__ import annotations

import ast
import types
from collections import defaultdict
from unicodedata import normalize

from codebotler.simulator.sandbox import BY_NAME, CAUGHT, ENTER, ENTRY, FUEL, PROGRAM
from codebotler.simulator.sandbox.tame import is_tame

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

TASK_NAME = "task_program"
PROGRAM_TOO_LARGE = "the program is too large, or nested too deeply"
MAX_DEPTH = 250
MAX_NESTED_BLOCKS = 20
BLOCK_NODES = (ast.For, ast.AsyncFor, ast.While, ast.With, ast.AsyncWith, ast.Try, ast.TryStar)
LEAF_FIELDS = frozenset({"ctx", "op", "ops"})  # fields whose nodes only name something
WITH_LEAVES = frozenset(
    {*(ast.Name, ast.Attribute, ast.Subscript, ast.Starred, ast.List, ast.Tuple), *(ast.BinOp, ast.BoolOp)}
    | {ast.UnaryOp, ast.Compare, ast.AugAssign}
)
SCOPE_NODES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.ClassDef)


def prepared(
    source: str, *, lowercase: bool, skills: frozenset[str] | None = None
) -> tuple[types.CodeType, bool]:
    """A program's code, which uses fuel, and whether it is tame.

    It is looked at for that only where the skills are given that it may call.
    """
    if "\0" in source:
        line = source.count("\n", 0, source.index("\0")) + 1
        raise SyntaxError("source code cannot contain null characters", (PROGRAM, line, 1, None))
    try:
        tree = ast.parse(normalize("NFC", source), PROGRAM)
        nodes = nodes_of(tree)
        if lowercase:
            lower_literals(nodes)
        tame = skills is not None and is_tame(tree, nodes, skills)
        use_fuel(nodes)
        for statement in tree.body:
            note_entries(statement)
        return compile(tree, PROGRAM, "exec", dont_inherit=True, optimize=0), tame
    except (RecursionError, MemoryError):
        raise MemoryError(PROGRAM_TOO_LARGE) from None


def nodes_of(tree: ast.AST) -> dict[type[ast.AST], list[Any]]:
    """The nodes of a tree by their type, without those that only name an operator or a context.

    Raises MemoryError or SyntaxError if it is nested too deeply, which versions of Python limit differently.
    """
    nodes: defaultdict[type[ast.AST], list[Any]] = defaultdict(list)
    waiting: list[tuple[ast.AST, int, int]] = [(tree, 0, 0)]
    while waiting:
        node, depth, blocks = waiting.pop()
        kind = type(node)
        if depth > MAX_DEPTH - (kind in WITH_LEAVES):
            raise MemoryError
        if kind in SCOPE_NODES:
            blocks = 0
        elif kind in BLOCK_NODES:
            blocks += 1
            if blocks > MAX_NESTED_BLOCKS:
                raise SyntaxError("too many statically nested blocks", (PROGRAM, node.lineno, 1, None))  # type: ignore[attr-defined]  # by the line above
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


def lower_literals(nodes: dict[type[ast.AST], list[Any]]) -> None:
    """Lower-case all string literals, but not the format specifications of f-strings."""
    specifications = {
        id(part)
        for node in nodes.get(ast.FormattedValue, ())
        if isinstance(node.format_spec, ast.JoinedStr)
        for part in node.format_spec.values
    }
    for node in nodes.get(ast.Constant, ()):
        if isinstance(node.value, str) and id(node) not in specifications:
            node.value = node.value.lower()


def use_fuel(nodes: dict[type[ast.AST], list[Any]]) -> None:
    """Use fuel at the head of whatever is run again."""
    for kind, insert in INSERTS.items():
        for node in nodes.get(kind, ()):
            insert(node)


def in_loop(node: ast.For | ast.AsyncFor | ast.While) -> None:
    """Use fuel in each turn of a loop."""
    node.body.insert(0, call(FUEL, node.body[0]))


def in_handler(node: ast.ExceptHandler) -> None:
    """Use fuel where something is caught."""
    node.body.insert(0, call(CAUGHT, node.body[0]))


def in_finally(node: ast.Try | ast.TryStar) -> None:
    """Use fuel where something may have been raised."""
    if node.finalbody:
        node.finalbody.insert(0, call(CAUGHT, node.finalbody[0]))


def in_function(node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
    """Use fuel when a function is entered."""
    insert_head(node, ENTRY)


def in_lambda(node: ast.Lambda) -> None:
    """Use fuel when a lambda is entered."""
    spend = call(ENTRY, node.body).value
    node.body = ast.copy_location(ast.BoolOp(ast.Or(), [spend, node.body]), node.body)


def in_comprehension(node: ast.comprehension) -> None:
    """Use fuel in each turn of a comprehension."""
    spend = call(FUEL, node.iter).value
    node.ifs.insert(0, ast.copy_location(ast.UnaryOp(ast.Not(), spend), node.iter))


def at_start(node: ast.Call) -> None:
    """Note that the task is called by its name."""
    if isinstance(node.func, ast.Name) and node.func.id == TASK_NAME:
        start = call(BY_NAME, node.func).value
        node.func = ast.copy_location(ast.BoolOp(ast.Or(), [start, node.func]), node.func)


def note_entries(statement: ast.stmt) -> None:
    """Note when functions of the module are entered: any may be the task, by whatever name."""
    waiting: list[ast.AST] = [statement]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            insert_head(node, ENTER)
        elif isinstance(node, ast.Lambda):
            enter = call(ENTER, node.body).value
            node.body = ast.copy_location(ast.BoolOp(ast.Or(), [enter, node.body]), node.body)
        if not isinstance(node, SCOPE_NODES):
            waiting.extend(ast.iter_child_nodes(node))


def insert_head(node: ast.FunctionDef | ast.AsyncFunctionDef, name: str) -> None:
    """Call one of our functions first thing in a function, after its docstring."""
    at = 1 if ast.get_docstring(node, clean=False) is not None else 0
    node.body.insert(at, call(name, node.body[0]))


def call(name: str, where: ast.AST) -> ast.Expr:
    """The statement `name()`, with the line of another node."""
    function = ast.copy_location(ast.Name(name, ast.Load()), where)
    return ast.copy_location(ast.Expr(ast.copy_location(ast.Call(function, [], []), where)), where)


INSERTS: dict[type[ast.AST], Callable[[Any], None]] = {
    **dict.fromkeys((ast.FunctionDef, ast.AsyncFunctionDef), in_function),
    **dict.fromkeys((ast.For, ast.AsyncFor, ast.While), in_loop),
    ast.ExceptHandler: in_handler,
    **dict.fromkeys((ast.Try, ast.TryStar), in_finally),
    ast.Lambda: in_lambda,
    ast.comprehension: in_comprehension,
    ast.Call: at_start,
}
