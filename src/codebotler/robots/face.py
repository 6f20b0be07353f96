"""The robot's face, which shows its sentences and questions on any number of screens."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Recording, Skill, SkillTable
from codebotler.core.text.words import counted
from codebotler.robots.base import (
    AnswerError,
    CancelledError,
    Feedback,
    Robot,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)

ANSWER_SECONDS = 60.0  # the default time limit for an answer, in real seconds
ASK_TIMEOUT = "AskTimeout"  # the kind of error that programs see when nobody answers
MAX_SENTENCES = 3
MIN_SPEECH, MAX_SPEECH, CHARACTERS_PER_SECOND = 1.0, 10.0, 20.0  # the duration of speech, in robot seconds


@dataclass(frozen=True)
class FaceSentence:
    """A sentence that the robot said. Sentences and questions share one numbering, which starts at 1."""

    number: int
    text: str


@dataclass(frozen=True)
class FaceQuestion:
    """A question that the robot asked, with its number, its options, its deadline and any answer."""

    number: int
    person: str
    text: str
    options: tuple[str, ...]
    until: float = math.inf  # the deadline for an answer, on the monotonic clock
    how: str = ""  # answered, withdrawn or unanswered; empty while the question is open
    answer: int | None = None  # the index of the chosen option; None if there is no answer


@dataclass(frozen=True)
class FaceState:
    """The content of all screens: the last three sentences, the open question and the last closed one."""

    said: tuple[FaceSentence, ...] = ()
    question: FaceQuestion | None = None
    ended: FaceQuestion | None = None


class Face:
    """Keeps the sentences and questions that all screens show. It is thread-safe, and only `ask` blocks.

    Args:
        seconds: the time limit for an answer, in real seconds.

    Attributes:
        changed: a callback that runs after each change.
        shown: what all screens show now.
        screens: the number of open screens.
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
        """Count a screen as open while the `with` block runs."""
        self._add_screens(1)
        try:
            yield
        finally:
            self._add_screens(-1)

    def open(self) -> None:
        """Clear all screens for a new mission, and let the robot speak and ask until `withdraw` is called."""
        with self._lock:
            self._is_open = True
            self._show(FaceState())

    def withdraw(self) -> None:
        """Withdraw the open question, and refuse to say or ask anything until the next `open`."""
        with self._lock:
            self._is_open = False
            self._end("withdrawn")

    def say(self, text: str) -> None:
        """Show a sentence on all screens. Raise CancelledError if the mission has been stopped."""
        with self._lock:
            said = FaceSentence(self._next(), text)
            self._show(replace(self.shown, said=(*self.shown.said, said)[-MAX_SENTENCES:]))

    def ask(self, person: str, text: str, options: Sequence[str]) -> int:
        """Ask a person a question, wait for the answer, and return the index of the chosen option.

        Raises:
            RobotError: nobody answered in time.
            CancelledError: the question was withdrawn, or the mission had already been stopped.
        """
        with self._lock:
            until = time.monotonic() + self._seconds
            question = FaceQuestion(self._next(), person, text, tuple(options), until)
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
        """Answer question `number` with an option's index. Raise AnswerError if it is too late or invalid."""
        with self._lock:
            question = self.shown.question
            if question is None or question.number != number:
                raise AnswerError("the question is closed: it was answered or withdrawn, or the time is up")
            if not 0 <= option < len(question.options):
                raise AnswerError("the answer is not one of the options; choose one from the list")
            self._end("answered", option)

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
    """Return a skill table without its spoken skills, such as `say` and `ask`, which a face can perform."""
    return SkillTable(tuple(skill for skill in skills.rows if _speech_of(skill) is None))


def _speech_of(skill: Skill) -> Recording | None:
    """Return how a skill is recorded if it is a spoken skill, else None."""
    return skill.recording if skill.recording and skill.recording.is_spoken else None


class RobotWithFace:
    """Wraps a robot so that a face performs spoken skills, such as `say`, and the robot all others."""

    def __init__(self, robot: Robot, face: Face, skills: SkillTable = SKILLS) -> None:
        self._robot, self._face, self.skills = robot, face, skills

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the robot
        return getattr(self._robot, name)

    @property
    def missing(self) -> Mapping[str, str]:
        """Maps each skill that the wrapped robot lacks to the reason, without the spoken skills."""
        missing = self._robot.missing.items()
        return {skill: why for skill, why in missing if _speech_of(self.skills[skill]) is None}

    def connect(self) -> None:
        """Connect the wrapped robot and clear the screens."""
        self._robot.connect()
        self._face.open()

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a spoken skill on the face, or pass the skill to the wrapped robot."""
        spoken = _speech_of(self.skills[skill])
        if spoken is None:
            return self._robot.perform(skill, arguments, feedback)
        screens = self._face.screens
        feedback(f"shown on {counted(screens, 'face')}" if screens else "no face is open")
        names = [parameter.name for parameter in self.skills[skill].parameters]
        given = dict(zip(names, arguments, strict=True))
        text = str(given.pop(spoken.text))
        if spoken.options is None:
            self._face.say(text)
            if not self.clock.wait(min(max(MIN_SPEECH, len(text) / CHARACTERS_PER_SECOND), MAX_SPEECH)):
                raise CancelledError
            return None
        offered = given.pop(spoken.options)
        assert isinstance(offered, tuple), "the options of a question are not a tuple"
        options = tuple(map(str, offered))
        return options[self._face.ask(", ".join(map(str, given.values())), text, options)]

    def cancel(self) -> None:
        """Withdraw the open question and stop the wrapped robot."""
        try:
            self._face.withdraw()
        finally:
            self._robot.cancel()

    def disconnect(self) -> None:
        """Withdraw the open question and disconnect the wrapped robot."""
        self._face.withdraw()
        self._robot.disconnect()
