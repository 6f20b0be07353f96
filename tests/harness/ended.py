"""Missions that ended early, as their folders show them."""

from __future__ import annotations

import json
from pathlib import Path

from codebotler.core.world import World
from codebotler.missions.mission import Mission
from codebotler.missions.storage.log import EVENTS_FILE, MissionState, MissionSummary
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated


def failed_mission(home: Path, program: str, world: World, instruction: str = "Bring Anne the mug.") -> Path:
    """The folder of a mission that ended early."""
    robot = Simulated(world, speed=None)
    mission = Mission(home, "simulated", instruction)
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    with Reservation(robot, home) as reserved, mission:
        mission.run(reserved, world.robot)
    assert mission.state is MissionState.FAILED
    return mission.folder


def cut(folder: Path, lines: int, state: MissionState = MissionState.INTERRUPTED) -> None:
    """Let the tool have died after so many lines of the log, and the next one have found that."""
    log = folder / EVENTS_FILE
    kept = log.read_text().splitlines(keepends=True)[:lines]
    log.write_text("".join(kept))
    summary = MissionSummary.read(folder)
    summary.state, summary.reason = state, "CodeBotler ended unexpectedly"
    summary.write(folder)


def line_of(folder: Path, skill: str, event: str) -> int:
    """The number of a line in the log, from 1."""
    lines = [json.loads(line) for line in (folder / EVENTS_FILE).read_text().splitlines()]
    return next(n for n, line in enumerate(lines, 1) if (line.get("skill"), line["event"]) == (skill, event))
