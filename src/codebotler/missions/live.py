"""A robot as a running program meets it: each skill is noted as it happens, and none starts after a stop."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Protocol

from codebotler.core.skills import Skill
from codebotler.core.trace import Event, Trace
from codebotler.robots import base
from codebotler.robots.base import CancelledError, Picture, RobotLostError
from codebotler.simulator.robot import Argument, Result, RobotError
from codebotler.simulator.rules import ENDLESS, Rules

BEGINS = frozenset({"goto", "ask", "say"})
"""Kinds of events that happen by being tried; of all others there is an event only when they succeed."""

RETURNS: Mapping[str, type] = {"str": str, "bool": bool, "list[str]": list, "None": type(None)}


class Note(Protocol):
    """Takes down what happens; called from any thread."""

    def __call__(self, event: str, /, **data: object) -> None:
        """Take down one event; the `picture` of one is bytes.

        Raises:
            OSError: it cannot be written.
        """


class StoppedError(Exception):
    """The robot was stopped, and with it the program."""


class LiveRobot:
    """What `Worker.run_live` asks of a robot, answered by a real or simulated one.

    Args:
        robot: connected.
        note: takes down each skill, how it goes on and how it ends.
        place: the room it is in, as far as that is known.
        clock_starts: what the program's clock shows at its start; by default what a clock on the wall shows
            now, since programs speak of the time to people.
    """

    is_live = True
    never_fails: frozenset[str] = frozenset()
    only_looks: frozenset[str] = frozenset()
    surely: tuple[tuple[str, str], ...] = ()

    def __init__(
        self, robot: base.Robot, note: Note, *, place: str = "", clock_starts: datetime | None = None
    ) -> None:
        self.robot, self.skills, self._note = robot, robot.skills, note
        starts = clock_starts or datetime.now().astimezone().replace(tzinfo=UTC)
        self.rules = Rules(literals="as-written", limits=ENDLESS, clock_starts=starts)
        self._place = place
        self._events: list[Event] = []
        self._number = 0
        self._began: float | None = None
        self._stopped = threading.Event()
        self._fault: OSError | None = None

    @property
    def now(self) -> float:
        """Seconds by the robot's clock since the program began with its first skill."""
        return 0.0 if self._began is None else self.robot.clock.now - self._began

    @property
    def trace(self) -> Trace:
        """What the robot has done so far."""
        return tuple(self._events)

    def stop(self) -> None:
        """Have the robot end what it does, and nothing started any more; from any thread, again and again.

        The robot is told before anything else, so that nothing slow can delay it.
        """
        self._stopped.set()
        try:
            self.robot.cancel()
        finally:
            self.robot.clock.stop()

    def sleep_until(self, now: float) -> None:
        """Let time pass by the robot's clock.

        Raises:
            StoppedError: the robot was stopped.
            OSError: that cannot be taken down.
        """
        self._go_on()
        seconds = max(0.0, now - self.now)
        self._note("sleep", seconds=round(seconds, 3))
        self.robot.clock.wait(seconds)
        self._go_on()

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Have the robot execute one skill.

        Raises:
            RobotError: it cannot.
            StoppedError: it was stopped.
            RobotLostError: it is gone, or gives an answer that the skill does not have.
            OSError: what happens cannot be taken down.
        """
        self._go_on()
        row = self.skills[skill]
        event = _event(row, arguments)
        event = event and replace(event, place=self._place, time=self.now)
        if event and event.kind in BEGINS:
            self._events.append(event)
        result = self._taken_down(row, [_text(argument) for argument in arguments], event)
        if event is None:
            return result
        if event.kind in BEGINS:
            self._events.pop()
        self._events.append(replace(event, **_seen(row, result)))
        if event.kind == "goto":
            self._place = event.text
        return _position(result, event) if event.options else result

    def _taken_down(self, skill: Skill, given: list[base.Argument], event: Event | None) -> base.Result:
        """The robot's answer or its error, each taken down."""
        self._number += 1
        which = {"number": self._number, "skill": skill.name}
        named = dict(zip((p.name for p in skill.parameters), given, strict=True))
        self._note("skill", **which, arguments=named)
        started = self.now
        try:
            result = self._done(skill, given)
            if event is not None and event.options:
                _position(result, event)
        except RobotError as error:
            self._note("error", **which, kind=error.kind, message=str(error))
            self._go_on()
            raise
        except CancelledError:
            self._note("cancelled", **which, seconds=round(self.now - started, 3))
            self._go_on()
            raise RobotLostError("somebody else stopped the robot") from None
        self._note("late" if self._stopped.is_set() else "result", **which, result=result)
        self._go_on()
        return result

    def _done(self, skill: Skill, given: list[base.Argument]) -> base.Result:
        which = {"number": self._number, "skill": skill.name}

        def told(what: str | Picture) -> None:
            try:
                if isinstance(what, Picture):
                    self._note("picture", **which, picture=what.data)
                else:
                    self._note("feedback", **which, text=what)
            except OSError as error:  # on a thread of the robot's, where nobody would see it
                self._fault = error
                self.stop()

        if skill.recording and skill.recording.options and () in given:
            raise RobotError("AskEmptyOptions", f'the question "{given[-2]}" offers no options')
        return answered(skill, self.robot.perform(skill.name, given, told))

    def _go_on(self) -> None:
        """Let the program go on, unless it is to end."""
        if self._began is None:
            self._began = self.robot.clock.now
        if self._fault is not None:
            raise self._fault
        if self._stopped.is_set():
            raise StoppedError


def answered(skill: Skill, result: base.Result) -> base.Result:
    """What a robot answers to a skill, if it can be an answer to it.

    Raises:
        RobotLostError: it cannot.
    """
    is_one = isinstance(result, RETURNS.get(skill.returns, object))
    if not is_one or (isinstance(result, list) and not all(isinstance(text, str) for text in result)):
        raise RobotLostError(f"the robot answers {skill.name} with {result!r:.100}, no {skill.returns}")
    return result


def _text(argument: Argument) -> base.Argument:
    return argument if isinstance(argument, str) else tuple(option.text for option in argument)


def _event(skill: Skill, arguments: Sequence[Argument]) -> Event | None:
    if skill.recording is None:
        return None
    given = dict(zip((p.name for p in skill.parameters), arguments, strict=True))
    text, options = given[skill.recording.text], given.get(skill.recording.options or "", ())
    assert isinstance(text, str)
    assert not isinstance(options, str)
    return Event(skill.recording.kind, text.strip(), options)


def _seen(skill: Skill, result: base.Result) -> dict[str, Any]:
    """What the robot's answer adds to an event."""
    if isinstance(result, bool):
        return {"found": result}
    return {"answer": result} if skill.recording and skill.recording.options else {}


def _position(result: base.Result, event: Event) -> int:
    """Which option was chosen; a robot that hears people may write it in other letters.

    Raises:
        RobotError: none of them.
    """
    heard = str(result)
    for same in (str, lambda text: text.strip().casefold()):
        for number, option in enumerate(event.options):
            if same(option.text) == same(heard):
                return number
    offered = ", ".join(option.text for option in event.options)
    raise RobotError(
        "AskInvalidOptions", f'the answer "{heard}" to "{event.text}" is none of the options ({offered})'
    )
