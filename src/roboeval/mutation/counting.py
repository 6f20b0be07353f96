"""Operators about numbers and about what the robot remembers."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from roboeval.mutation.operator import Operator, Setting
from roboeval.mutation.rewriting import Edit, Source, is_pause, literal, names_set_in, rewritten

BOUNDARIES: dict[type[ast.cmpop], ast.cmpop] = {
    ast.Lt: ast.LtE(),
    ast.LtE: ast.Lt(),
    ast.Gt: ast.GtE(),
    ast.GtE: ast.Gt(),
}
GATHERING = {"append": ast.List, "add": ast.Set, "extend": None, "update": None, "insert": None}


def off_by_one(source: Source, _: Setting) -> Iterator[Edit]:
    """Write a number that is one too large or too small, where one more or less must make a difference."""
    exact = {inner for node in source.nodes if _is_exact(node) for inner in ast.walk(node)}
    pauses = {inner for node in source.nodes if is_pause(node) for inner in ast.walk(node)}
    for node in source.nodes:
        match node:
            case ast.Constant(int(value)) if not isinstance(value, bool) and node in exact - pauses:
                yield {node: literal(value + 1)}
                if value > 0:
                    yield {node: literal(value - 1)}


def _is_exact(node: ast.AST) -> bool:
    """Whether the numbers in a node count, compare or scale, and do not merely propose something."""
    match node:
        case ast.Compare() | ast.Subscript() | ast.AugAssign():
            return True
        case ast.BinOp(op=ast.Mult() | ast.Div() | ast.FloorDiv()) | ast.Call(ast.Name("range" | "islice")):
            return True
        case ast.Constant(int(value)):
            return value in {0, 1}
    return False


def wrong_boundary(source: Source, _: Setting) -> Iterator[Edit]:
    """Compare with <= instead of <, and the like."""
    for node in source.nodes:
        match node:
            case ast.Compare(left, [operator], right) if type(operator) in BOUNDARIES:
                yield {node: ast.Compare(left, [BOUNDARIES[type(operator)]], right)}


def miscount(source: Source, _: Setting) -> Iterator[Edit]:
    """Take a length, a sum or a count for one more, or one less, than it is."""
    for node in source.nodes:
        match node:
            case ast.Call(ast.Name("len" | "sum") | ast.Attribute(_, "count"), [_, *_]):
                yield {node: ast.BinOp(node, ast.Add(), literal(1))}
                yield {node: ast.BinOp(node, ast.Sub(), literal(1))}


def _gathers(statement: ast.stmt) -> bool:
    """Whether a statement adds to what was remembered before."""
    match statement:
        case ast.AugAssign():
            return True
        case ast.Expr(ast.Call(ast.Attribute(_, name), [_, *_])) if name in GATHERING:
            return True
        case ast.Assign([ast.Name(name)], ast.BinOp(ast.Name(again), ast.Add(), _)) if name == again:
            return True
    return False


def forget_to_count(source: Source, _: Setting) -> Iterator[Edit]:
    """Do not remember it."""
    yield from ({statement: []} for statement in source.statements if _gathers(statement))


def only_the_last(source: Source, _: Setting) -> Iterator[Edit]:
    """Remember only what came last."""
    for statement in source.statements:
        match statement:
            case ast.AugAssign(target, ast.Add(), value):
                yield {statement: [ast.Assign([target], value)]}
            case ast.Assign([ast.Name(name) as target], ast.BinOp(ast.Name(again), ast.Add(), value)) if (
                name == again
            ):
                yield {statement: [ast.Assign([target], value)]}
            case ast.Expr(ast.Call(ast.Attribute(ast.Name(name), "append"), [value])):
                yield {statement: [ast.Assign([ast.Name(name, ast.Store())], ast.List([value], ast.Load()))]}
            case ast.Expr(ast.Call(ast.Attribute(ast.Name(name), "add"), [value])):
                yield {statement: [ast.Assign([ast.Name(name, ast.Store())], ast.Set([value]))]}


def subtract(source: Source, _: Setting) -> Iterator[Edit]:
    """Take away instead of adding, and the other way round."""
    for node in source.nodes:
        match node:
            case ast.AugAssign(target, ast.Add(), ast.Constant(int()) as value):
                yield {node: [ast.AugAssign(target, ast.Sub(), value)]}
            case ast.BinOp(
                ast.Constant(int()) | ast.Name() as left,
                ast.Add() | ast.Sub() as way,
                ast.Constant(int()) as right,
            ):
                yield {node: ast.BinOp(left, ast.Sub() if isinstance(way, ast.Add) else ast.Add(), right)}


def add_as_texts(source: Source, _: Setting) -> Iterator[Edit]:
    """Put digits together instead of adding numbers."""
    edit: dict[ast.AST, ast.AST] = {}
    names: set[str] = set()
    for node in source.nodes:
        match node:
            case ast.AugAssign(ast.Name(name), ast.Add(), ast.Call(ast.Name("int"), [text]) as number):
                names.add(name)
                edit[number] = text
    for node in source.nodes:
        match node:
            case ast.Assign(targets, ast.Constant(0) as zero) if any(
                names & names_set_in(target) for target in targets
            ):
                edit[zero] = literal("0")
    if names:
        yield edit


def reset_in_loop(source: Source, _: Setting) -> Iterator[Edit]:
    """Begin to count anew with each turn of a loop."""
    for block in source.blocks:
        for at, loop in enumerate(block):
            if not isinstance(loop, ast.For | ast.While):
                continue
            for statement in block[:at]:
                match statement:
                    case ast.Assign(
                        _,
                        ast.Constant()
                        | ast.List()
                        | ast.Dict()
                        | ast.Tuple()
                        | ast.Call(ast.Name("set" | "Counter")),
                    ):
                        inside = rewritten(loop, {loop.body[0]: [statement, loop.body[0]]})
                        assert isinstance(inside, ast.stmt)
                        yield {loop: inside}


OPERATORS = (
    Operator("off-by-one", "Writes a number that is off by one.", off_by_one),
    Operator("wrong-boundary", "Stops one turn too late or too early.", wrong_boundary),
    Operator("miscount", "Takes a number for one more or one less than it is.", miscount),
    Operator("forget-to-count", "Does not remember what it was to remember.", forget_to_count),
    Operator("only-the-last", "Remembers only what came last.", only_the_last),
    Operator("wrong-sign", "Takes away instead of adding, or adds instead of taking away.", subtract),
    Operator("add-as-texts", "Puts digits together instead of adding numbers.", add_as_texts),
    Operator("reset-in-the-loop", "Begins to count anew with each turn of a loop.", reset_in_loop),
)
