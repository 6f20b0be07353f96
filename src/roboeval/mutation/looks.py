"""Operators about what the robot looks for."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from roboeval.mutation.operator import Operator, Setting, others
from roboeval.mutation.rewriting import Edit, Source, argument, literal, rewritten, text_of

SEEN, TURNS = "seen_once", "turns"
NOWHERE = "unicorn"


def _looks(source: Source) -> Iterator[ast.Call]:
    """The looks whose result decides; not one of two of which either would do."""
    idle = {call for _, call in source.steps("is_in_room")}
    for node in source.nodes:
        match node:
            case ast.BoolOp(ast.Or(), values):
                idle.update(value for value in values if isinstance(value, ast.Call))
    yield from (call for call in source.calls("is_in_room") if call not in idle)


def drop_look(source: Source, _: Setting) -> Iterator[Edit]:
    """Take it for granted that somebody or something is there."""
    for call in _looks(source):
        yield {call: ast.Constant(value=True)}


def see_nothing(source: Source, _: Setting) -> Iterator[Edit]:
    """Take it for granted that nobody and nothing is there."""
    for call in _looks(source):
        yield {call: ast.Constant(value=False)}


def look_once(source: Source, _: Setting) -> Iterator[Edit]:
    """Look before the loop, and never again in it."""
    looks = set(_looks(source))
    for loop in source.loops:
        for call in (node for node in ast.walk(loop) if node in looks):
            assert isinstance(call, ast.Call)
            if text_of(argument(call, 0)) is not None:
                first = ast.Assign([ast.Name(SEEN, ast.Store())], call)
                after = rewritten(loop, {call: ast.Name(SEEN, ast.Load())})
                assert isinstance(after, ast.stmt)
                yield {loop: [first, after]}


def look_at_first_only(source: Source, _: Setting) -> Iterator[Edit]:
    """Look in the first two turns of a loop, and no more in the others."""
    looks = set(_looks(source))
    for loop in source.loops:
        for call in (node for node in ast.walk(loop) if node in looks):
            late = ast.Compare(ast.Name(TURNS, ast.Load()), [ast.Gt()], [literal(2)])
            after = rewritten(loop, {call: ast.BoolOp(ast.Or(), [late, call])})
            assert isinstance(after, ast.For | ast.While)
            count = ast.AugAssign(ast.Name(TURNS, ast.Store()), ast.Add(), literal(1))
            after.body.insert(0, count)
            yield {loop: [ast.Assign([ast.Name(TURNS, ast.Store())], literal(0)), after]}


def look_afterwards(source: Source, _: Setting) -> Iterator[Edit]:
    """Act first, and look then."""
    looks = set(_looks(source))
    for node in source.nodes:
        match node:
            case ast.If(ast.Call() as look, body, rest) | ast.If(
                ast.UnaryOp(ast.Not(), ast.Call() as look), body, rest
            ) if look in looks:
                yield {node: [ast.If(ast.Constant(value=True), [*body, ast.Expr(look)], rest)]}


def look_for_another(source: Source, setting: Setting) -> Iterator[Edit]:
    """Look for another thing or person, or for something that is nowhere."""
    for call in _looks(source):
        wanted = argument(call, 0)
        name = text_of(wanted)
        if wanted is None or name is None:
            continue
        for known in (setting.things, setting.people):
            if name.lower() in {one.lower() for one in known}:
                yield from ({wanted: literal(other)} for other in others(known, name, most=1))
        yield {wanted: literal(NOWHERE)}


def look_at_the_name(source: Source, _: Setting) -> Iterator[Edit]:
    """Look for the word in the name of the room, and never into the room."""
    looks = set(_looks(source))
    for loop in source.loops:
        if not isinstance(loop, ast.For) or not isinstance(loop.target, ast.Name):
            continue
        for call in (node for node in ast.walk(loop) if node in looks):
            assert isinstance(call, ast.Call)
            wanted = argument(call, 0)
            if wanted is not None:
                yield {call: ast.Compare(wanted, [ast.In()], [ast.Name(loop.target.id, ast.Load())])}


OPERATORS = (
    Operator("drop-the-look", "Does not look, and takes it that somebody or something is there.", drop_look),
    Operator("see-nothing", "Does not look, and takes it that nobody and nothing is there.", see_nothing),
    Operator("look-once", "Looks once, before a loop, and relies on it.", look_once),
    Operator("look-at-first-only", "Looks twice, and takes it for granted from then on.", look_at_first_only),
    Operator("look-afterwards", "Acts first, and looks then.", look_afterwards),
    Operator("look-for-another", "Looks for something or somebody else.", look_for_another),
    Operator(
        "look-at-the-name",
        "Looks for a word in the name of the room and not into the room.",
        look_at_the_name,
    ),
)
