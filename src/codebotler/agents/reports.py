"""Reports about a robot, a check and a mission, for agents and people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, Field, model_validator

from codebotler.candidates.question import ClarifyingQuestion
from codebotler.checking.problems import CheckResult
from codebotler.core.terminal import shortened, visible_lines
from codebotler.core.text.phrases import is_question, is_spoken
from codebotler.core.text.words import listed
from codebotler.missions.display.view import SessionView
from codebotler.robots.base import Robot
from codebotler.web.storyboard import Action, Scene, Strip, strips


class _Report(BaseModel):
    @model_validator(mode="before")
    @classmethod
    def _escape_surrogates(cls, data: object) -> object:
        return _sendable(data)


class CheckReport(_Report):
    """A checked program: its problems, its contract, and its storyboards in imagined worlds."""

    accepted: bool = Field(description="Whether there are no problems.")
    problems: list[str]
    contract: str = Field(description="What the program can do at most; empty if this is unknown.")
    storyboards: list[str] = Field(description="What the robot would do in different imagined worlds.")
    program: str


class RobotReport(_Report):
    """The robot: its rooms, its skills, the house rules, and how to write a program for it."""

    robot: str
    rooms: list[str] = Field(description="Empty until a first proposal has connected the robot.")
    skills: list[str] = Field(description="The signatures of the skills that this robot has.")
    house_rules: list[str] = Field(description="Sentences that each program must obey; they are enforced.")
    how_to_write: str = Field(description="How to write a program, with all skills.")
    can_write_program: bool = Field(description="Whether a model is configured for write_program.")


class MissionReport(_Report):
    """A mission: what it would do, what it has done, and what can happen next."""

    mission: str = Field(description="The ID of the mission.")
    state: str = Field(description="checked, running, done, failed, stopped and so on.")
    reason: str = Field(description="Why it is in this state.")
    digest: str = Field(description="Identifies exactly this program; run_mission needs it.")
    check: CheckReport | None = Field(description="None while the program is being checked.")
    remarks: list[str] = Field(description="Likely mistakes that are no problems.")
    events: list[str] = Field(description="What happened since the event `after`, at most 1,000 events.")
    event_count: int = Field(description="Pass this as `after` to see only later events.")
    is_over: bool
    next: str = Field(description="What can be done now.")
    done_before: list[str] = Field(default=[], description="What a mission that this one continues has done.")
    steps: str = Field(default="", description="From begin_steps: the key for call_skill and end_steps.")


class SkillOutcome(_Report):
    """The result of one skill call, or the reason why the skill failed."""

    result: Any = Field(default=None, description="The result of the skill, if it returns one.")
    error: str = Field(default="", description="Why the skill failed; empty if it succeeded.")


def report_check(check: CheckResult, program: str, problems: Sequence[str], contract: str) -> CheckReport:
    """Return a check's result for agents, with these problems, this contract, and storyboards as text."""
    return CheckReport(
        accepted=not problems,
        problems=[*problems],
        contract=contract,
        storyboards=[_board_text(strip) for strip in strips(check)],
        program=program,
    )


def approval_text(view: SessionView, robot: Robot, contract: str) -> str:
    """Return the text of the dialog to approve a program: its problems, its contract and an example run."""
    rules = listed([shortened(rule.name) for rule in view.rules_in_force])
    where = f" at {shortened(robot.address)}" if robot.address else ""
    problems = "\n".join(f"- {shortened(problem)}" for problem in view.problems)
    switched_off = listed([*map(shortened, view.disabled_rules)])
    boards = [] if view.check is None else strips(view.check)
    boards = [board for board in boards if len(board.scenes) > 1 or board.scenes[0].deeds]
    parts = [
        f"An agent asks to run a program on the robot {robot.name}{where}.",
        f"THE CHECK FOUND PROBLEMS:\n{problems}" if problems else "The check found no problems.",
        f"House rules in force: {rules}." if rules else "No house rules are in force.",
        f"A person has switched off rules for this program: {switched_off}." if switched_off else "",
        f"It says: {shortened(view.instruction)}" if view.instruction else "",
        f"It does the rest of mission {view.past.mission}, which ended early." if view.past else "",
        f"At most, the program can do this:\n{visible_lines(contract)}" if contract else "",
        "" if view.check is None else view.check.assumption,
        f"For example:\n{_board_text(boards[0])}" if boards else "",
        f"Mission {view.id}, digest {view.digest}, program:\n{visible_lines(view.program.strip())}",
    ]
    return "\n\n".join(filter(None, parts))


def choice_text(asked: ClarifyingQuestion) -> str:
    """Return the text of the dialog to choose a behaviour, with numbered options."""
    numbered = enumerate(asked.options, 1)
    options = (f"{number}. The robot {shortened(one.difference)} ({one.share})." for number, one in numbered)
    last = f'The answer "none" ends the mission: {asked.why_last}.' if asked.why_last else ""
    first = f"Which did you mean{asked.supposition}?"
    return "\n".join(filter(None, (first, *options, asked.left_out, last)))


def _sendable(value: object) -> object:
    """Escape lone surrogates, which programs and errors may contain, but messages cannot."""
    if isinstance(value, str):
        return value.encode(errors="backslashreplace").decode()
    if isinstance(value, list):
        return [*map(_sendable, value)]
    return {name: _sendable(one) for name, one in value.items()} if isinstance(value, dict) else value


def _board_text(strip: Strip) -> str:
    lines = (strip.world, *map(_scene_text, strip.scenes), strip.ending)
    return "\n".join(f"- {line}" for line in lines if line)


def _deed_text(deed: Action) -> str:
    """Return a deed in words, where no text of a program can end a quotation or begin another deed."""
    text = deed.text.replace(";", ",")
    is_text = deed.kind == "answer" or is_spoken(deed.kind) or is_question(deed.kind)
    return '"{}"'.format(text.replace('"', "'")) if is_text else text


def _scene_text(scene: Scene) -> str:
    deeds = "; ".join(map(_deed_text, scene.deeds))
    room = scene.room.replace(";", ",").replace(":", ",")
    where = room if scene.is_found else f"{room} (there is no such room)"
    return f"{where}: {deeds}" if deeds else where
