"""Mutation operators that change numbers, counters and collections."""

from __future__ import annotations

import ast

from roboeval.mutation.operator import Context, Edits
from roboeval.mutation.program_tree import ProgramTree, expression, is_pause, names_in, rewrite, statement

BOUNDARIES = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}


def off_by_one(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that increases or decreases a number by one."""
    exact = {inner for node in program.nodes if _is_exact(node) for inner in ast.walk(node)}
    pauses = {inner for node in program.nodes if is_pause(node) for inner in ast.walk(node)}
    for node in program.nodes:
        match node:
            case ast.Constant(int(value)) if not isinstance(value, bool) and node in exact - pauses:
                yield {node: ast.Constant(value + 1)}
                if value > 0:
                    yield {node: ast.Constant(value - 1)}


def _is_exact(node: ast.AST) -> bool:
    """Whether numbers in a node are used to count, compare or scale. Other numbers may be arbitrary."""
    match node:
        case ast.Compare() | ast.Subscript() | ast.AugAssign():
            return True
        case ast.BinOp(op=ast.Mult() | ast.Div() | ast.FloorDiv()) | ast.Call(ast.Name("range" | "islice")):
            return True
        case ast.Constant(int(value)):
            return value in {0, 1}
    return False


def wrong_boundary(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that includes or excludes the boundary value of a comparison."""
    for node in program.nodes:
        match node:
            case ast.Compare(left, [comparison], right) if type(comparison) in BOUNDARIES:
                yield {node: ast.Compare(left, [BOUNDARIES[type(comparison)]()], right)}


def miscount(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that increases or decreases the result of a count, such as `len`, by one."""
    for node in program.nodes:
        match node:
            case ast.Call(ast.Name("len" | "sum") | ast.Attribute(_, "count"), [_, *_]):
                yield {node: expression("number + 1", number=node)}
                yield {node: expression("number - 1", number=node)}


def forget_to_count(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes an update of a counter or a collection."""
    return ({node: []} for node in program.nodes if _remembers(node))


def _remembers(node: ast.AST) -> bool:
    match node:
        case ast.AugAssign():
            return True
        case ast.Expr(ast.Call(ast.Attribute(_, name), [_, *_])):
            return name in {"append", "add", "extend", "update", "insert"}
        case ast.Assign([ast.Name(name)], ast.BinOp(ast.Name(again), ast.Add(), _)):
            return name == again
    return False


def only_the_last(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that overwrites a sum or list instead of adding to it, such as `n = x` for `n += x`."""
    for node in program.nodes:
        match node:
            case ast.AugAssign(target, ast.Add(), value):
                yield {node: ast.Assign([target], value)}
            case ast.Assign([ast.Name(name)], ast.BinOp(ast.Name(again), ast.Add(), value)) if name == again:
                yield {node: ast.Assign(node.targets, value)}
            case ast.Expr(ast.Call(ast.Attribute(ast.Name() as kept, "append"), [value])):
                yield {node: statement("kept = [value]", kept=kept, value=value)}
            case ast.Expr(ast.Call(ast.Attribute(ast.Name() as kept, "add"), [value])):
                yield {node: statement("kept = {value}", kept=kept, value=value)}


def wrong_sign(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces an addition with a subtraction, or the reverse."""
    for node in program.nodes:
        match node:
            case ast.AugAssign(target, ast.Add(), ast.Constant(int()) as value):
                yield {node: ast.AugAssign(target, ast.Sub(), value)}
            case ast.BinOp(
                ast.Constant(int()) | ast.Name() as left,
                ast.Add() | ast.Sub() as sign,
                ast.Constant(int()) as right,
            ):
                yield {node: ast.BinOp(left, ast.Sub() if isinstance(sign, ast.Add) else ast.Add(), right)}


def add_as_texts(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that joins numbers as text instead of adding them."""
    edit: dict[ast.AST, ast.AST] = {}
    names: set[str] = set()
    for node in program.nodes:
        match node:
            case ast.AugAssign(ast.Name(name), ast.Add(), ast.Call(ast.Name("int"), [text]) as number):
                names.add(name)
                edit[number] = text
    for node in program.nodes:
        match node:
            case ast.Assign(_, ast.Constant(0) as zero) if names & names_in(node, ast.Store):
                edit[zero] = ast.Constant("0")
    if names:
        yield edit


def reset_in_the_loop(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that resets a counter or a collection in each iteration of a loop."""
    for block in program.blocks:
        for at, loop in enumerate(block):
            if isinstance(loop, ast.For | ast.While):
                first = loop.body[0]
                starts = filter(_is_start, block[:at])
                yield from ({loop: rewrite(loop, {first: [start, first]})} for start in starts)


def _is_start(node: ast.stmt) -> bool:
    match node:
        case ast.Assign(_, ast.Constant() | ast.List() | ast.Dict() | ast.Tuple()):
            return True
        case ast.Assign(_, ast.Call(ast.Name("set" | "Counter"))):
            return True
    return False
