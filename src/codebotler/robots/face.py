"""A face on any number of screens, on which a robot speaks and asks questions."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Recording, Skill, SkillTable
from codebotler.core.words import counted
from codebotler.core.world import Point
from codebotler.robots.base import (
    AnswerError,
    CancelledError,
    Feedback,
    Robot,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.clock import Clock

ANSWER_SECONDS = 60.0  # real seconds for an answer by default
ASK_TIMEOUT = "AskTimeout"  # the kind of the error
MAX_SENTENCES = 3
MIN_SPEECH, MAX_SPEECH, CHARACTERS_PER_SECOND = 1.0, 10.0, 20.0  # the duration of speech, in robot seconds


@dataclass(frozen=True)
class FaceSentence:
    """A sentence of the robot; sentences and questions share their numbers, from 1."""

    number: int
    text: str


@dataclass(frozen=True)
class FaceQuestion:
    """A question of the robot; an answer refers to its number."""

    number: int
    person: str
    text: str
    options: tuple[str, ...]
    until: float = math.inf  # the deadline by the monotonic clock
    how: str = ""  # the question ended: answered, withdrawn or unanswered
    answer: int | None = None  # the position of the chosen option


@dataclass(frozen=True)
class FaceState:
    """The contents of all screens: the last sentences, the open question, and the previous question."""

    said: tuple[FaceSentence, ...] = ()
    question: FaceQuestion | None = None
    ended: FaceQuestion | None = None


class Face:
    """The robot's sentences and questions; thread-safe, and only `ask` blocks.

    Args:
        seconds: the real seconds for an answer.

    Attributes:
        changed: called after each change.
    """

    def __init__(self, seconds: float = ANSWER_SECONDS) -> None:
        self.changed: Callable[[], None] = lambda: None
        self.shown = FaceState()
        self.screens = 0
        self._seconds = seconds
        self._lock = threading.Condition()
        self._number = 0
        self._is_open = False

    @contextmanager
    def count_screen(self) -> Iterator[None]:
        """Count a screen as open inside the context."""
        self._add_screens(1)
        try:
            yield
        finally:
            self._add_screens(-1)

    def open(self) -> None:
        """Clear the face for a new mission."""
        with self._lock:
            self._is_open = True
            self._show(FaceState())

    def withdraw(self) -> None:
        """Withdraw the question, and refuse to say or ask anything until the next `open`."""
        with self._lock:
            self._is_open = False
            self._end("withdrawn")

    def say(self, text: str) -> None:
        """Show a sentence; CancelledError if the face is withdrawn."""
        with self._lock:
            said = FaceSentence(self._next(), text)
            self._show(replace(self.shown, said=(*self.shown.said, said)[-MAX_SENTENCES:]))

    def ask(self, person: str, text: str, options: Sequence[str]) -> int:
        """Ask a question, and wait for the position of the chosen option.

        Raises:
            RobotError: nobody answered in time.
            CancelledError: the question was withdrawn.
        """
        with self._lock:
            question = FaceQuestion(
                self._next(), person, text, tuple(options), time.monotonic() + self._seconds
            )
            self._show(replace(self.shown, question=question, ended=None))
            while self.shown.question is question:
                left = question.until - time.monotonic()
                if left <= 0:
                    self._end("unanswered")
                else:
                    self._lock.wait(min(left, threading.TIMEOUT_MAX))
            ended = self.shown.ended
        if ended is None or ended.number != question.number or ended.how == "withdrawn":
            raise CancelledError
        if ended.answer is None:
            raise RobotError(ASK_TIMEOUT, f'nobody answered "{text}" within {self._seconds:g} s')
        return ended.answer

    def answer(self, number: int, option: int) -> None:
        """Answer the question with this number; later answers raise AnswerError."""
        with self._lock:
            question = self.shown.question
            if question is None or question.number != number:
                raise AnswerError(self._too_late(number))
            if not 0 <= option < len(question.options):
                raise AnswerError("that is not one of the options; choose one of them")
            self._end("answered", option)

    def _too_late(self, number: int) -> str:
        ended = self.shown.ended
        if ended is None or ended.number != number:
            return "that question is closed"
        if ended.answer is not None:
            return f'the question was already answered: "{ended.options[ended.answer]}"'
        why = "it was withdrawn" if ended.how == "withdrawn" else "its time is up"
        return f"that question is closed: {why}"

    def _next(self) -> int:
        if not self._is_open:
            raise CancelledError
        self._number += 1
        return self._number

    def _end(self, how: str, answer: int | None = None) -> None:
        question = self.shown.question
        if question is not None:
            self._show(replace(self.shown, question=None, ended=replace(question, how=how, answer=answer)))

    def _show(self, shown: FaceState) -> None:
        self.shown = shown
        self._lock.notify_all()
        self.changed()

    def _add_screens(self, more: int) -> None:
        with self._lock:
            self.screens += more
            self.changed()


def without_speech(skills: SkillTable = SKILLS) -> SkillTable:
    """Return the skills that the robot behind a face must perform itself."""
    return SkillTable(tuple(skill for skill in skills.rows if _speech_of(skill) is None))


def _speech_of(skill: Skill) -> Recording | None:
    """Return the recording of a skill, if the skill is spoken."""
    return skill.recording if skill.recording and skill.recording.is_spoken else None


class RobotWithFace:
    """Speaks and asks on a face, and passes all other skills to another robot."""

    def __init__(self, robot: Robot, face: Face, skills: SkillTable = SKILLS) -> None:
        self._robot, self._face, self.skills = robot, face, skills
        self.name, self.address, self.if_tool_dies = robot.name, robot.address, robot.if_tool_dies
        self.rooms_are_regexes, self.has_pose = robot.rooms_are_regexes, robot.has_pose

    @property
    def missing(self) -> Mapping[str, str]:
        """The reasons why the other robot cannot perform some skills, apart from speech."""
        return {
            skill: why for skill, why in self._robot.missing.items() if _speech_of(self.skills[skill]) is None
        }

    @property
    def clock(self) -> Clock:
        """The clock of the other robot."""
        return self._robot.clock

    def connect(self) -> None:
        """Connect the other robot, and clear the face."""
        self._robot.connect()
        self._face.open()

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Speak, or have the other robot perform the skill."""
        spoken = _speech_of(self.skills[skill])
        if spoken is None:
            return self._robot.perform(skill, arguments, feedback)
        screens = self._face.screens
        feedback(f"shown on {counted(screens, 'face')}" if screens else "no face is open")
        given = dict(
            zip((parameter.name for parameter in self.skills[skill].parameters), arguments, strict=True)
        )
        text = str(given.pop(spoken.text))
        if spoken.options is None:
            self._say(text)
            return None
        offered = given.pop(spoken.options)
        assert isinstance(offered, tuple), "a mission checks the arguments of a program"
        options = tuple(map(str, offered))
        return options[self._face.ask(", ".join(map(str, given.values())), text, options)]

    @property
    def failed_stop(self) -> str:
        """The reason why the other robot did not stop; empty if it stopped, or does not report that."""
        return str(getattr(self._robot, "failed_stop", ""))

    def watch(self, on_pose: Callable[[Point | None], None]) -> bool:
        """Report the poses of the other robot; return whether it has poses."""
        watch = getattr(self._robot, "watch", None)
        return watch is not None and bool(watch(on_pose))

    def cancel(self) -> None:
        """Withdraw the question, and stop the other robot."""
        try:
            self._face.withdraw()
        finally:
            self._robot.cancel()

    def disconnect(self) -> None:
        """Withdraw the question, and disconnect the other robot."""
        self._face.withdraw()
        self._robot.disconnect()

    def _say(self, text: str) -> None:
        self._face.say(text)
        seconds = min(max(MIN_SPEECH, len(text) / CHARACTERS_PER_SECOND), MAX_SPEECH)
        if not self.clock.wait(seconds):
            raise CancelledError
