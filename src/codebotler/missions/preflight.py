"""Before a robot moves: the rooms it knows, the room it is in, and the skills it lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from codebotler.checking.problems import no_room
from codebotler.checking.room_names import named_rooms
from codebotler.core.errors import RobotError
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import shortened, visible
from codebotler.core.world import Room, World, laid_out
from codebotler.missions.live import answered
from codebotler.models.recorded import UnknownInstructionError, find_closest, open_recorded
from codebotler.robots.base import CancelledError, NotReadyError, Robot, RobotLostError, RobotResult
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.sampled_robot import RoomMap

MOST_ROOMS = 1_000
"""Of a robot, for a check, which compares each drive with all of them."""


def preflight(
    robot: Robot, remark: Callable[[str], None], world: World | None = None
) -> tuple[RoomMap | None, str]:
    """Ask a connected robot for its rooms, which a map may place, and for its own; mistakes are remarks.

    Returns:
        the rooms, None if it does not list them; and the room it is in, empty if it does not say.

    Raises:
        NotReadyError: it does not answer, or not as the skill demands.
    """
    can = [skill for skill in robot.skills if skill not in robot.missing]

    def ask_robot(skill: str, what: str) -> RobotResult:
        if skill not in can:
            return None
        try:
            return answered(robot.skills[skill], robot.perform(skill, ()))
        except RobotError as error:
            remark(f"the robot did not report {what}: {visible(str(error))}")
            return None
        except RobotLostError as error:
            raise NotReadyError(f"the robot did not report {what}: {error.sentence}") from None
        except CancelledError:
            raise NotReadyError(f"the robot did not report {what}, because it was stopped") from None

    rooms = ask_robot("get_all_rooms", "which rooms it knows")
    here = ask_robot("get_current_location", "where it is")
    place = here if isinstance(here, str) else ""
    if not isinstance(rooms, list) or not rooms:
        return None, place
    if place and place not in rooms:
        remark(shortened(f'the robot says it is in "{place}", which is not one of the rooms that it knows'))
    listed = list(map(str, rooms))
    names = dict.fromkeys([*listed, place] if place else listed)
    plan = () if world is None else _plan(robot, world)
    return RoomMap(tuple(names), place or listed[0], plain=not robot.rooms_are_regexes, plan=plan), place


def _plan(robot: Robot, world: World) -> tuple[Room, ...]:
    """The rooms of a map; one without a footprint has that of the grid only where the robot lives in it."""
    rooms = laid_out(world).rooms if robot.rooms_are_regexes else world.rooms
    is_straight = robot.name == "simulated"
    return tuple(Room(r.name, (), (), r.footprint, r.stand_at if is_straight else None) for r in rooms)


def expect_poses(rules: Sequence[Rule], robot: Robot, room_map: RoomMap | None) -> None:
    """Raise NotReadyError if a rule is about where the robot is, and that or a footprint is not known."""
    known = room_map or RoomMap((), "")
    outlined = {room.name for room in known.plan if room.footprint is not None}
    for rule, element in ((one, element) for one in rules for element in one.inside):
        others = (room for room in known.rooms if room not in outlined and element.text.matches(room))
        lacks = next(others, "each room" if room_map is None else "")
        what = f'the footprint of "{lacks}"; add it to the map'
        if not robot.has_pose:
            what = f"the robot's position, which {robot.name} does not report; leave the rule out"
        if lacks or not robot.has_pose:
            raise NotReadyError(f'the rule "{rule.name}" needs {what}')


def rooms_to_check(room_map: RoomMap | None, remark: Callable[[str], None]) -> RoomMap | None:
    """The rooms for a check; None, with a remark, if there are too many."""
    if room_map is None or len(room_map.rooms) <= MOST_ROOMS:
        return room_map
    remark(
        f"the robot lists {len(room_map.rooms):,} rooms, more than the {MOST_ROOMS:,} that a check supports; "
        "it uses only the rooms that the program names"
    )
    return None


def unknown_rooms(program: str, room_map: RoomMap, skills: SkillTable = SKILLS) -> list[str]:
    """A sentence for each room that a program names and the robot does not know."""

    def is_part(name: str) -> bool:
        return any(name.casefold() in room.casefold() for room in room_map.rooms)

    named = named_rooms(parse_leniently(program), skills)
    return [no_room(name, room_map) for name in named if room_map.room(name) is None and not is_part(name)]


def known_instructions(room_map: RoomMap | None) -> dict[str, str]:
    """The instructions that the recorded models know and whose rooms are there, with a program each."""
    replies = open_recorded("recorded").replies
    known = {instruction: solutions[0].program for instruction, solutions in replies.items()}
    if room_map is None:
        return known
    return {
        instruction: program
        for instruction, program in known.items()
        if named_rooms(parse_leniently(program)) and not unknown_rooms(program, room_map)
    }


def with_closest_here(error: UnknownInstructionError, room_map: RoomMap | None) -> UnknownInstructionError:
    """The same error, with the closest instructions whose rooms are there."""
    closest = find_closest(error.instruction, known_instructions(room_map))
    return UnknownInstructionError(error.model, error.instruction, closest)


def missing_skills(program: str, robot: Robot) -> list[str]:
    """A sentence for each skill that a program calls and a connected robot lacks."""
    called = called_skills(parse_leniently(program), robot.skills)
    return [
        f"line {line}: this robot has no `{skill}` skill: {visible(robot.missing[skill])}"
        for skill, line in sorted(called.items(), key=lambda item: item[1])
        if skill in robot.missing
    ]
