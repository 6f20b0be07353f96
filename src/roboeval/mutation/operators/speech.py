"""Mutation operators that change questions, answers and messages."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import pairwise

from roboeval.mutation.operator import Context, Edits, next_names, only_if, prompt_matches
from roboeval.mutation.program_tree import (
    ProgramTree,
    argument,
    expression,
    names_in,
    skill_of,
    skills_in,
    statement,
    text_of,
)

TELLING = prompt_matches(r"\b(tell|say|speak|report|inform|hear|know|announce|suggest)\b")
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
CLAUSES = re.compile(r"(?:^|\band |[^\s.!?;,]).*?(?:[.!?;,] |(?= and )|$)")
POLITE = re.compile(
    r"\s*(hello|hi|dear|good|great|thank|please|sorry|excuse|well|very|i am back|done)\b", re.IGNORECASE
)
SILENT = re.compile(r"\b(yes|no|ok|done|\d+|zero|one|two|three|four)\b", re.IGNORECASE)


# --- questions


def _answers(call: ast.Call) -> Iterator[ast.expr]:
    options = argument(call, 2)
    if isinstance(options, ast.List) and options.elts:
        yield from dict.fromkeys((options.elts[0], options.elts[-1]))
    elif options is not None and not isinstance(options, ast.List):
        yield from (expression(f"list(options)[{index}]", options=options) for index in (0, -1))


def _used(program: ProgramTree) -> Iterator[tuple[ast.Call, ast.expr]]:
    """Yield each question whose answer is used, with its first and last option."""
    unused = {call for _, call in program.steps("ask")}
    for call in program.calls("ask"):
        if call not in unused:
            yield from ((call, answer) for answer in _answers(call))


def ignore_the_answer(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces the answer to a question with a fixed one; the robot still asks."""
    return (
        {call: expression("(question, answer)[1]", question=call, answer=answer)}
        for call, answer in _used(program)
    )


def assume_the_answer(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a question with a fixed answer, so that the robot does not ask."""
    return ({call: answer} for call, answer in _used(program))


def ask_by_saying(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a question with a message and a fixed answer."""
    for call in program.calls("ask"):
        question, answer = argument(call, 1), next(_answers(call), None)
        if question is not None and answer is not None:
            yield {call: expression("(say(question), answer)[1]", question=question, answer=answer)}


def drop_a_question(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a question whose answer is not used."""
    return ({step: []} for step, _call in program.steps("ask"))


def forget_an_option(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes one of the options of a question."""
    for call in program.calls("ask"):
        options = argument(call, 2)
        if isinstance(options, ast.List) and len(options.elts) > 1:
            for left in dict.fromkeys((options.elts[0], options.elts[-1])):
                yield {options: ast.List([one for one in options.elts if one is not left], ast.Load())}


def vague_question(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a question with one that does not name its subject."""
    for call in program.calls("ask"):
        question, options = argument(call, 1), argument(call, 2)
        offered = [text for node in ast.walk(options) if (text := text_of(node))] if options else []
        if question is not None and offered and all(SILENT.match(text) for text in offered):
            yield {question: ast.Constant("What do you think?")}


def wrong_person(program: ProgramTree, context: Context) -> Edits:
    """Yield each edit that replaces the name of a person with another name."""
    for node in program.nodes:
        text = text_of(node) or ""
        for name in context.people:
            found = re.search(rf"\b{re.escape(name)}\b", text, re.IGNORECASE)
            if found is None:
                continue
            for other in next_names(context.people, name, most=1):
                put = other.capitalize() if found[0][:1].isupper() else other
                yield {node: ast.Constant(text[: found.start()] + put + text[found.end() :])}


def _compared(program: ProgramTree) -> Iterator[tuple[ast.expr, str]]:
    for node in program.nodes:
        match node:
            case ast.Compare(_, [ast.Eq() | ast.NotEq()], [ast.Constant(str(text)) as right]) if text:
                yield right, text


def other_spelling(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that changes the capitalization of a string that an answer is compared with."""
    for node, text in _compared(program):
        yield {node: ast.Constant(text.lower() if text[0].isupper() else text.capitalize())}


def unknown_option(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that compares an answer with an option that was not offered."""
    return ({node: ast.Constant("maybe")} for node, _text in _compared(program))


# --- messages


def _messages(program: ProgramTree) -> Iterator[ast.AST]:
    """Find all nodes that may be part of a message. Calls of other skills are excluded."""
    other_calls = (node for node in program.nodes if skill_of(node) not in {None, "say"})
    elsewhere = {inner for call in other_calls for inner in ast.walk(call)}
    return (node for node in program.nodes if node not in elsewhere)


def _reported(program: ProgramTree) -> Iterator[ast.AST]:
    for node in _messages(program):
        match node:
            case ast.FormattedValue(inner) if not isinstance(inner, ast.Constant):
                yield node
            case ast.Call(ast.Name("str"), [_]):
                yield node


def _in_place_of(reported: ast.AST, value: str | float) -> ast.expr:
    if isinstance(reported, ast.FormattedValue):
        return ast.FormattedValue(ast.Constant(value), -1, None)
    return ast.Constant(str(value))


@only_if(TELLING)
def forget_to_say(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a message that the robot says."""
    return ({step: []} for step, _call in program.steps("say"))


@only_if(TELLING)
def say_nothing_of_it(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a message with one without information."""
    return ({step: statement('say("Done.")')} for step, _call in program.steps("say"))


@only_if(TELLING)
def constant_for_a_value(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a value in a message with a constant, such as `{count}` with 12."""
    return ({node: _in_place_of(node, value)} for node in _reported(program) for value in (1, 2, 12))


@only_if(TELLING)
def hedge(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a value in a message with several numbers, one of which may be right."""
    return ({node: _in_place_of(node, "0, 1, 2, 3 or 4")} for node in _reported(program))


@only_if(TELLING)
def leave_out_a_clause(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a clause from a message."""
    asked = {inner for call in program.calls("ask") for inner in ast.walk(call)}
    for node in _messages(program):
        clauses = CLAUSES.findall(text_of(node) or "")
        for left in clauses if len(clauses) > 1 and node not in asked else ():
            if len(left.split()) > 1 and not POLITE.match(left):
                yield {node: ast.Constant("".join(one for one in clauses if one is not left).strip(" ,;"))}


@only_if(TELLING)
def leave_out_a_value(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a value from a message."""
    for node in _messages(program):
        match node:
            case ast.JoinedStr(parts) if len(parts) > 1:
                for part in parts:
                    if isinstance(part, ast.FormattedValue):
                        yield {node: ast.JoinedStr([one for one in parts if one is not part])}
            case ast.BinOp(left, ast.Add(), right):
                for operand, rest in ((left, right), (right, left)):
                    if isinstance(operand, ast.Name | ast.Call | ast.Subscript | ast.Attribute):
                        yield {node: rest}


@only_if(TELLING)
def swap_values(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that swaps two values in a message."""
    targets = (node.target for node in program.nodes if isinstance(node, ast.For | ast.comprehension))
    gone_through = {name for target in targets for name in names_in(target, ast.Store)}  # loop variables
    for a, b in _neighbours(program):
        if not {_variable(a), _variable(b)} & gone_through:
            yield {a: b, b: a}


def _variable(value: ast.expr) -> str | None:
    match value:
        case ast.Name(name) | ast.FormattedValue(ast.Name(name)):
            return name
    return None


def _neighbours(program: ProgramTree) -> Iterator[tuple[ast.expr, ast.expr]]:
    for node in _messages(program):
        match node:
            case ast.JoinedStr(parts):
                yield from pairwise(part for part in parts if isinstance(part, ast.FormattedValue))
            case ast.BinOp():
                added = (one for one in _added(node) if not isinstance(one, ast.Constant | ast.JoinedStr))
                yield from pairwise(added)


def _added(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.BinOp(left, ast.Add(), right):
            yield from _added(left)
            yield from _added(right)
        case _:
            yield node


def say_the_opposite(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that reverses the meaning of a message."""
    roots = (*program.calls("ask"), *(node for node in program.nodes if isinstance(node, ast.Compare)))
    no_message = {inner for root in roots for inner in ast.walk(root)}
    for node in _messages(program):
        text = text_of(node)
        if text is None or " " not in text.strip() or node in no_message:
            continue
        other = TURNED.sub(_opposite, text)
        other = CLAIM.sub(r"\1 not", text, count=1) if other == text else other
        if other != text:
            yield {node: ast.Constant(other)}


def _opposite(found: re.Match[str]) -> str:
    put = [*OPPOSITES.values()][(found.lastindex or 1) - 1]
    return put.capitalize() if found[0][:1].isupper() else put


def say_before_asking(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that moves a message before the question that it should follow."""
    for block in program.blocks:
        for at, saying in enumerate(block):
            if "say" not in skills_in(saying) or "ask" in skills_in(saying):
                continue
            for before in reversed(block[:at]):
                if names_in(before, ast.Store) & names_in(saying, ast.Load):
                    break
                if "ask" in skills_in(before):
                    yield {before: [saying, before], saying: []}
                    break
