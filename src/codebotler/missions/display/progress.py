"""Derive the progress of a mission from its events: activity, position and conversation."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

from codebotler.core.skills import kinds
from codebotler.core.skills.declaration import by_name
from codebotler.core.skills.table import Recording
from codebotler.core.terminal import shortened
from codebotler.core.trace import Event
from codebotler.core.world import Point, World, laid_out
from codebotler.missions.display.wording import event_text
from codebotler.missions.storage.log import SKILL_END_EVENTS, LogLine, MissionState
from codebotler.simulator.worlds.room_map import RoomMap

POSITION_FEEDBACK = re.compile(r"at \((-?\d{1,7}(?:\.\d{1,20})?), (-?\d{1,7}(?:\.\d{1,20})?)\)")
_MAX_MOMENTS, _MAX_STEPS = 200, 60
_MIN_MOVE_METRES = 0.05  # shorter moves are not added to the trail
ANSWER = "answer"  # the kind of moment in which a person answers the robot
_STOP_STATES = frozenset({MissionState.STOPPING, MissionState.STOPPED})  # logged after the robot has stopped


@dataclass(frozen=True)
class Moment:
    """A line of a mission's activity list, such as `drives to "kitchen"`, with its time and kind."""

    clock: float  # seconds on the robot's clock since the program began
    kind: str  # the kind of event; for speech, the kind of skill, such as `say`, or `ANSWER`
    text: str


@dataclass(frozen=True)
class Find:
    """An object or a person that the robot has found, and the room."""

    room: str  # as named in the program; empty for the starting room
    name: str


@dataclass(frozen=True)
class Progress:
    """A snapshot of a mission's progress: the current skill, the robot's position, and what it has found."""

    has_begun: bool = False  # whether the program has started on the robot
    doing: str = ""  # the current skill or pause in words; empty between them
    skill: str = ""  # the current skill
    subject: str = ""  # the first argument of the current skill
    line: int | None = None  # the program's current line, if known
    clock: float = 0.0  # seconds on the robot's clock since the program began
    room: str = ""  # the destination or current room, as named in the program
    left: str = ""  # the previous room; the robot is there again if its drive fails
    at: Point | None = None  # the position in metres, if reported
    is_driving: bool = False  # whether the robot is driving to `room`
    is_between: bool = False  # whether a cancelled drive left the robot between rooms
    visited: tuple[str, ...] = ()  # the destinations of completed drives, as named in the program
    learned: tuple[Event, ...] = ()  # looks and questions, with what came of them
    trail: tuple[Point, ...] = ()  # the latest positions, in metres
    finds: tuple[Find, ...] = ()  # objects seen or put down, and people asked, each listed once
    held: str = ""  # the object in the robot's hand
    moments: tuple[Moment, ...] = ()  # the latest entries of the activity list

    def after(self, line: LogLine) -> Progress:
        """Return the new progress after an event, given as a line of the log."""
        event = line["event"]
        if event == "state":
            return self.with_state(MissionState(line["state"]), line["clock"])
        now = replace(self, clock=max(self.clock, line["clock"]))
        if event == "feedback":
            place = POSITION_FEEDBACK.search(line["text"])
            return now.with_position((float(place[1]), float(place[2]))) if place else now
        if event == "skill":
            now = now.with_skill(line)
        elif event == "sleep" and line["seconds"]:
            now = replace(now, doing=event_text(line), line=line.get("line"))
        elif event in SKILL_END_EVENTS:
            now = now.with_result(line["result"]) if event == "result" else now.with_failure(event)
            now = replace(now, doing="", skill="", line=None, is_driving=False)
        text = "" if event == "cancelled" else event_text(line)
        if not text or (event == "sleep" and not line["seconds"]):
            return now
        return replace(now, moments=(*now.moments, _moment(line, text))[-_MAX_MOMENTS:])

    def with_state(self, state: MissionState, clock: float) -> Progress:
        """Return the progress after the mission enters `state`, at `clock` seconds on the robot's clock."""
        clock = self.clock if state in _STOP_STATES else max(self.clock, clock)
        return replace(self, clock=clock, has_begun=self.has_begun or state is MissionState.RUNNING)

    def with_skill(self, line: LogLine) -> Progress:
        """Return the progress after a `skill` event in the log, which starts a skill."""
        name = line["skill"]
        recording = _recording(name)
        drives = recording is not None and recording.is_drive
        subject = next(iter(line["arguments"].values()), "")
        now = replace(
            self,
            doing=event_text(line),
            skill=name,
            line=line.get("line"),
            is_driving=drives,
            subject=str(subject).strip(),
        )
        return replace(now, room=now.subject, left=self.room) if drives else now

    def with_position(self, at: Point) -> Progress:
        """Return the progress after the robot has reported its position, in metres."""
        now = replace(self, at=at, is_between=self.is_between or self.is_driving)
        if self.trail and math.dist(self.trail[-1], at) < _MIN_MOVE_METRES:
            return now
        return replace(now, trail=(*self.trail, at)[-_MAX_MOMENTS:])

    def with_result(self, result: object) -> Progress:
        """Return the progress after the current skill has succeeded with `result`."""
        recording = _recording(self.skill)
        now = self
        match recording and recording.kind:
            case kinds.GOTO:
                visited = (*self.visited, self.subject)[:_MAX_STEPS]
                now = replace(self, visited=visited, is_between=False)
            case kinds.PICK:
                left = tuple(one for one in self.finds if one != Find(self.room, self.subject))
                now = replace(self, held=self.subject, finds=left)
            case kinds.PLACE:
                now = replace(self._with_find(Find(self.room, self.subject)), held="")
            case kinds.CHECK:
                now = self._with_find(Find(self.room, self.subject)) if result is True else self
                look = Event(kinds.CHECK, self.subject, found=result is True)
                now = replace(now, learned=(*self.learned, look)[:_MAX_STEPS])
            case kinds.ASK:
                now = self._with_find(Find(self.room, self.subject)) if self.subject else self
                answered = Event(kinds.ASK, "", answer=str(result))
                now = replace(now, learned=(*self.learned, answered)[:_MAX_STEPS])
        return now

    def with_failure(self, event: str) -> Progress:
        """Return the progress after the current skill ended with `event`: error, cancelled or late."""
        recording = _recording(self.skill)
        if recording is not None and recording.is_drive and event != "late":
            return replace(self, room=self.left, is_between=self.is_between or event == "cancelled")
        if recording is not None and recording.options and event == "error":
            return replace(self, learned=(*self.learned, Event(kinds.ASK, ""))[:_MAX_STEPS])
        return self

    def _with_find(self, find: Find) -> Progress:
        known = [one for one in self.finds if (one.room, one.name) != (find.room, find.name)]
        return replace(self, finds=(*known, find)[-_MAX_STEPS:])


def position_on_map(progress: Progress, world: World, room_map: RoomMap | None) -> Point | None:
    """Return the robot's position on a map, in metres, or None if it is unknown.

    Until the robot reports a position, this is the stopping point of its room.
    """
    if progress.at is not None:
        return progress.at
    if progress.is_between and not progress.is_driving:
        return None
    words = progress.left if progress.is_driving else progress.room
    room = (room_map.room(words) if room_map and words else None) or world.robot
    return next((one.stand_at for one in laid_out(world).rooms if one.name == room), None)


def _recording(name: str) -> Recording | None:
    skill = by_name(name)
    return None if skill is None else skill.recording


def _moment(line: LogLine, text: str) -> Moment:
    event, clock = line["event"], line["clock"]
    recording = _recording(line.get("skill", ""))
    spoken = recording if recording is not None and recording.is_spoken else None
    if event == "skill" and spoken:
        arguments = line["arguments"]
        options = arguments.get(spoken.options or "")
        offered = f" [{' | '.join(map(str, options))}]" if options else ""
        return Moment(clock, spoken.kind, shortened(f"{arguments.get(spoken.text, '')}{offered}"))
    if event == "result" and spoken and spoken.options:
        return Moment(clock, ANSWER, shortened(str(line["result"])))
    return Moment(clock, event, text)
