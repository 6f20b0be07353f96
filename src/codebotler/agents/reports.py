"""What agents read about the robot, a check and a mission, as typed data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from pydantic import BaseModel, Field

from codebotler.checking.problems import CheckResult
from codebotler.core.terminal import shortened, visible_lines
from codebotler.missions.log import LogLine
from codebotler.missions.view import SessionView
from codebotler.missions.wording import event_text
from codebotler.web.storyboard import Scene, Strip, strips

MAX_ASKED_CHARACTERS = 4_000
"""The limit for a program that a client may show; longer ones are reviewed on the page."""

ContractText: TypeAlias = Callable[[SessionView], str]
"""Describes what the program of a view can do at most, or returns "" if this is unknown."""


class Storyboard(BaseModel):
    """What the robot would do in one kind of imagined world."""

    world: str = Field(description="What is true in this world; empty if nothing matters.")
    steps: list[str] = Field(description="Room by room.")
    ending: str


class CheckReport(BaseModel):
    """The result of checking a program in imagined worlds."""

    accepted: bool = Field(description="Whether there are no problems.")
    problems: list[str]
    storyboards: list[Storyboard]


class WrittenProgram(BaseModel):
    """A program that a model wrote."""

    program: str = Field(description="Empty if the reply contained no program.")
    model: str
    check: CheckReport


class SkillReport(BaseModel):
    """A skill of the robot."""

    signature: str
    does: str
    missing: str = Field(description="Why this robot lacks the skill; empty if it has it.")


class RobotReport(BaseModel):
    """The robot, its rooms and skills, and the house rules."""

    robot: str
    rooms: list[str] = Field(description="Empty until the robot has been connected by a first proposal.")
    skills: list[SkillReport]
    house_rules: list[str] = Field(description="Sentences that each program must obey; they are enforced.")
    how_to_write: str = Field(description="How to write a program, with all skills.")
    can_write_program: bool = Field(description="Whether a model is configured for write_program.")
    mission: str = Field(description="The state of the current mission; empty if there is none.")


class MissionReport(BaseModel):
    """A mission: what it would do, what it has done, and what can happen next."""

    mission: str = Field(description="The ID of the mission.")
    state: str = Field(description="checked, running, done, failed, stopped and so on.")
    reason: str = Field(description="Why it is in this state.")
    digest: str = Field(description="Identifies exactly this program; run_mission needs it.")
    instruction: str
    program: str
    contract: str = Field(description="What the program can do at most; empty if unknown.")
    check: CheckReport | None = Field(description="None while the program is being checked.")
    remarks: list[str] = Field(description="Likely mistakes that are no problems.")
    events: list[str] = Field(description="What happened since the event `after`.")
    event_count: int = Field(description="Pass this as `after` to see only later events.")
    is_over: bool
    next: str = Field(description="What can be done now.")
    steps: str = Field(default="", description="From begin_steps: the key for call_skill and end_steps.")


class SkillOutcome(BaseModel):
    """The result of one call of a skill."""

    result: str | bool | int | float | list[str | bool | int | float] | None = None
    error: str = Field(default="", description="Why the skill failed; empty if it succeeded.")


def report_check(check: CheckResult) -> CheckReport:
    """Return the result of a check, with the storyboards that people see on the page."""
    problems = [problem.sentence for problem in check.problems]
    return CheckReport(
        accepted=not problems, problems=problems, storyboards=[*map(_storyboard, strips(check))]
    )


def report_mission(
    view: SessionView, events: Sequence[LogLine], after: int, contract: str, then: str
) -> MissionReport:
    """Return a mission with the events after a position."""
    check = None if view.check is None else report_check(view.check)
    if check is not None:
        check.problems = list(view.problems)
        check.accepted = not check.problems
    return MissionReport(
        mission=view.id,
        state=view.phase,
        reason=view.reason or view.error,
        digest=view.digest,
        instruction=view.instruction,
        program=view.program,
        contract=contract,
        check=check,
        remarks=[*view.unknown_rooms, *view.remarks],
        events=[text for text in map(event_text, events[after:]) if text],
        event_count=len(events),
        is_over=view.is_over,
        next=then,
    )


def question(view: SessionView, robot: str, contract: str) -> str:
    """Return the question by which a client asks its person to approve a program."""
    problems = "\n".join(f"- {shortened(problem)}" for problem in view.problems)
    boards = [] if view.check is None else strips(view.check)
    parts = [
        f"An agent asks to run a program on the robot {robot}.",
        f"It says: {shortened(view.instruction)}" if view.instruction else "",
        f"At most, the program can do this:\n{contract}" if contract else "",
        f"For example:\n{_board_text(boards[0])}" if boards else "",
        f"THE CHECK FOUND PROBLEMS:\n{problems}" if problems else "The check found no problems.",
        f"Mission {view.id}, digest {view.digest}, program:\n{visible_lines(view.program.strip())}",
    ]
    return "\n\n".join(filter(None, parts))


def _storyboard(strip: Strip) -> Storyboard:
    return Storyboard(world=strip.world, steps=[*map(_scene_text, strip.scenes)], ending=strip.ending)


def _scene_text(scene: Scene) -> str:
    deeds = "; ".join(f'"{one.text}"' if one.kind in {"say", "answer"} else one.text for one in scene.deeds)
    where = scene.room if scene.is_found else f"{scene.room} (there is no such room)"
    return f"{where}: {deeds}" if deeds else where


def _board_text(strip: Strip) -> str:
    board = _storyboard(strip)
    return "\n".join(f"- {line}" for line in (board.world, *board.steps, board.ending) if line)
