"""Fuel, the deterministic limit of computing: a program is compiled so that each loop and call uses some."""

from __future__ import annotations

import ast
import types
from collections.abc import Iterator

from codebotler.simulator.sandbox import BY_NAME, CAUGHT, ENTER, ENTRY, FUEL, PROGRAM
from codebotler.simulator.sandbox.tame import is_tame

TASK = "task_program"
TOO_LARGE = "the program is too large, or nested too deeply"
DEEPEST = 250
MOST_BLOCKS = 20
BLOCKS = (ast.For, ast.AsyncFor, ast.While, ast.With, ast.AsyncWith, ast.Try, ast.TryStar)
SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.ClassDef)


def prepared(
    source: str, *, lowercase: bool, skills: frozenset[str] | None = None
) -> tuple[types.CodeType, frozenset[str], bool]:
    """A program's code, which uses fuel, the modules that it imports, and whether it is tame.

    It is looked at for that only where the skills are given that it may call.
    """
    if "\0" in source:
        line = source.count("\n", 0, source.index("\0")) + 1
        raise SyntaxError("source code cannot contain null characters", (PROGRAM, line, 1, None))
    try:
        tree = ast.parse(source, PROGRAM)
        nodes = list(walk(tree))
        imports = frozenset(name for node in nodes for name in imported(node))
        if lowercase:
            lower_literals(nodes)
        tame = skills is not None and is_tame(tree, nodes, skills)
        for node in nodes:
            use_fuel(node)
        for node in tree.body:
            note_entries(node)
        return compile(tree, PROGRAM, "exec", dont_inherit=True, optimize=0), imports, tame
    except (RecursionError, MemoryError):
        raise MemoryError(TOO_LARGE) from None


def walk(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes of a tree, unless it is nested too deeply, which versions of Python limit differently."""
    waiting: list[tuple[ast.AST, int, int]] = [(tree, 0, 0)]
    while waiting:
        node, depth, blocks = waiting.pop()
        if depth > DEEPEST:
            raise MemoryError
        if isinstance(node, SCOPES):
            blocks = 0
        elif isinstance(node, BLOCKS):
            blocks += 1
            if blocks > MOST_BLOCKS:
                raise SyntaxError("too many statically nested blocks", (PROGRAM, node.lineno, 1, None))
        yield node
        waiting.extend((child, depth + 1, blocks) for child in ast.iter_child_nodes(node))


def imported(node: ast.AST) -> list[str]:
    """The modules that a node imports."""
    match node:
        case ast.Import(names):
            return [alias.name for alias in names]
        case ast.ImportFrom(module=module, level=level):
            return ["." * level + (module or "")]
    return []


def lower_literals(nodes: list[ast.AST]) -> None:
    """Lower-case all string literals, but not the format specifications of f-strings."""
    specifications = {
        id(part)
        for node in nodes
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr)
        for part in node.format_spec.values
    }
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in specifications:
            node.value = node.value.lower()


def use_fuel(node: ast.AST) -> None:
    """Use fuel at the head of whatever a node runs again."""
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            insert_head(node, ENTRY)
        case ast.For() | ast.AsyncFor() | ast.While():
            node.body.insert(0, call(FUEL, node.body[0]))
        case ast.ExceptHandler():
            node.body.insert(0, call(CAUGHT, node.body[0]))
        case ast.Try() | ast.TryStar():
            if node.finalbody:
                node.finalbody.insert(0, call(CAUGHT, node.finalbody[0]))
        case ast.Lambda():
            spend = call(ENTRY, node.body).value
            node.body = ast.copy_location(ast.BoolOp(ast.Or(), [spend, node.body]), node.body)
        case ast.comprehension():
            spend = call(FUEL, node.iter).value
            node.ifs.insert(0, ast.copy_location(ast.UnaryOp(ast.Not(), spend), node.iter))
        case ast.Call(func=ast.Name(id=name)) if name == TASK:
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
        if not isinstance(node, SCOPES):
            waiting.extend(ast.iter_child_nodes(node))


def insert_head(node: ast.FunctionDef | ast.AsyncFunctionDef, name: str) -> None:
    """Call one of our functions first thing in a function, after its docstring."""
    at = 1 if ast.get_docstring(node, clean=False) is not None else 0
    node.body.insert(at, call(name, node.body[0]))


def call(name: str, where: ast.AST) -> ast.Expr:
    """The statement `name()`, with the line of another node."""
    function = ast.copy_location(ast.Name(name, ast.Load()), where)
    return ast.copy_location(ast.Expr(ast.copy_location(ast.Call(function, [], []), where)), where)
