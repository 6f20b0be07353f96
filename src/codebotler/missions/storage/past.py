"""Find out from the log of a mission what it did and saw, so that another mission can do the rest."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.kinds import PICK, PLACE
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.terminal import shortened
from codebotler.core.text.phrases import NO_ANSWER, phrase
from codebotler.core.trace import (
    Event,
    Trace,
    attempted_event,
    held_after,
    placed_trace_data,
    placed_trace_from,
    to_options,
)
from codebotler.core.world import World
from codebotler.missions.display.progress import Progress
from codebotler.missions.storage.log import LogLine, MissionState, MissionSummary, find_skill_end, read_events
from codebotler.missions.storage.store import find_mission, find_rest
from codebotler.robots.reservation import normalize_address
from codebotler.robots.simulated import SIMULATION
from codebotler.simulator.worlds.robot import Argument, Result, SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap

DONE_EVENTS = frozenset({"result", "late"})
"""The kinds of log events that show that the robot completed a skill."""


@dataclass(frozen=True)
class MissionPast:
    """The steps of an ended mission and the missions before it, so that a new mission can do the rest.

    Args:
        mission: the ID of the ended mission.
        instruction: the instruction; empty if there was only a program.
        model: the model that wrote the program; empty if a person did.
        program: the program of the ended mission.
        why: why the mission ended, in a sentence.
        trace: what the robot did and saw, with rooms and objects named as in the programs.
        place: where the robot was last; empty if unknown.
        unsure: a step that may or may not have happened, such as a cancelled `say`; None if there is none.
        before: how many steps of `trace` were done by earlier missions.
        has_failed: whether the mission failed, rather than being stopped or interrupted.
        testimony: what people said about unsure steps, in a sentence.
    """

    mission: str
    instruction: str
    model: str
    program: str
    why: str
    trace: Trace
    place: str = ""
    unsure: Event | None = None
    before: int = 0
    has_failed: bool = False
    testimony: str = ""

    @property
    def is_untouched(self) -> bool:
        """Whether the robot has neither done nor tried anything, so that the whole program can still run."""
        return bool(self.program) and not (self.trace or self.unsure or self.has_failed)

    @property
    def held(self) -> str:
        """The object that the robot holds, or "" if it holds nothing."""
        return held_after(self.trace)

    @property
    def progress(self) -> Progress:
        """The progress with which the new mission begins: where the robot is, what it holds and has found."""
        now = Progress()
        for event in self.trace:
            row = by_event(event.kind)
            if row is not None and not event.failed:
                subject = event.text if event.to is None else event.to
                now = replace(now, room=event.place, skill=row.name, subject=subject).with_result(event.found)
        return Progress(room=self.place, held=self.held, finds=now.finds)

    @property
    def steps(self) -> list[str]:
        """All steps of the robot in words, including failed ones."""
        return [*map(_step_words, self.trace)]

    @property
    def done(self) -> list[str]:
        """The robot's steps that did not fail, in words."""
        return [_step_words(event) for event in self.trace if not event.failed]

    def position_text(self, place: str) -> str:
        """Return a sentence that says that the robot is in the room `place` and what it holds."""
        return f'The robot is in "{shortened(place)}" and holds {self._held_words}.'

    @property
    def last_position_text(self) -> str:
        """A sentence that says where the robot last was and what it held, as logged, or "" if unknown."""
        where = f'the robot was in "{shortened(self.place)}" and held {self._held_words}'
        return f"Just before that, {where}, says the log." if self.place else ""

    @property
    def _held_words(self) -> str:
        return f'"{shortened(self.held)}"' if self.held else "nothing"

    @property
    def unsure_step_text(self) -> str:
        """A clause that tells a person which step may have happened, or "" if `unsure` is None."""
        if self.unsure is None:
            return ""
        return f"the robot began this, but the log does not say whether it happened: {self._unsure_words}"

    @property
    def _unsure_words(self) -> str:
        assert self.unsure is not None
        where = f' in "{shortened(self.unsure.place)}"' if self.unsure.place else ""
        return phrase(self.unsure, "past", show=shortened).removesuffix(f" → {NO_ANSWER}") + where

    @property
    def answers(self) -> tuple[str, ...]:
        """The options of the robot's question, if `unsure` is a question; otherwise empty."""
        return () if self.unsure is None else tuple(option.text for option in self.unsure.options)

    def resolve(self, *, happened: bool, answer: str = "") -> MissionPast:
        """Return a copy that records what a person said: whether the step `unsure` happened.

        Args:
            happened: whether the step happened.
            answer: the answer, if the step is a question; empty if nobody knows the answer.

        Raises:
            UserError: the answer is not one of the options.
        """
        if self.unsure is None:
            return self
        if answer and answer not in self.answers:
            raise UserError(f'"{shortened(answer)}" is not one of the options: {", ".join(self.answers)}')
        done = replace(self.unsure, answer=answer or None)
        trace = (*self.trace, done) if happened else self.trace
        did = "happened" if happened else "did not happen"
        word = f"a person said that in mission {self.mission} this {did}: {self._unsure_words}"
        testimony = "; ".join(filter(None, (self.testimony, word)))
        return replace(self, trace=trace, unsure=None, testimony=testimony)

    def add_to(self, room_map: RoomMap | None, place: str) -> tuple[RoomMap, str]:
        """Return the map with these steps added, and the robot's room: `place` or else the last known one."""
        place = place or self.place
        known = RoomMap((place,), place, guessed=True) if room_map is None else room_map
        return replace(known, start=known.room(place) or known.start, past=self.trace), place

    def data(self) -> dict[str, object]:
        """Return these steps as data for the `past` event in the log of the new mission."""
        return {
            "continues": self.mission,
            "why": self.why,
            "trace": placed_trace_data(self.trace),
            "testimony": self.testimony,
        }


def read_past(
    folder: Path, skills: SkillTable, robot_kind: str = "", world: World | None = None, address: str = ""
) -> MissionPast:
    """Read from a mission's log what the robot did and saw.

    Args:
        folder: the folder of the mission.
        skills: the robot's skills.
        robot_kind: the kind of robot that will do the rest; by default that of the mission.
        world: the map of that robot, or None if it has none.
        address: the address of that robot, or "" to accept any robot of its kind.

    Raises:
        UserError: the mission cannot be continued, ran on another robot or map, or its log is invalid.
    """
    summary = MissionSummary.read(folder)
    if robot_kind not in {"", summary.robot}:
        raise UserError(f"mission {summary.id} ran on {summary.robot} and cannot continue on {robot_kind}")
    expect_continuable(folder)
    events = read_events(folder)
    before: LogLine = next((line for line in events if line["event"] == "past"), {})
    has_run = any(line["event"] == "state" and line["state"] == MissionState.RUNNING for line in events)
    if before and not has_run:  # the rest is still that of the mission before it
        earlier = find_mission(folder.parent.parent, summary.continues)
        return read_past(earlier, skills, robot_kind, world, address)
    if not has_run:  # nobody approved its program
        raise UserError(f"mission {summary.id} never ran; give the instruction again")
    if summary.address and address and normalize_address(address) != summary.address:
        raise UserError(f"mission {summary.id} ran on the robot at {summary.address}; continue it there")
    try:
        if world is not None:
            _expect_same_map(summary.id, events, world)
        robot, unsure = _repeat(events, skills, summary.place)
    except UserError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError, re.error):
        sentence = "the log does not match the known skills; name the files of custom skills with --skills"
        raise UserError(sentence, file=folder) from None
    return MissionPast(
        summary.id,
        summary.instruction,
        summary.model,
        summary.program,
        summary.reason,
        robot.trace,
        robot.place,
        unsure,
        len(before.get("trace", ())),
        summary.state is MissionState.FAILED,
        str(before.get("testimony", "")),
    )


def expect_continuable(folder: Path) -> None:
    """Raise UserError if the mission in a folder has not ended, is done, or was already continued."""
    summary = MissionSummary.read(folder)
    if not summary.has_ended:
        raise UserError(f"mission {summary.id} has not ended; stop it first")
    if summary.state is MissionState.DONE:
        raise UserError(f"mission {summary.id} is done; there is nothing to continue")
    rest = find_rest(folder)
    if rest is not None:
        mend = "can be continued instead" if rest.has_ended else "is at work"
        mend = "is done" if rest.state is MissionState.DONE else mend
        raise UserError(f"mission {summary.id} was already continued by mission {rest.id}, which {mend}")


def _expect_same_map(mission: str, events: Sequence[LogLine], world: World) -> None:
    """Raise UserError if a mission had a map with a room that a world lacks."""
    here = {room.name for room in world.rooms}
    had = (room["name"] for line in events if line["event"] == "map" for room in line["rooms"])
    lacks = next((name for name in had if name not in here), None)
    if lacks is not None:
        where = f'ran on another map, with the room "{shortened(lacks)}"'
        raise UserError(f"mission {mission} {where}; give that map with --world")


def _repeat(events: Sequence[LogLine], skills: SkillTable, place: str) -> tuple[LoggedRobot, Event | None]:
    """Return a robot that did what a log contains, and a step at the end that may have happened or not."""
    past = next((placed_trace_from(line["trace"]) for line in events if line["event"] == "past"), ())
    robot = LoggedRobot(World((), place), skills)
    robot.events, robot.held = [*past], held_after(past) or None
    unsure: Event | None = None
    for number, line in enumerate(events, 1):
        if line["event"] != "skill":
            continue
        robot.end = find_skill_end(events, number) or {"event": "unknown"}
        row, arguments = skills[line["skill"]], arguments_in(line, skills)
        if robot.end["event"] in {"unknown", "cancelled"} and _has_effect(row):
            holding = robot.held or ""
            unsure = attempted_event(row, arguments, place=robot.place, time=0.0, holding=holding)
            unsure = unsure or Event(row.name, "", place=robot.place, holding=holding)
        try:
            robot.execute(row.name, arguments)
        except RobotError:
            tried = attempted_event(row, arguments, place=robot.place, time=0.0, holding=robot.held or "")
            if tried is not None and robot.end["event"] == "error":
                robot.events.append(replace(tried, failed=str(robot.end["kind"])))
    return robot, unsure


def _step_words(event: Event) -> str:
    words = phrase(event, "past", show=shortened)
    if not event.failed and words.endswith(NO_ANSWER):  # a question that nobody answers fails
        words = f"{words.removesuffix(NO_ANSWER)}answer unknown"
    if event.failed:
        words = f"failed to {phrase(event, 'base', show=shortened)} ({shortened(event.failed)})"
    return f'in "{shortened(event.place)}": {words}' if event.place else words


def _has_effect(row: Skill) -> bool:
    """Return whether a person would notice if a skill were executed twice. A drive may be repeated."""
    is_spoken = row.recording is not None and row.recording.is_spoken
    return is_spoken or not (row.is_idle or row.is_drive)


class LoggedRobot(SimulatedRobot):
    """A simulated robot that replays a mission's log. Set `end` to the event that ends the next skill."""

    def __init__(self, world: World | None, skills: SkillTable) -> None:
        super().__init__(world or World((), ""), SIMULATION, skills)
        self.end: LogLine = {}  # the event that ends the current skill

    def thing_meant(self, request: str) -> None:
        """Return None, since a log does not list the objects in a room."""

    def execute(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Return a skill's logged result and record its event, or raise RobotError if the skill failed."""
        if self.end["event"] not in DONE_EVENTS:
            raise RobotError(self.end["event"], "the skill failed or was cancelled")
        row, result = self.skills[skill], self.end.get("result")
        event = attempted_event(row, arguments, place=self.place, time=self.now, holding=self.held or "")
        if event is None:
            return result
        if row.is_drive:
            self.room = self.room_for(event.text) or event.text
            event = replace(event, destination=self.place)
        elif event.kind in {PICK, PLACE}:
            self.held = event.text if event.kind == PICK else None
        found = result if isinstance(result, bool) else None
        self.events.append(replace(event, answer=str(result) if event.options else None, found=found))
        return result


def arguments_in(line: LogLine, skills: SkillTable) -> list[Argument]:
    """Return a logged skill call's arguments in the types that robots expect, such as tuples for lists."""
    given = zip(skills[line["skill"]].parameters, line["arguments"].values(), strict=True)
    listed = [to_options(value) if parameter.is_options else value for parameter, value in given]
    return [tuple(value) if isinstance(value, list) else value for value in listed]
