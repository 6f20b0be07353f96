"""Mutation operators that change which objects the robot picks up and puts down."""

from __future__ import annotations

import ast
import re

from roboeval.mutation.operator import Context, Edits, next_names, only_if
from roboeval.mutation.program_tree import ProgramTree, argument, statement, text_of

BRINGING_HERE = re.compile(
    r"\b(bring|fetch|carry|take|have|come back)\b[^.:;]*\b(here|to me|with me|with it)\b", re.IGNORECASE
)
PUTTING_DOWN = re.compile(
    r"\b((put|set|lay|leav)(e|ting|ing)? (it|them|that) (down|here|there)|put down)\b", re.IGNORECASE
)


def _is_put_down(context: Context) -> bool:
    """Whether every prompt that asks to bring something here also asks to put it down."""
    return not any(BRINGING_HERE.search(one) and not PUTTING_DOWN.search(one) for one in context.prompts)


@only_if(_is_put_down)
def forget_to_place(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a step that puts down an object."""
    return ({step: []} for step, _call in program.steps("place"))


def forget_to_pick(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a step that picks up an object."""
    return ({step: []} for step, _call in program.steps("pick"))


def bring_nothing(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes all steps that pick up or put down objects."""
    steps = [step for step, _ in program.steps("pick", "place")]
    if len(steps) > 1:
        yield {step: [] for step in steps}


@only_if(_is_put_down)
def place_by_words(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes the robot say that an object is here instead of putting it down."""
    return ({step: statement('say("Here it is.")')} for step, _call in program.steps("place"))


def wrong_thing(program: ProgramTree, context: Context) -> Edits:
    """Yield each edit that replaces an object with a different one."""
    things = [argument(call, 0) for _, call in program.steps("pick", "place")]
    named = next((name for thing in things if (name := text_of(thing))), "")
    if len(context.things) > 1 and things:
        for other in next_names(context.things, named):
            if other.lower() not in named.lower():
                yield {thing: ast.Constant(other) for thing in things if thing is not None}


def place_where_found(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes the robot put down an object immediately after picking it up."""
    places = [step for step, _ in program.steps("place")]
    for step, call in program.steps("pick"):
        thing = argument(call, 0)
        if thing is not None and places:
            yield {step: [step, statement("place(thing)", thing=thing)], **{place: [] for place in places}}
