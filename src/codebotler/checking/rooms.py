"""Determine the rooms for a check: those of the caller, or a guess from the program's source."""

from __future__ import annotations

from collections.abc import Sequence

from codebotler.checking.source.static import read_rooms
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.labels import check_label
from codebotler.simulator.worlds.room_map import RoomMap

DEFAULT_START = "start_loc"  # the name in the paper's prompt
PLACEHOLDER_ROOMS = ("room 1", "room 2")  # for a program that visits all rooms but names none


def room_map_for(
    program: str,
    rooms: Sequence[str] | None = None,
    start: str | None = None,
    *,
    skills: SkillTable = SKILLS,
) -> RoomMap:
    """Return the rooms and the start from the caller, or guess both from the program's source.

    Args:
        program: its source.
        rooms: the names of the rooms, in order; None if they are unknown.
        start: the room where the robot starts; by default `start_loc` if it is a room, else the first room.
        skills: the skills that the program may call.

    Raises:
        UserError: a room's name is not a regular expression, or the start is not a room.
    """
    if rooms is not None:
        for room in rooms:
            try:
                check_label(room)
            except ValueError as error:
                raise UserError(f'the room is "{room}", but {error}') from None
        names = tuple(dict.fromkeys(rooms)) or (start or DEFAULT_START,)
        start = start or (DEFAULT_START if DEFAULT_START in names else names[0])
        if start not in names:
            raise UserError(f'the robot starts in "{start}", but the rooms are: {", ".join(names)}')
        return RoomMap(names, start)
    start = start or DEFAULT_START
    rooms_in_text, lists_all = read_rooms(program, skills)
    named = [room for room in rooms_in_text if room != start]
    if len(named) < len(PLACEHOLDER_ROOMS) and lists_all:
        named += [room for room in PLACEHOLDER_ROOMS if room not in named]
    return RoomMap((*named, start), start, guessed=True)
