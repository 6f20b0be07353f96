"""Operators about what the robot picks up and puts down."""

from __future__ import annotations

from collections.abc import Iterator

from roboeval.mutation.operator import Operator, Setting, others, where_put_down
from roboeval.mutation.rewriting import Edit, Source, argument, literal, step, text_of


def forget_to_place(source: Source, _: Setting) -> Iterator[Edit]:
    """Keep it in the gripper."""
    for statement, _call in source.steps("place"):
        yield {statement: []}


def forget_to_pick(source: Source, _: Setting) -> Iterator[Edit]:
    """Go without it."""
    for statement, _call in source.steps("pick"):
        yield {statement: []}


def neither(source: Source, _: Setting) -> Iterator[Edit]:
    """Neither pick it up nor put it down."""
    steps = [statement for statement, _ in source.steps("pick", "place")]
    if len(steps) > 1:
        yield {statement: [] for statement in steps}


def place_by_words(source: Source, _: Setting) -> Iterator[Edit]:
    """Say that it is there, and keep it."""
    for statement, _call in source.steps("place"):
        yield {statement: [step("say", literal("Here it is."))]}


def wrong_thing(source: Source, setting: Setting) -> Iterator[Edit]:
    """Pick up and put down another thing, always the same one."""
    calls = [call for _, call in source.steps("pick", "place")]
    things = [argument(call, 0) for call in calls]
    named = next((name for thing in things if (name := text_of(thing))), "")
    if len(setting.things) > 1 and things:
        for other in others(setting.things, named or ""):
            if other.lower() not in (named or "").lower():
                yield {thing: literal(other) for thing in things if thing is not None}


def place_where_found(source: Source, _: Setting) -> Iterator[Edit]:
    """Put it down at once, where it was."""
    places = [statement for statement, _ in source.steps("place")]
    for statement, call in source.steps("pick"):
        thing = argument(call, 0)
        if thing is not None and places:
            yield {statement: [statement, step("place", thing)], **{place: [] for place in places}}


OPERATORS = (
    Operator("forget-to-place", "Does not put down what it brings.", where_put_down(forget_to_place)),
    Operator("forget-to-pick", "Does not pick up what it should bring.", forget_to_pick),
    Operator("bring-nothing", "Drives about without picking up or putting down anything.", neither),
    Operator(
        "place-by-words", "Says that it brings something, and keeps it.", where_put_down(place_by_words)
    ),
    Operator("wrong-thing", "Brings another thing.", wrong_thing),
    Operator("place-where-found", "Puts a thing down where it found it.", place_where_found),
)
