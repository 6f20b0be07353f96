"""Operators about order, conditions and loops."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import pairwise

from codebotler.program import TASK
from roboeval.mutation.operator import Operator, Setting
from roboeval.mutation.rewriting import (
    Edit,
    Source,
    is_pause,
    literal,
    rewritten,
    skill_of,
    skills_in,
    sliced,
)

COMPOUND = ast.If | ast.For | ast.While | ast.With | ast.Try | ast.FunctionDef | ast.ClassDef | ast.Match
INVERSES: dict[type[ast.cmpop], ast.cmpop] = {
    ast.Eq: ast.NotEq(),
    ast.NotEq: ast.Eq(),
    ast.In: ast.NotIn(),
    ast.NotIn: ast.In(),
    ast.Is: ast.IsNot(),
    ast.IsNot: ast.Is(),
    ast.Lt: ast.GtE(),
    ast.GtE: ast.Lt(),
    ast.Gt: ast.LtE(),
    ast.LtE: ast.Gt(),
}


def _tests(source: Source) -> Iterator[ast.expr]:
    """All conditions."""
    for node in source.nodes:
        match node:
            case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
                yield test
            case ast.comprehension(ifs=tests):
                yield from tests


def _negated(test: ast.expr) -> ast.expr:
    match test:
        case ast.UnaryOp(ast.Not(), inner):
            return inner
        case ast.Compare(left, [operator], right):
            return ast.Compare(left, [INVERSES[type(operator)]], right)
    return ast.UnaryOp(ast.Not(), test)


def negate(source: Source, _: Setting) -> Iterator[Edit]:
    """Take a condition for its opposite."""
    for test in _tests(source):
        yield {test: _negated(test)}
        if isinstance(test, ast.BoolOp):
            yield from ({part: _negated(part)} for part in test.values)


def whatever(source: Source, _: Setting) -> Iterator[Edit]:
    """Do it in any case; a condition of a loop is left as it is, for the loop would never end."""
    looped = {loop.test for loop in source.loops if isinstance(loop, ast.While)}
    for test in _tests(source):
        if test not in looped and not isinstance(test, ast.Constant):
            yield {test: ast.Constant(value=True)}
    for node in source.nodes:
        match node:
            case ast.Call(ast.Name("filter"), [_, items]):
                yield {node: items}


def never(source: Source, _: Setting) -> Iterator[Edit]:
    """Do it in no case."""
    for test in _tests(source):
        if not (isinstance(test, ast.Constant) and test.value is False):
            yield {test: ast.Constant(value=False)}


def and_or(source: Source, _: Setting) -> Iterator[Edit]:
    """Take `and` for `or`, and the other way round; of two looks either does."""
    for node in source.nodes:
        match node:
            case ast.BoolOp(operator, values) if {skill_of(value) for value in values} != {"is_in_room"}:
                yield {node: ast.BoolOp(ast.Or() if isinstance(operator, ast.And) else ast.And(), values)}


def drop_else(source: Source, _: Setting) -> Iterator[Edit]:
    """Do nothing otherwise, where something else than a pause is to be done."""
    for node in source.nodes:
        match node:
            case ast.If(test, body, [_, *_] as otherwise) if not all(map(is_pause, otherwise)):
                yield {node: [ast.If(test, body, [])]}


def swap_steps(source: Source, _: Setting) -> Iterator[Edit]:
    """Do two steps in the wrong order; two sentences, two questions, or an idle look have none."""
    idle = {statement for statement, _ in source.steps("is_in_room")}
    for block in source.blocks:
        for first, second in pairwise(block):
            if idle & {first, second}:
                continue
            kinds = skills_in(first), skills_in(second)
            defines = isinstance(first, ast.FunctionDef | ast.ClassDef)
            if not defines and all(kinds) and (kinds[0] != kinds[1] or "go_to" in kinds[0]):
                yield {first: second, second: first}


def stop_at_first(source: Source, _: Setting) -> Iterator[Edit]:
    """Leave a loop after its first turn, or after the first turn in which something was done."""
    for loop in source.loops:
        last = loop.body[-1]
        yield {last: [last, ast.Break()]}
        for inner in _inside(loop.body):
            match inner:
                case ast.If(body=[*_, end]) if skills_in(loop) and not isinstance(
                    end, ast.Continue | ast.Break | ast.Return
                ):
                    yield {end: [end, ast.Break()]}
                case ast.Continue():
                    yield {inner: [ast.Break()]}


def _inside(block: list[ast.stmt]) -> Iterator[ast.stmt]:
    """The statements of a loop's body that belong to no inner loop."""
    for statement in block:
        yield statement
        if isinstance(statement, ast.If):
            yield from _inside(statement.body)
            yield from _inside(statement.orelse)


def go_on_after_the_find(source: Source, _: Setting) -> Iterator[Edit]:
    """Do not stop where it should stop."""
    for statement in source.statements:
        match statement:
            case ast.Break() | ast.Continue() | ast.Return(value=None):
                yield {statement: []}


def give_up(source: Source, _: Setting) -> Iterator[Edit]:
    """Wait not at all, or three times at most."""
    for loop in source.loops:
        if isinstance(loop, ast.While):
            for turns in (1, 3):
                tries = ast.Call(ast.Name("range", ast.Load()), [literal(turns)], [])
                guard = [] if _is_true(loop.test) else [ast.If(_negated(loop.test), [ast.Break()], [])]
                body = [*guard, *loop.body]
                yield {loop: [ast.For(ast.Name("_", ast.Store()), tries, body, loop.orelse)]}


def _is_true(test: ast.expr) -> bool:
    return isinstance(test, ast.Constant) and bool(test.value)


def stop_half_way(source: Source, _: Setting) -> Iterator[Edit]:
    """End before all is done."""
    for node in source.nodes:
        if isinstance(node, ast.FunctionDef) and node.name == TASK:
            doing = [s for s in node.body[:-1] if skills_in(s) and not isinstance(s, ast.Return)]
            yield from ({statement: [statement, ast.Return()]} for statement in doing)


def into_the_loop(source: Source, _: Setting) -> Iterator[Edit]:
    """Do in every turn of a loop what should be done after it."""
    for block in source.blocks:
        for loop, after in pairwise(block):
            if isinstance(loop, ast.For | ast.While) and skills_in(after):
                end = loop.body[-1]
                inside = rewritten(loop, {end: [end, after]})
                assert isinstance(inside, ast.stmt)
                yield {loop: inside, after: []}


def before_the_last(source: Source, _: Setting) -> Iterator[Edit]:
    """Do what should come after a loop before its last turn."""
    for block in source.blocks:
        for at, loop in enumerate(block):
            after = block[at + 1 :]
            if isinstance(loop, ast.For) and any(map(skills_in, after)) and skills_in(loop):
                most, last = (
                    ast.For(loop.target, sliced(loop.iter, *bounds), loop.body, [])
                    for bounds in ((None, -1), (-1, None))
                )
                yield {loop: most, after[-1]: [after[-1], last]}


def out_of_the_block(source: Source, _: Setting) -> Iterator[Edit]:
    """Do after a loop or a condition what should be done in it."""
    for node in source.nodes:
        match node:
            case ast.For(body=[_, *_, last]) | ast.While(body=[_, *_, last]) | ast.If(body=[_, *_, last]):
                if isinstance(last, ast.Break | ast.Continue | ast.Return) or not skills_in(last):
                    continue
                rest = rewritten(node, {last: []})
                assert isinstance(rest, ast.stmt)
                yield {node: [rest, last]}


OPERATORS = (
    Operator(
        "before-the-last", "Does before the last turn of a loop what should come after it.", before_the_last
    ),
    Operator("negate-a-condition", "Takes a condition for its opposite.", negate),
    Operator("drop-a-condition", "Does in any case what depends on a condition.", whatever),
    Operator("never", "Does in no case what depends on a condition.", never),
    Operator("and-or", "Takes one condition of two for both, or both for one.", and_or),
    Operator("drop-the-else", "Does nothing where it should do something else.", drop_else),
    Operator("swap-steps", "Does two steps in the wrong order.", swap_steps),
    Operator("stop-at-the-first", "Stops after the first.", stop_at_first),
    Operator("do-not-stop", "Goes on where it should stop.", go_on_after_the_find),
    Operator("give-up", "Does not wait, or only three times.", give_up),
    Operator("stop-half-way", "Ends before all is done.", stop_half_way),
    Operator("into-the-loop", "Does in every turn of a loop what should come after it.", into_the_loop),
    Operator(
        "out-of-the-block", "Does after a loop or a condition what should be done in it.", out_of_the_block
    ),
)
