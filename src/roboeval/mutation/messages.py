"""Operators about what the robot says, and when."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import pairwise

from roboeval.mutation.operator import TELLING, Operator, Setting, where
from roboeval.mutation.rewriting import (
    Edit,
    Source,
    literal,
    names_in,
    names_set_in,
    skill_of,
    skills_in,
    text_of,
)

OPPOSITES = {
    "yes": "no",
    "no one": "everyone",
    "no(?= \\w)": "some",
    "no": "yes",
    "nobody": "everybody",
    "none": "all",
    "nothing": "everything",
    "not": "surely",
    "don't": "do",
    "doesn't": "does",
    "without": "with",
    "lacks|lacking": "has",
    "missing": "there",
    "declined": "accepted",
    "declines": "accepts",
    "accepted": "declined",
    "accepts": "declines",
    "warmer": "colder",
    "colder": "warmer",
}
TURNED = re.compile("|".join(rf"\b({word})\b" for word in OPPOSITES), re.IGNORECASE)
CLAIM = re.compile(r"\b(is|are|will|would)\b")
EMPTY = "Done."
HEDGE = "0, 1, 2, 3 or 4"
CLAUSES = re.compile(r"(?:^|\band |[^\s.!?;,]).*?(?:[.!?;,] |(?= and )|$)")
POLITE = re.compile(
    r"\s*(hello|hi|dear|good|great|thank|please|sorry|excuse|well|very|i am back|done)\b", re.IGNORECASE
)


def _messages(source: Source) -> Iterator[ast.AST]:
    """All that stands in what may be said: everything but the arguments of the other skills."""
    elsewhere = {
        inner
        for node in source.nodes
        if (skill := skill_of(node)) is not None and skill != "say"
        for inner in ast.walk(node)
    }
    yield from (node for node in source.nodes if node not in elsewhere)


def forget_to_say(source: Source, _: Setting) -> Iterator[Edit]:
    """Keep silent."""
    for statement, _call in source.steps("say"):
        yield {statement: []}


def say_nothing_of_it(source: Source, _: Setting) -> Iterator[Edit]:
    """Say something that tells nothing."""
    for statement, call in source.steps("say"):
        yield {statement: [ast.Expr(ast.Call(call.func, [literal(EMPTY)], []))]}


def constant_for_value(source: Source, _: Setting) -> Iterator[Edit]:
    """Report a constant, not what was counted or heard."""
    for node in _messages(source):
        for value in (1, 2, 12):
            match node:
                case ast.FormattedValue(inner) if not isinstance(inner, ast.Constant):
                    yield {node: ast.FormattedValue(literal(value), -1, None)}
                case ast.Call(ast.Name("str"), [_]):
                    yield {node: literal(str(value))}


def leave_out_value(source: Source, _: Setting) -> Iterator[Edit]:
    """Leave a value out of a message."""
    for node in _messages(source):
        match node:
            case ast.JoinedStr(parts) if len(parts) > 1:
                for part in parts:
                    if isinstance(part, ast.FormattedValue):
                        yield {node: ast.JoinedStr([one for one in parts if one is not part])}
            case ast.BinOp(left, ast.Add(), right):
                for operand, rest in ((left, right), (right, left)):
                    if isinstance(operand, ast.Name | ast.Call | ast.Subscript | ast.Attribute):
                        yield {node: rest}


def swap_values(source: Source, _: Setting) -> Iterator[Edit]:
    """Mix up two values of a message; what a loop goes through has no place of its own."""
    gone_through = {
        name
        for node in source.nodes
        if isinstance(node, ast.For | ast.comprehension)
        for name in names_set_in(node.target)
    }
    for a, b in _neighbours(source):
        if not {_variable(a), _variable(b)} & gone_through:
            yield {a: b, b: a}


def _variable(value: ast.expr) -> str | None:
    """The variable that a value of a message is."""
    match value:
        case ast.Name(name) | ast.FormattedValue(ast.Name(name)):
            return name
    return None


def _neighbours(source: Source) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Values that follow one another in a message."""
    for node in _messages(source):
        match node:
            case ast.JoinedStr(parts):
                yield from pairwise(part for part in parts if isinstance(part, ast.FormattedValue))
            case ast.BinOp():
                yield from pairwise(
                    part for part in _added(node) if not isinstance(part, ast.Constant | ast.JoinedStr)
                )


def _added(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.BinOp(left, ast.Add(), right):
            yield from _added(left)
            yield from _added(right)
        case _:
            yield node


def say_the_opposite(source: Source, _: Setting) -> Iterator[Edit]:
    """Turn a message into its opposite."""
    options = {inner for call in source.calls("ask") for inner in ast.walk(call)}
    compared = {inner for node in source.nodes if isinstance(node, ast.Compare) for inner in ast.walk(node)}
    for node in _messages(source):
        text = text_of(node)
        if text is None or " " not in text.strip() or node in options | compared:
            continue
        other = TURNED.sub(_opposite, text)
        other = CLAIM.sub(r"\1 not", text, count=1) if other == text else other
        if other != text:
            yield {node: literal(other)}


def _opposite(found: re.Match[str]) -> str:
    put = [*OPPOSITES.values()][(found.lastindex or 1) - 1]
    return put.capitalize() if found[0][:1].isupper() else put


def hedge(source: Source, _: Setting) -> Iterator[Edit]:
    """Report all numbers, so that the right one is among them."""
    for node in _messages(source):
        match node:
            case ast.FormattedValue(inner) if not isinstance(inner, ast.Constant):
                yield {node: ast.FormattedValue(literal(HEDGE), -1, None)}
            case ast.Call(ast.Name("str"), [_]):
                yield {node: literal(HEDGE)}


def leave_out_clause(source: Source, _: Setting) -> Iterator[Edit]:
    """Say only a part of what is to be said; politeness is no part of it."""
    asked = {inner for call in source.calls("ask") for inner in ast.walk(call)}
    for node in _messages(source):
        clauses = CLAUSES.findall(text_of(node) or "")
        for left in clauses if len(clauses) > 1 and node not in asked else ():
            if len(left.split()) > 1 and not POLITE.match(left):
                yield {node: literal("".join(one for one in clauses if one is not left).strip(" ,;"))}


def say_before_asking(source: Source, _: Setting) -> Iterator[Edit]:
    """Say first what should be said after a question."""
    for block in source.blocks:
        for at, statement in enumerate(block):
            if "say" not in skills_in(statement) or "ask" in skills_in(statement):
                continue
            for before in range(at - 1, -1, -1):
                if names_set_in(block[before]) & names_in(statement):
                    break
                if "ask" in skills_in(block[before]):
                    yield {block[before]: [statement, block[before]], statement: []}
                    break


OPERATORS = (
    Operator("forget-to-say", "Does not say something.", where(TELLING, forget_to_say)),
    Operator("say-nothing-of-it", "Says something that tells nothing.", where(TELLING, say_nothing_of_it)),
    Operator(
        "constant-for-a-value",
        "Reports a constant instead of what it counted or heard.",
        where(TELLING, constant_for_value),
    ),
    Operator("hedge", "Reports all numbers, of which one is right.", where(TELLING, hedge)),
    Operator("leave-out-a-clause", "Says only a part of a sentence.", where(TELLING, leave_out_clause)),
    Operator("leave-out-a-value", "Leaves a value out of a message.", where(TELLING, leave_out_value)),
    Operator("swap-values", "Mixes up two values in a message.", where(TELLING, swap_values)),
    Operator("say-the-opposite", "Says the opposite.", say_the_opposite),
    Operator("say-before-asking", "Says before a question what should come after it.", say_before_asking),
)
