"""Mutation operators that change the order of steps, conditions and loops."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import pairwise

from codebotler.core.program import TASK_FUNCTION
from roboeval.mutation.operator import Context, Edits
from roboeval.mutation.program_tree import ProgramTree, expression, is_pause, rewrite, skill_of, skills_in

INVERSES: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq,
    ast.In: ast.NotIn,
    ast.Is: ast.IsNot,
    ast.Lt: ast.GtE,
    ast.Gt: ast.LtE,
}
INVERSES |= {other: one for one, other in INVERSES.items()}
ENDS = ast.Break | ast.Continue | ast.Return


def before_the_last(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that moves the last iteration of a loop after the code that follows the loop."""
    for block in program.blocks:
        for at, loop in enumerate(block):
            after = block[at + 1 :]
            if isinstance(loop, ast.For) and any(map(skills_in, after)) and skills_in(loop):
                most, last = (
                    ast.For(loop.target, expression(part, items=loop.iter), loop.body, [])
                    for part in ("list(items)[:-1]", "list(items)[-1:]")
                )
                yield {loop: most, after[-1]: [after[-1], last]}


def _tests(program: ProgramTree) -> Iterator[ast.expr]:
    for node in program.nodes:
        match node:
            case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
                yield test
            case ast.comprehension(ifs=tests):
                yield from tests


def _negated(test: ast.expr) -> ast.expr:
    match test:
        case ast.UnaryOp(ast.Not(), inner):
            return inner
        case ast.Compare(left, [comparison], right):
            return ast.Compare(left, [INVERSES[type(comparison)]()], right)
    return ast.UnaryOp(ast.Not(), test)


def negate_a_condition(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that negates a condition, or one operand of `and` or `or` in a condition."""
    for test in _tests(program):
        yield {test: _negated(test)}
        if isinstance(test, ast.BoolOp):
            yield from ({part: _negated(part)} for part in test.values)


def drop_a_condition(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a condition with true, so that the program always acts."""
    of_loops = {loop.test for loop in program.loops if isinstance(loop, ast.While)}  # loops would never end
    for test in _tests(program):
        if test not in of_loops and not isinstance(test, ast.Constant):
            yield {test: expression("True")}
    for node in program.nodes:
        match node:
            case ast.Call(ast.Name("filter"), [_, items]):
                yield {node: items}


def never(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a condition with false, so that the program never acts."""
    for test in _tests(program):
        if not (isinstance(test, ast.Constant) and test.value is False):
            yield {test: expression("False")}


def and_or(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces `and` with `or`, or the reverse."""
    for node in program.nodes:
        match node:
            case ast.BoolOp(junction, values) if {*map(skill_of, values)} != {"is_in_room"}:
                yield {node: ast.BoolOp(ast.Or() if isinstance(junction, ast.And) else ast.And(), values)}


def drop_the_else(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes the `else` branch of a condition."""
    for node in program.nodes:
        match node:
            case ast.If(test, body, [_, *_] as otherwise) if not all(map(is_pause, otherwise)):
                yield {node: ast.If(test, body, [])}


def swap_steps(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that swaps two consecutive steps."""
    idle = {statement for statement, _ in program.steps("is_in_room")}
    for block in program.blocks:
        for first, second in pairwise(block):
            if idle & {first, second} or isinstance(first, ast.FunctionDef | ast.ClassDef):
                continue
            kinds = skills_in(first), skills_in(second)
            # Instructions do not prescribe the order of two messages or two questions.
            if all(kinds) and (kinds[0] != kinds[1] or "go_to" in kinds[0]):
                yield {first: second, second: first}


def stop_at_the_first(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that ends a loop after the first iteration or match."""
    for loop in program.loops:
        last = loop.body[-1]
        yield {last: [last, ast.Break()]}
        for inner in _inside(loop.body):
            match inner:
                case ast.If(body=[*_, end]) if skills_in(loop) and not isinstance(end, ENDS):
                    yield {end: [end, ast.Break()]}
                case ast.Continue():
                    yield {inner: [ast.Break()]}


def _inside(block: list[ast.stmt]) -> Iterator[ast.stmt]:
    for statement in block:
        yield statement
        if isinstance(statement, ast.If):
            yield from _inside(statement.body)
            yield from _inside(statement.orelse)


def do_not_stop(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a `break`, `continue` or `return`."""
    for node in program.nodes:
        match node:
            case ast.Break() | ast.Continue() | ast.Return(value=None):
                yield {node: []}


def give_up(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that ends a `while` loop, such as one that waits, after one or three iterations."""
    for loop in program.loops:
        if isinstance(loop, ast.While):
            endless = isinstance(loop.test, ast.Constant) and loop.test.value
            guard = [] if endless else [ast.If(_negated(loop.test), [ast.Break()], [])]
            for turns in (1, 3):
                tries, body = expression(f"range({turns})"), [*guard, *loop.body]
                yield {loop: ast.For(ast.Name("_", ast.Store()), tries, body, loop.orelse)}


def stop_half_way(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that ends the program before all steps are done."""
    for node in program.nodes:
        if isinstance(node, ast.FunctionDef) and node.name == TASK_FUNCTION:
            doing = [s for s in node.body[:-1] if skills_in(s) and not isinstance(s, ast.Return)]
            yield from ({statement: [statement, ast.Return()]} for statement in doing)


def into_the_loop(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that moves the code after a loop into its body."""
    for block in program.blocks:
        for loop, after in pairwise(block):
            if isinstance(loop, ast.For | ast.While) and skills_in(after):
                end = loop.body[-1]
                yield {loop: rewrite(loop, {end: [end, after]}), after: []}


def out_of_the_block(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that moves the last step of a loop or a condition out of its body."""
    for node in program.nodes:
        match node:
            case ast.For(body=[_, *_, last]) | ast.While(body=[_, *_, last]) | ast.If(body=[_, *_, last]):
                if skills_in(last) and not isinstance(last, ENDS):
                    yield {node: [rewrite(node, {last: []}), last]}
