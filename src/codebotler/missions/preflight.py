"""Ask a robot for its rooms, its current room and its missing skills before it moves, and say what fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from codebotler.checking.house_rules.rooms import find_evasions, unknown_rooms_in
from codebotler.checking.problems import no_room
from codebotler.checking.source.room_names import named_rooms
from codebotler.core.errors import RobotError, UserError
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import shortened, system_sentence, visible
from codebotler.core.world import Room, World, laid_out
from codebotler.missions.live import check_answer
from codebotler.missions.mission import MissionError
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import ModelError
from codebotler.models.recorded import UnknownInstructionError, find_closest, open_recorded
from codebotler.robots.base import CancelledError, NotReadyError, Robot, RobotLostError, RobotResult
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worker import EngineError
from codebotler.simulator.worlds.room_map import RoomMap

EXPECTED_ERRORS = (UserError, ModelError, NotReadyError, EngineError, MissionError, OSError)
"""Errors that can end a mission before it runs, with a sentence that says why."""

MAX_CHECKED_ROOMS = 1_000
"""The most rooms for which a check compares each drive with every room."""


def is_resumable(robot: Robot) -> bool:
    """Whether a robot can take over the final state of an earlier mission. Only simulated robots can."""
    return hasattr(robot, "resume")  # an optional method


def resume_robot(robot: Robot, past: MissionPast) -> None:
    """Put a simulated robot into the final state of the earlier mission `past`. Ignore other robots."""
    if is_resumable(robot):
        robot.resume(past.trace)  # type: ignore[attr-defined]  # as was just found


def ask_rooms(
    robot: Robot, remark: Callable[[str], None], world: World | None = None
) -> tuple[RoomMap | None, str]:
    """Ask a connected robot for its rooms and its current room. Report likely mistakes with `remark`.

    Returns:
        the rooms, with footprints from `world`, or None if the robot does not list its rooms, and the
        robot's current room, or "" if the robot does not report it.

    Raises:
        NotReadyError: the robot gives no valid answer.
    """
    can = [skill for skill in robot.skills if skill not in robot.missing]

    def ask_robot(skill: str, what: str) -> RobotResult:
        if skill not in can:
            return None
        try:
            return check_answer(robot.skills[skill], robot.perform(skill, ()))
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
    known = RoomMap((), "")
    if world is not None and robot.rooms_are_regexes:
        known = RoomMap.of(world)
    elif world is not None:
        inside = ((room.name, room.within) for room in world.rooms if room.within in rooms)
        known = RoomMap((), "", places=tuple(inside))
    if place and place not in (*rooms, *known.goals):
        remark(shortened(f'the robot says it is in "{place}", which is not in its list of rooms'))
    listed = list(map(str, rooms))
    names = dict.fromkeys([*listed, place] if place and place not in known.goals else listed)
    plan, plain = () if world is None else _plan(robot, world), not robot.rooms_are_regexes
    return replace(known, rooms=tuple(names), start=place or listed[0], plain=plain, plan=plan), place


def _plan(robot: Robot, world: World) -> tuple[Room, ...]:
    """Return the rooms of a map. Only robots that drive on our grid get its default footprints."""
    rooms = laid_out(world).rooms if robot.rooms_are_regexes else world.rooms
    is_straight = robot.name == "simulated"
    empty = (replace(room, objects=(), people=()) for room in rooms)
    return tuple(room if is_straight else replace(room, stand_at=None) for room in empty)


def expect_enforceable(
    rules: Sequence[Rule], robot: Robot, room_map: RoomMap | None, remark: Callable[[str], None]
) -> None:
    """Raise UserError or NotReadyError if a rule is not enforceable. Pass ways to evade rules to `remark`."""
    rooms = () if room_map is None else room_map.goals
    for sentence in (one for rule in rules for one in unknown_rooms_in(rule, rooms)):
        raise UserError(sentence)
    expect_poses(rules, robot, room_map)
    regexes = () if room_map is None or room_map.plain else rooms
    for sentence in find_evasions(rules, regexes, robot.skills):
        remark(sentence)


def expect_poses(rules: Sequence[Rule], robot: Robot, room_map: RoomMap | None) -> None:
    """Raise NotReadyError if a rule needs a position or a footprint that neither robot nor map gives."""
    known = room_map or RoomMap((), "")
    outlined = {room.name for room in known.plan if room.footprint is not None}
    for rule, element in ((one, element) for one in rules for element in one.inside):
        others = (room for room in known.rooms if room not in outlined and element.text.matches(room))
        lacks = next(others, "each room" if room_map is None else "")
        what = f'the footprint of "{lacks}"; add it to the map'
        if not robot.has_pose:
            what = f"the robot's position, which {robot.name} does not report; remove the rule"
        if lacks or not robot.has_pose:
            raise NotReadyError(f'the rule "{rule.name}" needs {what}')


def limit_rooms(room_map: RoomMap | None, remark: Callable[[str], None]) -> RoomMap | None:
    """Return `room_map`, or report to `remark` and return None if it has too many rooms for a check."""
    if room_map is None or len(room_map.rooms) <= MAX_CHECKED_ROOMS:
        return room_map
    limit = f"a check supports {MAX_CHECKED_ROOMS:,}, so it uses only the rooms that the program names"
    remark(f"the robot lists {len(room_map.rooms):,} rooms; {limit}")
    return None


def unknown_rooms(program: str, room_map: RoomMap, skills: SkillTable = SKILLS) -> list[str]:
    """Return a sentence for each room in the program that the robot does not know."""

    def is_part(name: str) -> bool:
        return any(name.casefold() in room.casefold() for room in room_map.rooms)

    named = named_rooms(parse_leniently(program), skills)
    return [no_room(name, room_map) for name in named if room_map.room(name) is None and not is_part(name)]


def known_instructions(room_map: RoomMap | None) -> dict[str, str]:
    """Return recorded programs by instruction. With a map, include only those that name rooms on the map."""
    replies = open_recorded("recorded").replies
    known = {instruction: solutions[0].program for instruction, solutions in replies.items()}

    def is_possible(program: str) -> bool:
        has_rooms = bool(named_rooms(parse_leniently(program)))
        return room_map is None or (has_rooms and not unknown_rooms(program, room_map))

    return {instruction: program for instruction, program in known.items() if is_possible(program)}


def with_closest_here(error: UnknownInstructionError, room_map: RoomMap | None) -> UnknownInstructionError:
    """Return a copy of the error that suggests only instructions whose rooms the robot knows."""
    closest = find_closest(error.instruction, known_instructions(room_map))
    return UnknownInstructionError(error.model, error.instruction, closest)


@contextmanager
def suggesting_here(room_map: RoomMap | None) -> Iterator[None]:
    """In a `with` block, let a recorded model's error suggest only instructions for the robot's rooms."""
    try:
        yield
    except UnknownInstructionError as error:
        raise with_closest_here(error, room_map) from None


def missing_skills(program: str, robot: Robot) -> list[str]:
    """Return a sentence for each skill in the program that the connected robot lacks."""
    called = called_skills(parse_leniently(program), robot.skills)
    return [
        f"line {line}: this robot has no `{skill}` skill: {visible(robot.missing[skill])}"
        for skill, line in sorted(called.items(), key=lambda item: item[1])
        if skill in robot.missing
    ]


def error_sentence(error: Exception) -> str:
    """Return why a mission ended. For an unexpected error, begin with its class: `KeyError: 'kitchen'`."""
    if isinstance(error, UnknownInstructionError):
        return f"{error.model} has no program for this instruction"
    if isinstance(error, OSError) and error.filename is not None:
        return system_sentence(error)
    sentence = visible(str(error))
    return sentence if isinstance(error, EXPECTED_ERRORS) else f"{type(error).__name__}: {sentence}"
