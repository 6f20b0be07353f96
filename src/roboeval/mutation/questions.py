"""Operators about what the robot asks, whom, and what it makes of the answer."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from roboeval.mutation.operator import Operator, Setting, others
from roboeval.mutation.rewriting import Edit, Source, argument, literal, text_of


def _answers(call: ast.Call) -> Iterator[ast.expr]:
    """The first and the last option of a question, as expressions."""
    options = argument(call, 2)
    if isinstance(options, ast.List) and options.elts:
        yield from dict.fromkeys((options.elts[0], options.elts[-1]))
    elif options is not None and not isinstance(options, ast.List):
        for index in (literal(0), ast.UnaryOp(ast.USub(), literal(1))):
            yield ast.Subscript(ast.Call(ast.Name("list", ast.Load()), [options], []), index, ast.Load())


def _used(source: Source) -> Iterator[ast.Call]:
    """The questions whose answer is used."""
    unused = {call for _, call in source.steps("ask")}
    yield from (call for call in source.calls("ask") if call not in unused)


def ignore_answer(source: Source, _: Setting) -> Iterator[Edit]:
    """Ask, and go on as if one certain option had been chosen."""
    for call in _used(source):
        for answer in _answers(call):
            pair = ast.Tuple([call, answer], ast.Load())
            yield {call: ast.Subscript(pair, literal(1), ast.Load())}


def assume_answer(source: Source, _: Setting) -> Iterator[Edit]:
    """Do not ask, and go on as if one certain option had been chosen."""
    for call in _used(source):
        yield from ({call: answer} for answer in _answers(call))


def ask_by_saying(source: Source, _: Setting) -> Iterator[Edit]:
    """Say the question, and wait for no answer."""
    for call in source.calls("ask"):
        question = argument(call, 1)
        if question is None:
            continue
        said = ast.Call(ast.Name("say", ast.Load()), [question], [])
        for answer in list(_answers(call))[:1]:
            yield {call: ast.Subscript(ast.Tuple([said, answer], ast.Load()), literal(1), ast.Load())}


def drop_question(source: Source, _: Setting) -> Iterator[Edit]:
    """Leave out a question whose answer nobody uses."""
    for statement, _call in source.steps("ask"):
        yield {statement: []}


def forget_option(source: Source, _: Setting) -> Iterator[Edit]:
    """Do not offer one of the options."""
    for call in source.calls("ask"):
        options = argument(call, 2)
        if isinstance(options, ast.List) and len(options.elts) > 1:
            for left in dict.fromkeys((options.elts[0], options.elts[-1])):
                yield {options: ast.List([one for one in options.elts if one is not left], ast.Load())}


VAGUE = "What do you think?"
SILENT = re.compile(r"\b(yes|no|ok|done|\d+|zero|one|two|three|four)\b", re.IGNORECASE)


def vague_question(source: Source, _: Setting) -> Iterator[Edit]:
    """Ask without saying what about, where the options do not tell either."""
    for call in source.calls("ask"):
        question, options = argument(call, 1), argument(call, 2)
        offered = [text for node in ast.walk(options) if (text := text_of(node))] if options else []
        if question is not None and offered and all(SILENT.match(text) for text in offered):
            yield {question: literal(VAGUE)}


def wrong_person(source: Source, setting: Setting) -> Iterator[Edit]:
    """Take one person for another, in one place of the program."""
    for node in source.nodes:
        text = text_of(node)
        for name in setting.people if text is not None else ():
            found = re.search(rf"\b{re.escape(name)}\b", text or "", re.IGNORECASE)
            if found is None:
                continue
            for other in others(setting.people, name, most=1):
                put = other.capitalize() if found[0][:1].isupper() else other
                yield {node: literal((text or "")[: found.start()] + put + (text or "")[found.end() :])}


def other_spelling(source: Source, _: Setting) -> Iterator[Edit]:
    """Compare with another spelling than the one that was offered."""
    for node in source.nodes:
        match node:
            case ast.Compare(_, [ast.Eq() | ast.NotEq()], [ast.Constant(str(text)) as right]) if text:
                yield {right: literal(text.lower() if text[0].isupper() else text.capitalize())}


def wrong_option(source: Source, _: Setting) -> Iterator[Edit]:
    """Compare with an option that nobody offers."""
    for node in source.nodes:
        match node:
            case ast.Compare(_, [ast.Eq() | ast.NotEq()], [ast.Constant(str(text)) as right]) if text:
                yield {right: literal("maybe")}


OPERATORS = (
    Operator("ignore-the-answer", "Asks, and goes on as if a certain option were the answer.", ignore_answer),
    Operator(
        "assume-the-answer",
        "Does not ask, and goes on as if a certain option were the answer.",
        assume_answer,
    ),
    Operator("ask-by-saying", "Says the question instead of asking it.", ask_by_saying),
    Operator("drop-a-question", "Leaves out a request that needs no answer.", drop_question),
    Operator("forget-an-option", "Does not offer one of the options.", forget_option),
    Operator("vague-question", "Asks without saying what about.", vague_question),
    Operator("wrong-person", "Takes one person for another.", wrong_person),
    Operator("other-spelling", "Compares the answer with another spelling of it.", other_spelling),
    Operator("unknown-option", "Compares the answer with what nobody offered.", wrong_option),
)
