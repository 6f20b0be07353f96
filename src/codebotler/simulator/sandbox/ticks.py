"""A program made ready to run: parsed, its literals lowered, and every loop and function counted."""

from __future__ import annotations

import ast
import types

PROGRAM = "<program>"
TICK, ENTRY, ENTER = "<tick>", "<entry>", "<enter>"  # names that no source text can spell


def prepared(source: str, *, lowercase: bool) -> types.CodeType:
    """Parse a program, lower its literals if the suite wants it, and compile it with ticks.

    Raises:
        SyntaxError: it does not parse (and what else the compiler raises).
    """
    if "\0" in source:
        line = source.count("\n", 0, source.index("\0")) + 1
        raise SyntaxError("source code cannot contain null characters", (PROGRAM, line, 1, None))
    tree = ast.parse(source, PROGRAM)
    nodes = list(ast.walk(tree))
    if lowercase:
        lower_literals(nodes)
    for node in nodes:
        add_ticks(node)
    return compile(tree, PROGRAM, "exec", dont_inherit=True)


def lower_literals(nodes: list[ast.AST]) -> None:
    """Lower all texts that stand in the program, but not the format specifications of f-strings."""
    specifications = {
        id(part)
        for node in nodes
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr)
        for part in node.format_spec.values
    }
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in specifications:
            node.value = node.value.lower()


def add_ticks(node: ast.AST) -> None:
    """Count a node's turns or entries: a tick at the head of what it runs again."""
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            head = [call(ENTRY, node.body[0])]
            if node.name == "task_program":
                head.append(call(ENTER, node.body[0]))
            at = 1 if ast.get_docstring(node, clean=False) is not None else 0
            node.body[at:at] = head
        case ast.For() | ast.AsyncFor() | ast.While() | ast.ExceptHandler():
            node.body.insert(0, call(TICK, node.body[0]))
        case ast.Try() | ast.TryStar():
            if node.finalbody:
                node.finalbody.insert(0, call(TICK, node.finalbody[0]))
        case ast.Lambda():
            tick = call(ENTRY, node.body).value
            node.body = ast.copy_location(ast.BoolOp(ast.Or(), [tick, node.body]), node.body)
        case ast.comprehension():
            tick = call(TICK, node.iter).value
            node.ifs.insert(0, ast.copy_location(ast.UnaryOp(ast.Not(), tick), node.iter))


def call(name: str, where: ast.AST) -> ast.Expr:
    """The statement `name()`, said to stand where another node stands."""
    function = ast.copy_location(ast.Name(name, ast.Load()), where)
    return ast.copy_location(ast.Expr(ast.copy_location(ast.Call(function, [], []), where)), where)
