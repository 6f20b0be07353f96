"""Before a robot moves: which rooms it knows, where it is, and what it lacks of what a program asks for."""

from __future__ import annotations

from codebotler.checking.problems import no_room
from codebotler.checking.room_names import named_rooms
from codebotler.core.program import called_skills
from codebotler.core.terminal import note, shortened, visible
from codebotler.missions.live import answered
from codebotler.robots.base import CancelledError, NotReadyError, Result, Robot, RobotLostError
from codebotler.simulator.robot import RobotError
from codebotler.simulator.sampled_robot import RoomMap

MOST_ROOMS = 1_000
"""Of a robot, for a check: each drive is compared with all of them."""

WITH_PATTERNS = frozenset({"simulated", "pyrobosim"})
"""Robots whose rooms have regexes for names, as in the world files they come from."""


def preflight(robot: Robot) -> tuple[RoomMap | None, str]:
    """What a connected robot says of its rooms, in its own words.

    Returns:
        the rooms as a check takes them, None if it says nothing that a check could take; and the one that it
        is in, empty if it says nothing of that.

    Raises:
        NotReadyError: it does not answer, or says what is no answer.
    """
    can = [skill for skill in robot.skills if skill not in robot.missing]

    def told(skill: str, what: str) -> Result:
        if skill not in can:
            return None
        try:
            return answered(robot.skills[skill], robot.perform(skill, ()))
        except RobotError as error:
            note(f"the robot does not say {what}: {visible(str(error))}")
            return None
        except RobotLostError as error:
            raise NotReadyError(f"the robot does not say {what}: {error.sentence}") from None
        except CancelledError:
            raise NotReadyError(f"the robot does not say {what}: somebody stopped it") from None

    rooms = told("get_all_rooms", "which rooms it knows")
    here = told("get_current_location", "where it is")
    place = here if isinstance(here, str) else ""
    if not isinstance(rooms, list) or not rooms:
        return None, place
    if len(rooms) > MOST_ROOMS:
        note(
            f"the robot knows {len(rooms):,} rooms, and a check takes {MOST_ROOMS:,} at most: the check uses "
            "those that the program names instead"
        )
        return None, place
    if place and place not in rooms:
        note(shortened(f'the robot says it is in "{place}", which is none of the rooms that it knows'))
    names = dict.fromkeys([*rooms, place] if place else rooms)
    return RoomMap(tuple(names), place or rooms[0], plain=robot.name not in WITH_PATTERNS), place


def unknown_rooms(program: str, plan: RoomMap) -> list[str]:
    """For each room that a program names and the robot does not know, a sentence.

    Args:
        program: its source.
        plan: the robot's rooms.
    """

    def is_part(name: str) -> bool:
        return any(name.casefold() in room.casefold() for room in plan.rooms)

    named = named_rooms(program)
    return [no_room(name, plan) for name in named if plan.room(name) is None and not is_part(name)]


def beyond(program: str, robot: Robot) -> list[str]:
    """For each skill that a program calls and a connected robot lacks, a sentence.

    Args:
        program: its source.
        robot: connected.
    """
    called = called_skills(program, robot.skills)
    return [
        f"line {line}: the robot cannot {skill}: {visible(robot.missing[skill])}"
        for skill, line in sorted(called.items(), key=lambda item: item[1])
        if skill in robot.missing
    ]
