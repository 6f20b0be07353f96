"""What a robot is doing, where it is and what was said, derived from a mission's events."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from codebotler.core.program import parsed
from codebotler.core.skills import SKILLS
from codebotler.core.terminal import shortened
from codebotler.core.world import Point
from codebotler.missions.log import SKILL_ENDS, Line
from codebotler.missions.wording import activity, event_text, stop_text

AT = re.compile(r"at \((-?\d{1,7}(?:\.\d{1,20})?), (-?\d{1,7}(?:\.\d{1,20})?)\)")
MOST, MOST_STEPS = 200, 60  # moments, and drives, looks and finds, that are kept
NEAR = 0.05  # metres; a robot that moves less stays where it is
UNTOLD = frozenset({"state", "cancelled"})  # events that other events or the page tell
ANSWER = "answer"  # the kind of moment at which the robot hears something


@dataclass(frozen=True)
class Moment:
    """Something that happened, in words."""

    clock: float  # seconds by the robot's clock since the program began
    kind: str  # of the event; the skill's own, such as `say`, for what is spoken, and `ANSWER`
    text: str


@dataclass(frozen=True)
class Find:
    """Something or somebody that the robot has met."""

    room: str  # in the program's words; empty for where the robot began
    name: str


@dataclass(frozen=True)
class Progress:
    """How far a mission has come."""

    doing: str = ""  # now, in words
    skill: str = ""  # the skill under way
    subject: str = ""  # its first argument
    activity: str = ""  # the skill in words, such as `driving to supply room`, also once it is cancelled
    line: int | None = None  # of the program, which calls the skill under way; None if that is not known
    clock: float = 0.0  # seconds by the robot's clock since the program began
    room: str = ""  # the last destination, in the program's words
    at: Point | None = None  # the position in metres, if known
    is_driving: bool = False  # to `room`
    visited: tuple[str, ...] = ()  # the destinations that were reached, in the program's words
    looks: tuple[tuple[str, bool], ...] = ()  # what was looked for, and whether it was found
    trail: tuple[Point, ...] = ()  # the last 200 positions
    finds: tuple[Find, ...] = ()  # what was seen, and who was asked, by room; each once
    held: str = ""  # what the robot holds
    moments: tuple[Moment, ...] = ()  # the last 200

    def after(self, line: Line, program: str) -> Progress:
        """The progress after one more event of a program."""
        event = line["event"]
        now = replace(self, clock=max(self.clock, line["clock"]))
        if event == "feedback":
            place = AT.search(line["text"])
            return now.moved((float(place[1]), float(place[2]))) if place else now
        if event == "skill":
            now = now.with_skill(line, program)
        elif event in SKILL_ENDS:
            if event == "result":
                now = now.with_result(line["result"])
            still = self.activity if event == "cancelled" else ""
            now = replace(now, doing="", skill="", line=None, is_driving=False, activity=still)
        text = "" if event in UNTOLD else event_text(line)
        if event == "stop":
            text = stop_text(line["by"], self.activity)
        if not text or (event == "sleep" and not line["seconds"]):
            return now
        return replace(now, moments=(*now.moments, _moment(line, text))[-MOST:])

    def with_skill(self, line: Line, program: str) -> Progress:
        """The progress when a skill begins."""
        name = line["skill"]
        recording = SKILLS[name].recording if name in SKILLS else None
        drives = recording is not None and recording.is_drive
        arguments = tuple(map(_plain, line["arguments"].values()))
        now = replace(
            self,
            doing=event_text(line),
            skill=name,
            line=line.get("line") or line_of(program, name, arguments),
            is_driving=drives,
            subject=str(next(iter(arguments), "")).strip(),
            activity=activity(line),
        )
        return replace(now, room=now.subject) if drives else now

    def moved(self, at: Point) -> Progress:
        """The progress when the robot is somewhere."""
        if self.trail and math.dist(self.trail[-1], at) < NEAR:
            return replace(self, at=at)
        return replace(self, at=at, trail=(*self.trail, at)[-MOST:])

    def with_result(self, result: object) -> Progress:
        """The progress when the skill under way has ended well."""
        recording = SKILLS[self.skill].recording if self.skill in SKILLS else None
        now = self
        match recording and recording.kind:
            case "goto":
                now = replace(self, visited=(*self.visited, self.subject)[:MOST_STEPS])
            case "pick":
                now = replace(self, held=self.subject)
            case "place":
                now = replace(self, held="")
            case "check":
                now = self._found(Find(self.room, self.subject)) if result is True else self
                now = replace(now, looks=(*self.looks, (self.subject, result is True))[:MOST_STEPS])
            case "ask" if self.subject:
                now = self._found(Find(self.room, self.subject))
        return now

    def _found(self, find: Find) -> Progress:
        known = [one for one in self.finds if (one.room, one.name) != (find.room, find.name)]
        return replace(self, finds=(*known, find)[-MOST_STEPS:])


def _moment(line: Line, words: str) -> Moment:
    event, clock = line["event"], line["clock"]
    skill = SKILLS.get(line.get("skill", ""))
    spoken = skill.recording if skill and skill.recording and skill.recording.is_spoken else None
    if event == "skill" and spoken:
        arguments = line["arguments"]
        options = arguments.get(spoken.options or "")
        offered = f" [{' | '.join(map(str, options))}]" if options else ""
        return Moment(clock, spoken.kind, shortened(f"{arguments.get(spoken.text, '')}{offered}"))
    if event == "result" and spoken and spoken.options:
        return Moment(clock, ANSWER, shortened(str(line["result"])))
    return Moment(clock, event, words)


def _plain(argument: object) -> object:
    return tuple(argument) if isinstance(argument, list) else argument


def line_of(program: str, skill: str, given: Sequence[object]) -> int | None:
    """The line of a program that calls a skill with these arguments; None where several can be meant."""
    lines = {line for line, fixed in _calls(program).get(skill, ()) if _fits(fixed, given)}
    return lines.pop() if len(lines) == 1 else None


UNKNOWN: Any = object()


def _fits(fixed: Sequence[object], given: Sequence[object]) -> bool:
    return all(one is UNKNOWN or one == other for one, other in zip(fixed, given, strict=False))


@lru_cache(maxsize=16)
def _calls(program: str) -> Mapping[str, Sequence[tuple[int, tuple[object, ...]]]]:
    """The calls of each skill, with the arguments that are constants."""
    tree = parsed(program)
    if not isinstance(tree, ast.Module):
        return {}
    found: dict[str, list[tuple[int, tuple[object, ...]]]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in SKILLS:
            found.setdefault(node.func.id, []).append((node.lineno, tuple(_values(node))))
    return found


def _values(call: ast.Call) -> Iterator[object]:
    for argument in call.args:
        if isinstance(argument, ast.Starred):
            return
        yield argument.value if isinstance(argument, ast.Constant) else UNKNOWN
