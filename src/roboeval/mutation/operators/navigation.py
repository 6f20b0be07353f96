"""Mutation operators that change where the robot drives and what it looks for."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from roboeval.mutation.operator import Context, Edits, next_names, only_if, prompt_matches
from roboeval.mutation.program_tree import (
    ProgramTree,
    argument,
    expression,
    rewrite,
    skill_of,
    statement,
    text_of,
)

COMING_BACK = prompt_matches(
    r"\b(come|came|coming|are) back\b|\bback (here|with me|to me)\b|\breturn (here|to me|to where)\b"
)
STAYING_OUT = prompt_matches(
    r"\b(no other room|nowhere else|no place besides|(other|remaining) rooms|just the labs|straight|directly)"
)


# --- drives


def _sequences(program: ProgramTree) -> Iterator[ast.expr]:
    """Yield the sequences that loops and comprehensions iterate over, and all lists of rooms."""
    found = [node.iter for node in program.nodes if isinstance(node, ast.For | ast.comprehension)]
    yield from found
    yield from (call for call in program.calls("get_all_rooms") if call not in found)


def skip_the_first(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes the first item of a sequence, such as a room, a person or a report."""
    return ({items: expression("list(items)[1:]", items=items)} for items in _sequences(program))


def skip_the_last(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes the last item of a sequence, such as the last room."""
    return ({items: expression("list(items)[:-1]", items=items)} for items in _sequences(program))


def _return_places(program: ProgramTree) -> dict[ast.Call, ast.expr]:
    """Find the calls that drive to a location that was stored earlier, and map each to its argument."""
    kept = set()
    for node in program.nodes:
        match node:
            case ast.Assign([ast.Name(name)], value) if skill_of(value) == "get_current_location":
                kept.add(name)
    places = ((call, argument(call, 0)) for call in program.calls("go_to"))
    return {call: place for call, place in places if isinstance(place, ast.Name) and place.id in kept}


@only_if(COMING_BACK)
def drop_the_return(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes the drive back to the starting point."""
    returns = _return_places(program)
    return ({step: []} for step, call in program.steps("go_to") if call in returns)


def drop_a_drive(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a drive, but not the drive back to the starting point."""
    returns = _return_places(program)
    return ({step: []} for step, call in program.steps("go_to") if call not in returns)


def wrong_room(program: ProgramTree, context: Context) -> Edits:
    """Yield each edit that replaces the name of a room with the name of another room."""
    for node in program.nodes:
        room = (text_of(node) or "").lower().removeprefix("the ")
        if room in {one.lower() for one in context.rooms}:
            yield from ({node: ast.Constant(other)} for other in next_names(context.rooms, room))


@only_if(COMING_BACK)
def return_elsewhere(program: ProgramTree, context: Context) -> Edits:
    """Yield each edit that makes the robot return to a room other than the starting point."""
    rooms = dict.fromkeys((*context.rooms[:1], *context.idle_rooms(program)[-1:]))
    return ({place: ast.Constant(room)} for place in _return_places(program).values() for room in rooms)


@only_if(COMING_BACK)
def return_to_here(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes the robot drive to where it already is instead of to the starting point."""
    return ({place: expression("get_current_location()")} for place in _return_places(program).values())


def drive_by_words(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes the robot announce a drive instead of driving."""
    for step, call in program.steps("go_to"):
        if (place := argument(call, 0)) is not None:
            yield {step: statement('say(f"I am going to {place}")', place=place)}


def one_drive_for_all(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that passes all rooms to a single drive, which reaches only one of them."""
    for loop in program.loops:
        if not isinstance(loop, ast.For) or not isinstance(loop.target, ast.Name):
            continue
        for step, call in program.steps("go_to"):
            match argument(call, 0):
                case ast.Name(name) if name == loop.target.id and step in set(ast.walk(loop)):
                    together = statement('go_to(" or ".join(rooms))', rooms=loop.iter)
                    yield {loop: [together, rewrite(loop, {step: []})]}


@only_if(STAYING_OUT)
def detour(program: ProgramTree, context: Context) -> Edits:
    """Yield each edit that adds a drive to a room that the program does not mention."""
    last = [step for step, _ in program.steps("go_to")][-1:]
    for room in context.idle_rooms(program)[:1]:
        yield from ({step: [statement(f"go_to({room!r})"), step]} for step in last)


def plural_rooms(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces a searched word with its plural, such as `lab` with `labs`."""
    for node in program.nodes:
        match node:
            case ast.Compare(ast.Constant(str(word)) as left, [ast.In() | ast.NotIn()], [_]):
                if word[-1:].isalpha():
                    yield {left: ast.Constant(word + "s")}
            case ast.Call(ast.Attribute(_, "startswith" | "endswith"), [ast.Constant(str(word)) as only]):
                yield {only: ast.Constant(word + "s")}


# --- looks


def _looks(program: ProgramTree) -> list[ast.Call]:
    """Find the calls of `is_in_room` whose result is used, except operands of `or`."""
    choices = (node for node in program.nodes if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.Or))
    idle = {value for choice in choices for value in choice.values}
    idle |= {call for _, call in program.steps("is_in_room")}
    return [call for call in program.calls("is_in_room") if call not in idle]


def _looks_in_loops(program: ProgramTree) -> Iterator[tuple[ast.For | ast.While, ast.Call]]:
    looks = set(_looks(program))
    for loop in program.loops:
        for node in ast.walk(loop):
            if isinstance(node, ast.Call) and node in looks:
                yield loop, node


def drop_the_look(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces an `is_in_room` call with true, as if what it looks for were there."""
    return ({call: expression("True")} for call in _looks(program))


def see_nothing(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces an `is_in_room` call with false, as if what it looks for were absent."""
    return ({call: expression("False")} for call in _looks(program))


def look_once(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that moves a look out of a loop, so that the robot looks only once, before the loop."""
    for loop, look in _looks_in_loops(program):
        if text_of(argument(look, 0)) is not None:
            first = statement("seen_once = look", look=look)
            yield {loop: [first, rewrite(loop, {look: expression("seen_once")})]}


def look_at_first_only(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes a loop look only in its first two iterations, and then assume success."""
    for loop, look in _looks_in_loops(program):
        after = rewrite(loop, {look: expression("turns > 2 or look", look=look)})
        after.body.insert(0, statement("turns += 1"))
        yield {loop: [statement("turns = 0"), after]}


def look_afterwards(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes the robot act before it looks, so that what it sees makes no difference."""
    looks = set(_looks(program))
    for node in program.nodes:
        match node:
            case ast.If(ast.Call() as look, body, rest) | ast.If(
                ast.UnaryOp(ast.Not(), ast.Call() as look), body, rest
            ) if look in looks:
                yield {node: [ast.If(expression("True"), [*body, ast.Expr(look)], rest)]}


def look_for_another(program: ProgramTree, context: Context) -> Edits:
    """Yield each edit that replaces the person or thing that the robot looks for with another one."""
    for look in _looks(program):
        wanted = argument(look, 0)
        if (name := text_of(wanted)) is None:
            continue
        for known in (context.things, context.people):
            if name.lower() in {one.lower() for one in known}:
                yield from ({wanted: ast.Constant(other)} for other in next_names(known, name, most=1))
        yield {wanted: ast.Constant("unicorn")}


def look_at_the_name(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that searches a room's name for a person or thing instead of looking into the room."""
    for loop, look in _looks_in_loops(program):
        wanted = argument(look, 0)
        if isinstance(loop, ast.For) and isinstance(loop.target, ast.Name) and wanted is not None:
            yield {look: expression("wanted in room", wanted=wanted, room=loop.target)}
