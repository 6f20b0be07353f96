"""Check a mission's program before its approval, against the robot and the steps already done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from codebotler.checking.check import check, with_contract_problems
from codebotler.checking.remaining import remaining_outcomes
from codebotler.checking.repetition import with_repetition_problems
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.preflight import missing_skills, unknown_rooms
from codebotler.robots.base import Robot


def examine_draft(
    program: str, view: SessionView, order: MissionOrder, robot: Robot, is_wanted: Callable[[], bool]
) -> dict[str, Any]:
    """Check a program. Return the results as new values for fields of `SessionView`, such as `check`.

    Args:
        program: the program to check.
        view: the session's view, which holds the rules, the rooms and any earlier mission.
        order: the session's order. If its `drive` replaces this program, its contract replaces the check's.
        robot: the connected robot.
        is_wanted: returns whether the result is still needed. If not, UnwantedCheckError is raised.
    """
    rules, skills = view.rules_in_force, robot.skills
    found = check(
        program,
        room_map=view.room_map,
        house_rules=rules,
        skills=skills,
        explores=True,
        is_wanted=is_wanted,
    )
    if view.past is not None:
        begun, before = view.past.program, view.past.before
        left = remaining_outcomes(begun, found.room_map, skills, first=before)
        found = with_repetition_problems(found, begun, left)
    if order.drive is not None and program == order.program:
        found = replace(found, contract=order.contract, proofs=(), samples=())
    if view.within is not None:
        found = with_contract_problems(found, view.within, skills)
    known = None if found.problems else view.room_map
    return {
        "check": found,
        "missing_skills": tuple(missing_skills(program, robot)),
        "unknown_rooms": tuple(unknown_rooms(program, known, skills)) if known else (),
        "busy": "",
    }
