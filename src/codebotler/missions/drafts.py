"""Examine the drafts of a mission's program: the check, and which of several programs a person means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from codebotler.candidates.clusters import CandidateClusters, cluster_candidates
from codebotler.checking.check import check
from codebotler.checking.proof import hold_within
from codebotler.checking.remaining import remaining_outcomes
from codebotler.checking.repetition import hold_to_past
from codebotler.checking.sampled import CheckSettings
from codebotler.missions.preflight import missing_skills, unknown_rooms
from codebotler.missions.view import MissionOrder, SessionView
from codebotler.robots.base import Robot
from codebotler.simulator.pool import shared_pool


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


def compare_drafts(
    programs: Sequence[str], view: SessionView, robot: Robot, refused: Sequence[str] = ()
) -> CandidateClusters:
    """Group several programs for one instruction by what they do in imagined worlds.

    Raise UserError if all of them do the same as programs that were refused before.
    """
    settings, pool = CheckSettings(skills=robot.skills, house_rules=view.rules_in_force), shared_pool()
    return pool.call(lambda: cluster_candidates(pool.here(), programs, settings, view.room_map, refused))
