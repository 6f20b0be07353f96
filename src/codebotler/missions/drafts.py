"""Examine a draft of a mission's program: the check, and what the robot and the past say of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from codebotler.checking.check import check, hold_within
from codebotler.checking.remaining import remaining_outcomes
from codebotler.checking.repetition import hold_to_past
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.preflight import missing_skills, unknown_rooms
from codebotler.robots.base import Robot


def examine_draft(program: str, view: SessionView, order: MissionOrder, robot: Robot) -> dict[str, Any]:
    """Return the fields of a session's view that tell what a check and the robot say of a program.

    Args:
        program: the program.
        view: the view of the session.
        order: the order, which may have a past or drive the robot in place of the program.
        robot: the connected robot.
    """
    rules, skills = view.rules_in_force, robot.skills
    found = check(program, room_map=view.room_map, house_rules=rules, skills=skills, explores=True)
    if view.past is not None:
        begun, before = view.past.program, view.past.before
        left = remaining_outcomes(begun, found.room_map, skills, first=before)
        found = hold_to_past(found, begun, left)
    if order.drive is not None and program == order.program:
        found = replace(found, contract=order.contract, proofs=(), samples=())
    if view.within is not None:
        found = hold_within(found, view.within, skills)
    known = None if found.problems else view.room_map
    return {
        "check": found,
        "missing_skills": tuple(missing_skills(program, robot)),
        "unknown_rooms": tuple(unknown_rooms(program, known, skills)) if known else (),
        "busy": "",
    }
