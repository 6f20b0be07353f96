"""A face: what a robot says and asks where people can see it, and what they answer."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum

from codebotler.robots.base import CancelledError
from codebotler.simulator.robot import RobotError

PATIENCE = 60.0
"""Real seconds that people have for an answer, unless somebody says otherwise."""

SILENCE = "AskTimeout"
"""The kind of the error where nobody answered in time."""

MOST_SAID = 3


@dataclass(frozen=True)
class Said:
    """Something that the robot said.

    Args:
        number: counted from 1, over all that was said and asked.
        text: any text.
    """

    number: int
    text: str


@dataclass(frozen=True)
class Question:
    """Something that the robot asks.

    Args:
        number: counted from 1, over all that was said and asked; who answers names it.
        person: who is meant; any text.
        text: the question; any text.
        options: what can be answered; at least one, any texts.
        until: when it is too late, on a clock that never goes back.
    """

    number: int
    person: str
    text: str
    options: tuple[str, ...]
    until: float = math.inf


class Ending(StrEnum):
    """How a question ended."""

    ANSWERED = "answered"
    WITHDRAWN = "withdrawn"
    UNANSWERED = "unanswered"


@dataclass(frozen=True)
class Ended:
    """A question that is none any more.

    Args:
        question: which it was.
        how: it ended.
        answer: the position of the chosen option, if one was.
    """

    question: Question
    how: Ending
    answer: int | None = None


@dataclass(frozen=True)
class Shown:
    """What all faces show; it never changes.

    Args:
        said: the last things that the robot said in this mission, in order.
        question: what it asks just now.
        ended: the question before.
    """

    said: tuple[Said, ...] = ()
    question: Question | None = None
    ended: Ended | None = None


class AnswerError(Exception):
    """An answer that cannot be taken.

    Args:
        sentence: why, for whoever gave it.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


def unchanged() -> None:
    """Tell nobody."""


class Face:
    """Holds what is said and asked, for any number of screens, which all show the same.

    All methods are for any thread. All but `ask` are back at once.

    Args:
        seconds: real ones that people have for an answer, above 0.
    """

    def __init__(self, seconds: float = PATIENCE) -> None:
        self.changed: Callable[[], None] = unchanged
        self.shown = Shown()
        self._seconds = seconds
        self._lock = threading.Condition()  # held for moments, and let go while an answer is waited for
        self._number = 0
        self._screens = 0
        self._is_open = False

    @property
    def screens(self) -> int:
        """How many show it just now."""
        return self._screens

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Be one of those that show it."""
        self._add_screens(1)
        try:
            yield
        finally:
            self._add_screens(-1)

    def open(self) -> None:
        """Let it be spoken with, and forget what was said before."""
        with self._lock:
            self._is_open = True
            self._show(Shown())

    def withdraw(self) -> None:
        """Take back what is asked, and say and ask nothing more before the next `open`."""
        with self._lock:
            self._is_open = False
            self._end(Ending.WITHDRAWN)

    def say(self, text: str) -> None:
        """Show a text.

        Raises:
            CancelledError: it was withdrawn.
        """
        with self._lock:
            said = Said(self._next(), text)
            self._show(replace(self.shown, said=(*self.shown.said, said)[-MOST_SAID:]))

    def ask(self, person: str, text: str, options: Sequence[str]) -> int:
        """Ask, and wait for the answer.

        Args:
            person: who is meant.
            text: the question.
            options: what can be answered; at least one.

        Returns:
            the position of the chosen option.

        Raises:
            RobotError: nobody answered in time.
            CancelledError: it was withdrawn.
        """
        with self._lock:
            question = Question(self._next(), person, text, tuple(options), time.monotonic() + self._seconds)
            self._show(replace(self.shown, question=question, ended=None))
            while self.shown.question is question:
                left = question.until - time.monotonic()
                if left <= 0:
                    self._end(Ending.UNANSWERED)
                else:
                    self._lock.wait(min(left, threading.TIMEOUT_MAX))
            ended = self.shown.ended
        if ended is None or ended.question is not question or ended.how is Ending.WITHDRAWN:
            raise CancelledError
        if ended.answer is None:
            raise RobotError(SILENCE, f'nobody answered "{text}" within {self._seconds:g} s')
        return ended.answer

    def answer(self, number: int, option: int) -> None:
        """Answer a question; the first answer counts.

        Args:
            number: of the question.
            option: the position of the chosen one.

        Raises:
            AnswerError: it is not asked any more, or there is no such option.
        """
        with self._lock:
            question = self.shown.question
            if question is None or question.number != number:
                raise AnswerError(self._too_late(number))
            if not 0 <= option < len(question.options):
                raise AnswerError("that is none of the answers to choose from")
            self._end(Ending.ANSWERED, option)

    def _too_late(self, number: int) -> str:
        ended = self.shown.ended
        if ended is None or ended.question.number != number:
            return "that is not asked any more"
        if ended.answer is not None:
            return f'somebody has answered already: "{ended.question.options[ended.answer]}"'
        why = "it was withdrawn" if ended.how is Ending.WITHDRAWN else "its time was over"
        return f"that is not asked any more: {why}"

    def _next(self) -> int:
        if not self._is_open:
            raise CancelledError
        self._number += 1
        return self._number

    def _end(self, how: Ending, answer: int | None = None) -> None:
        question = self.shown.question
        if question is not None:
            self._show(replace(self.shown, question=None, ended=Ended(question, how, answer)))

    def _show(self, shown: Shown) -> None:
        self.shown = shown
        self._lock.notify_all()
        self.changed()

    def _add_screens(self, more: int) -> None:
        with self._lock:
            self._screens += more
            self.changed()
