"""Find what a program would do again, or forget, that an earlier mission has begun."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from codebotler.checking.problems import CheckResult, Problem, Sample
from codebotler.core.phrases import is_spoken, phrase
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.skills.kinds import PLACE
from codebotler.core.trace import Event, Status, Trace, held_after
from codebotler.core.words import brief
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import polarity
from codebotler.simulator.matching import content_words
from codebotler.simulator.room_map import RoomMap

MIN_EQUAL_WORDS = 2
"""The number of words that two different texts must share, at least, to say the same."""

_PUNCTUATION = re.compile(r"[^\w\s]+")


def hold_to_past(found: CheckResult, begun: str) -> CheckResult:
    """Return a check with a problem for each step that is done already, and for a thing that stays in hand.

    Args:
        found: the check of a program for the rest of a mission; its map contains what was done.
        begun: the program of that mission.
    """
    past, problems = found.room_map.past, list(found.problems)
    for sample in found.samples:
        for event in repeated_steps(sample.outcome.trace, found.room_map):
            message = f"this was done before: {phrase(event, 'past')}"
            if all(problem.message != message for problem in problems):
                problems.append(Problem("RepeatedStep", message, samples=(sample.number,)))
    held = held_after(past)
    finished = [one for one in found.samples if one.outcome.status is Status.FINISHED]
    puts_down = "place" in called_skills(parse_leniently(begun))
    if held and puts_down and finished and all(map(_keeps, finished)):
        message = f'the robot still holds "{brief(held)}" at the end'
        problems.append(Problem("KeepsThing", message, samples=tuple(one.number for one in finished)))
    return replace(found, problems=tuple(problems))


def repeated_steps(trace: Trace, room_map: RoomMap) -> Iterator[Event]:
    """Yield the steps of a trace that have an effect which the past of the map contains already."""
    for event in trace:
        if any(has_same_effect(event, before, room_map) for before in room_map.past):
            yield event


def has_same_effect(one: Event, other: Event, room_map: RoomMap) -> bool:
    """Return whether two steps say or ask the same, or put down the same thing, in the same room."""
    if one.kind != other.kind or not (one.kind == PLACE or is_spoken(one.kind)):
        return False
    if _room(one, room_map) != _room(other, room_map) or (one.to or "").strip() != (other.to or "").strip():
        return False
    return _words(one.text) == _words(other.text) or (one.kind != PLACE and _says_same(one.text, other.text))


def _room(event: Event, room_map: RoomMap) -> str:
    room = room_map.room(event.place)
    return (event.place if room is None else room).casefold()


def _says_same(one: str, other: str) -> bool:
    """Return whether two texts differ only in words that one of them adds."""
    if _numbers(one) != _numbers(other) or polarity(one) is not polarity(other):
        return False
    shorter, longer = sorted((set(_words(one)), set(_words(other))), key=len)
    return len(shorter) >= MIN_EQUAL_WORDS and shorter <= longer


def _words(text: str) -> list[str]:
    return content_words(_PUNCTUATION.sub(" ", text))


def _numbers(text: str) -> list[tuple[float, ...]]:
    return [numbers for _, _, numbers in numerals(text)]


def _keeps(sample: Sample) -> bool:
    """Return whether a run ends without putting down what the robot held before it."""
    return all(event.kind != PLACE for event in sample.outcome.trace)
