"""Derive the contract of a program from its text, and from its runs in all worlds that it can tell apart."""

from __future__ import annotations

from collections.abc import Sequence

from codebotler.checking.exploration import Exploration
from codebotler.checking.source.written_arguments import WrittenArguments
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.text.text_template import ANY_TEXT, TextTemplate
from codebotler.simulator.guard.contract import (
    TELLING_SKILLS,
    Contract,
    RequestedCall,
    SkillBound,
    Templates,
    has_place,
    is_goal,
)
from codebotler.simulator.guard.rule_guard import name_of
from codebotler.simulator.worlds.room_map import RoomMap

MAX_TEXTS, MAX_CHARACTERS = 1_000, 50_000  # of an argument; it may have any text if it has more


def derive_contract(
    found: Exploration, written: WrittenArguments, room_map: RoomMap, skills: SkillTable
) -> Contract:
    """Return a contract that allows everything that a program may do.

    An argument may have the texts that are written in the program, such as "hall" in `go_to("hall")`, and
    those of all explored calls. If the program computes other texts, and not all of its worlds were
    explored, the argument may have any text.

    Args:
        found: what the program did in the explored worlds.
        written: the texts that it passes to skills, as far as its source shows them.
        room_map: the rooms.
        skills: the skills that the program may call.
    """
    bounds = {}
    for row in skills.without(TELLING_SKILLS).rows:
        calls = [call for call in found.calls if call.skill == row.name]
        bound = _bound(row, calls, found, written, room_map)
        is_named = row.name in written.skills and all(texts != () for _, texts in bound.texts)
        if calls or is_named:
            bounds[row.name] = bound
    return Contract(bounds)


def _bound(
    row: Skill,
    calls: Sequence[RequestedCall],
    found: Exploration,
    written: WrittenArguments,
    room_map: RoomMap,
) -> SkillBound:
    knows_all = found.is_complete and found.is_steady and not written.reads_clock
    texts: list[tuple[str, Templates]] = []
    for number, parameter in enumerate(row.parameters):
        given = written.skills.get(row.name, {}).get(parameter.name, ())
        if ANY_TEXT in given and not knows_all:
            texts.append((parameter.name, (ANY_TEXT,)))
            continue
        allowed = tuple(one for one in given if one != ANY_TEXT)
        if is_goal(row, parameter.name):
            allowed = tuple(dict.fromkeys(room for one in allowed for room in _rooms(one, room_map)))
        met = sorted({text for call in calls for text in call.texts[number]})
        met = [text for text in met if not any(one.matches(text) for one in allowed)]
        texts.append((parameter.name, _limited((*allowed, *(TextTemplate((text,)) for text in met)))))
    places = sorted({call.place for call in calls}) if has_place(row) and knows_all else []
    most_calls = found.most_calls.get(row.name) if knows_all else None
    return SkillBound(tuple(texts), tuple(places) or None, most_calls)


def _limited(templates: Templates) -> Templates:
    """Return texts, or any text if these are more than a person would read."""
    is_short = sum(len(part) for one in templates for part in one.parts) <= MAX_CHARACTERS
    return templates if is_short and len(templates) <= MAX_TEXTS else (ANY_TEXT,)


def _rooms(template: TextTemplate, room_map: RoomMap) -> list[TextTemplate]:
    """Return the rooms that a goal may mean, or the goal itself if it means none."""
    if len(template.parts) == 1:
        goals = room_map.possible_rooms(template.parts[0])
    else:
        goals = [room for room in room_map.goals if template.matches(room)]
    names = [name_of(room_map.full_name(room), template.parts[0]) for room in goals]
    return [TextTemplate((name,)) for name in names] or [template]
