"""Operators about where the robot drives."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from roboeval.mutation.operator import COMING_BACK, STAYING_OUT, Operator, Setting, others, where
from roboeval.mutation.rewriting import Edit, Source, argument, literal, rewritten, sliced, step, text_of


def _sequences(source: Source) -> Iterator[ast.expr]:
    """What is gone through: by a loop, in a comprehension, or wherever all rooms are listed."""
    found = [node.iter for node in source.nodes if isinstance(node, ast.For | ast.comprehension)]
    yield from found
    yield from (call for call in source.calls("get_all_rooms") if call not in found)


def skip_first(source: Source, _: Setting) -> Iterator[Edit]:
    """Leave the first out."""
    for items in _sequences(source):
        yield {items: sliced(items, 1, None)}


def skip_last(source: Source, _: Setting) -> Iterator[Edit]:
    """Leave the last out."""
    for items in _sequences(source):
        yield {items: sliced(items, None, -1)}


def _is_return(call: ast.Call, source: Source) -> bool:
    match argument(call, 0):
        case ast.Name(name):
            return name in source.starts
    return False


def drop_return(source: Source, _: Setting) -> Iterator[Edit]:
    """Stay where the last step was."""
    for statement, call in source.steps("go_to"):
        if _is_return(call, source):
            yield {statement: []}


def drop_drive(source: Source, _: Setting) -> Iterator[Edit]:
    """Leave out a drive that is no return."""
    for statement, call in source.steps("go_to"):
        if not _is_return(call, source):
            yield {statement: []}


def wrong_room(source: Source, setting: Setting) -> Iterator[Edit]:
    """Name another room."""
    for node in source.nodes:
        name = text_of(node)
        room = name and name.lower().removeprefix("the ")
        if room in {one.lower() for one in setting.rooms}:
            yield from ({node: literal(other)} for other in others(setting.rooms, room or ""))


def return_elsewhere(source: Source, setting: Setting) -> Iterator[Edit]:
    """Come back to another room."""
    rooms = dict.fromkeys((*setting.rooms[:1], *setting.idle_rooms(source)[-1:]))
    for call in source.calls("go_to"):
        place = argument(call, 0)
        if place is not None and _is_return(call, source):
            yield from ({place: literal(room)} for room in rooms)


def stay_and_call(source: Source, _: Setting) -> Iterator[Edit]:
    """Take the place to come back to only when it is time to come back."""
    for call in source.calls("go_to"):
        place = argument(call, 0)
        if place is not None and _is_return(call, source):
            yield {place: ast.Call(ast.Name("get_current_location", ast.Load()), [], [])}


def drive_by_words(source: Source, _: Setting) -> Iterator[Edit]:
    """Say that one goes there."""
    for statement, call in source.steps("go_to"):
        place = argument(call, 0)
        if place is not None:
            told = ast.JoinedStr([literal("I am going to "), ast.FormattedValue(place, -1, None)])
            yield {statement: [step("say", told)]}


def one_drive(source: Source, _: Setting) -> Iterator[Edit]:
    """Name all rooms in one drive."""
    for loop in source.loops:
        if not isinstance(loop, ast.For) or not isinstance(loop.target, ast.Name):
            continue
        for statement, call in source.steps("go_to"):
            match argument(call, 0):
                case ast.Name(name) if name == loop.target.id and statement in set(ast.walk(loop)):
                    together = ast.Call(ast.Attribute(literal(" or "), "join", ast.Load()), [loop.iter], [])
                    rest = rewritten(loop, {statement: []})
                    assert isinstance(rest, ast.stmt)
                    yield {loop: [step("go_to", together), rest]}


def detour(source: Source, setting: Setting) -> Iterator[Edit]:
    """Pass through a room that nobody named, on the last drive."""
    drives = [statement for statement, _ in source.steps("go_to")]
    for room in setting.idle_rooms(source)[:1]:
        for statement in drives[-1:]:
            yield {statement: [step("go_to", literal(room)), statement]}


def plural_rooms(source: Source, _: Setting) -> Iterator[Edit]:
    """Look for a plural in the names of rooms, where no room has one."""
    for node in source.nodes:
        match node:
            case ast.Compare(ast.Constant(str(word)) as left, [ast.In() | ast.NotIn()], [_]) if word[
                -1:
            ].isalpha():
                yield {left: literal(word + "s")}
            case ast.Call(ast.Attribute(_, "startswith" | "endswith"), [ast.Constant(str(word)) as only]):
                yield {only: literal(word + "s")}


OPERATORS = (
    Operator("skip-the-first", "Goes through all but the first: room, person or report.", skip_first),
    Operator("skip-the-last", "Goes through all but the last.", skip_last),
    Operator("drop-the-return", "Does not come back.", where(COMING_BACK, drop_return)),
    Operator("drop-a-drive", "Leaves out a drive.", drop_drive),
    Operator("wrong-room", "Names another room than the instruction.", wrong_room),
    Operator(
        "return-elsewhere",
        "Comes back to another place than it started from.",
        where(COMING_BACK, return_elsewhere),
    ),
    Operator(
        "return-to-here",
        "Takes the place where it is for the place to come back to.",
        where(COMING_BACK, stay_and_call),
    ),
    Operator("drive-by-words", "Says that it goes somewhere, and stays.", drive_by_words),
    Operator("one-drive-for-all", "Names all rooms in one drive, which leads to one of them.", one_drive),
    Operator("detour", "Drives through a room that nobody named.", where(STAYING_OUT, detour)),
    Operator("plural-rooms", "Looks for a plural in the names of rooms.", plural_rooms),
)
