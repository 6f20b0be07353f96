"""Find what a program would do again, or forget, that an earlier mission has begun."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from codebotler.checking.problems import CheckResult, Problem, Sample
from codebotler.core.phrases import is_spoken, phrase
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.skills.kinds import PICK, PLACE
from codebotler.core.trace import Event, Outcome, Status, Trace, held_after
from codebotler.core.words import brief
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import polarity
from codebotler.simulator.matching import content_words
from codebotler.simulator.room_map import RoomMap
from codebotler.simulator.sampled_robot import normalized

UNBOUNDED_COUNT = 1_000_000
"""The number of steps that remain of a kind that a program repeats without end."""

_PUNCTUATION = re.compile(r"[^\w\s]+")


def hold_to_past(found: CheckResult, begun: str, remaining: Sequence[Outcome] = ()) -> CheckResult:
    """Return a check with a problem for each step that is done already, and for a thing that stays in hand.

    A program may wait where the begun one waits: what it waits for was not there, but may come.

    Args:
        found: the check of a program for the rest of a mission; its map contains what was done.
        begun: the program of that mission.
        remaining: what that program would still do, in several worlds; none if that is unknown.
    """
    past, problems = found.room_map.past, list(found.problems)
    if remaining and all(one.status is Status.TIMEOUT for one in remaining):
        problems = [problem for problem in problems if problem.kind != "TimeoutError"]
    for sample in found.samples:
        for event in repeated_steps(sample.outcome.trace, found.room_map, remaining):
            message = f"this was done before: {phrase(event, 'past')}"
            if all(problem.message != message for problem in problems):
                problems.append(Problem("RepeatedStep", message, samples=(sample.number,)))
    held = held_after(past)
    finished = [one for one in found.samples if one.outcome.status is Status.FINISHED]
    puts_down = "place" in called_skills(parse_leniently(begun))
    if held and puts_down and finished and all(map(_keeps, finished)):
        message = f'the robot still holds "{brief(held)}" at the end'
        problems.append(Problem("KeepsThing", message, samples=tuple(one.number for one in finished)))
    return replace(found, problems=tuple(problems), remaining=tuple(remaining))


def repeated_steps(trace: Trace, room_map: RoomMap, remaining: Sequence[Outcome] = ()) -> Iterator[Event]:
    """Yield the steps of a trace that have an effect which the past of the map contains already.

    Where a kind of step was done before, as many may follow as remained to be done.
    """
    done, later = _distinct(room_map.past), _distinct(event for one in remaining for event in one.trace)
    done_sorts = {_sort(event, room_map) for event in done}
    left: Counter[tuple[str, str]] = Counter()
    for one in remaining:
        for sort, count in Counter(_sort(event, room_map) for event in one.trace).items():
            left[sort] = max(left[sort], UNBOUNDED_COUNT if one.status is Status.TIMEOUT else count)
    is_done = {_key(event): _is_done(event, done, later, room_map) for event in _distinct(trace)}
    for event in trace:
        sort = _sort(event, room_map)
        left[sort] -= 1
        if is_done.get(_key(event)) or (remaining and sort in done_sorts and left[sort] < 0):
            yield event


def _is_done(event: Event, done: Sequence[Event], later: Sequence[Event], room_map: RoomMap) -> bool:
    """Return whether a step has the effect of one that was done and does not remain to be done."""
    remains = any(has_same_effect(event, one, room_map) for one in later)
    for before in done:
        if has_same_effect(event, before, room_map):
            says_all = {*_words(before.text)} <= {*_words(event.text)}
            is_repeated = any(has_same_effect(before, one, room_map) for one in later)
            if not is_repeated and (says_all or not remains):
                return True
    return False


def _distinct(events: Iterable[Event]) -> list[Event]:
    """Return the different steps that have an effect."""
    return list(
        {_key(one): one for one in events if one.kind in {PICK, PLACE} or is_spoken(one.kind)}.values()
    )


def _key(event: Event) -> tuple[str, ...]:
    return event.kind, event.text, event.place, event.to or ""


def _sort(event: Event, room_map: RoomMap) -> tuple[str, str]:
    return event.kind, _room(event, room_map)


def has_same_effect(one: Event, other: Event, room_map: RoomMap) -> bool:
    """Return whether two steps say or ask the same, or put down the same thing, in the same room."""
    if one.kind != other.kind or not (one.kind == PLACE or is_spoken(one.kind)):
        return False
    if _room(one, room_map) != _room(other, room_map) or _person(one) != _person(other):
        return False
    return _words(one.text) == _words(other.text) or (one.kind != PLACE and _says_same(one.text, other.text))


def _room(event: Event, room_map: RoomMap) -> str:
    room = room_map.room(event.place)
    return (event.place if room is None else room).casefold()


def _person(event: Event) -> str:
    return normalized(event.to or "")


def _says_same(one: str, other: str) -> bool:
    """Return whether two texts differ only in words and numbers that one of them adds."""
    if polarity(one) is not polarity(other):
        return False
    shorter, longer = sorted((one, other), key=lambda text: len({*_words(text)}))
    words = {*_words(shorter)}
    return bool(words) and words <= {*_words(longer)} and {*_numbers(shorter)} <= {*_numbers(longer)}


def _words(text: str) -> list[str]:
    return content_words(_PUNCTUATION.sub(" ", text))


def _numbers(text: str) -> list[tuple[float, ...]]:
    return [numbers for _, _, numbers in numerals(text)]


def _keeps(sample: Sample) -> bool:
    """Return whether a run ends without putting down what the robot held before it."""
    return all(event.kind != PLACE for event in sample.outcome.trace)
