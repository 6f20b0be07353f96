"""The settings by which a suite simulates programs, and how people choose an option."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from typing import Literal

from codebotler.core.trace import Option
from codebotler.core.world import Answer
from codebotler.simulator.worlds.matching import Matching, finds


@dataclass(frozen=True)
class Limits:
    """The resources that one run may use. A run that exceeds one of them ends with status `timeout`.

    Args:
        seconds: the simulated time, in seconds.
        calls: the number of skill calls, without calls of `time.sleep`.
        ticks: the number of loop iterations and function calls (fuel).
        text: the number of characters of one text that is passed to a skill.
        trace: the number of characters of all texts in a trace.
    """

    seconds: float = 3600.0
    calls: int = 1_000
    ticks: int = 200_000
    text: int = 10_000
    trace: int = 1_000_000


@dataclass(frozen=True)
class SimulationSettings:
    """How a suite simulates its worlds. The defaults are the settings of the paper's suite.

    Args:
        literals: `lowercase` converts a program's string literals before the run, as the paper's authors did.
        matching: how requests refer to the labels of a world; `Matching` explains the values.
        people: the names to which people answer: any, or only their own, words for people and "".
        words_for_people: regexes for words that mean any person.
        words_for_yes: regexes for a yes. If no option matches, the only one that does not mean no is a yes.
        words_for_no: regexes for options that mean no. An option that matches one never means yes.
        events: whether events record the words of the request, or the name of the actual room or thing.
            `as-happened` records no event for a drive to an unknown room.
        limits: the resources that one run may use.
        clock_starts: the time on the program's clock when a run starts.
    """

    literals: Literal["lowercase", "as-written"] = "lowercase"
    matching: Matching = "label-in-request"
    people: Literal["answer-to-any-name", "own-name-or-word"] = "answer-to-any-name"
    words_for_people: tuple[str, ...] = ()
    words_for_yes: tuple[str, ...] = ()
    words_for_no: tuple[str, ...] = ()
    events: Literal["as-requested", "as-happened"] = "as-requested"
    limits: Limits = field(default_factory=Limits)
    clock_starts: datetime = datetime(2024, 1, 1, 12, tzinfo=UTC)


PAPER_SETTINGS = SimulationSettings()
LIVE_LIMITS = Limits(calls=100_000, trace=10_000_000)  # for live robots, where each skill refuels the program


def choose(
    answer: Answer, question: str, options: tuple[Option, ...], settings: SimulationSettings = PAPER_SETTINGS
) -> int | None:
    """Return the position of the option that an answer refers to, or None if there is none.

    A text selects the first option that contains it. Yes and no also match the settings' words for them.
    Any other text means yes if the question contains it, else no. A number counts options from 1, or from the
    end if it is negative. A number out of range selects the last option, or the first if it is negative.
    """
    if isinstance(answer, int):
        return max(0, len(options) + answer) if answer < 0 else min(answer, len(options)) - 1
    direct = _first_saying((answer,), options, settings.matching)
    if direct is None and settings.matching == "longest-name":  # "warm" also means the option "Warmer"
        direct = _first_saying((answer,), options, "label-in-request")
    if direct is not None:
        return direct
    if answer in {"yes", "no"} and settings.words_for_no:
        return _in_other_words(answer, options, settings)
    means = "yes" if finds(question, answer, settings.matching) else "no"
    direct = _first_saying((means,), options, settings.matching)
    return _in_other_words(means, options, settings) if direct is None and settings.words_for_no else direct


def _in_other_words(answer: str, options: tuple[Option, ...], settings: SimulationSettings) -> int | None:
    """Return the option that means yes or no. A single option that does not mean no counts as yes."""
    if answer == "no":
        return _first_saying(settings.words_for_no, options, settings.matching)
    no = ("no", *settings.words_for_no)
    may_be = [n for n, option in enumerate(options) if not _says(option.text, no, settings.matching)]
    meant = [n for n in may_be if _says(options[n].text, settings.words_for_yes, settings.matching)]
    return next(iter(meant), may_be[0] if len(may_be) == 1 else None)


def _first_saying(words: tuple[str, ...], options: tuple[Option, ...], matching: Matching) -> int | None:
    saying = (number for number, option in enumerate(options) if _says(option.text, words, matching))
    return next(saying, None)


@lru_cache(maxsize=65_536)
def _says(text: str, words: tuple[str, ...], matching: Matching) -> bool:
    return any(finds(text, word, matching) for word in words)
