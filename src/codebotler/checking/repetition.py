"""Find steps of an earlier mission that a program would repeat, and a thing that it never puts down."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from codebotler.checking.problems import CheckResult, Problem
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.kinds import PICK, PLACE
from codebotler.core.text.phrases import is_spoken, phrase
from codebotler.core.text.words import brief
from codebotler.core.trace import Event, Outcome, Status, Trace, held_after
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import Polarity, polarity
from codebotler.simulator.worlds.matching import content_words, normalized
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import AGREEING_TEXT

UNBOUNDED_COUNT = 1_000_000
"""Replaces the number of remaining steps of a kind if the program would repeat them without end."""

MAX_COMPARED_PAIRS = 20_000
"""How many pairs of steps, one of the program and one of the mission, are compared; more give `LongPast`."""

EMPTY_WORDS = frozenset(
    {
        *("do", "does", "you", "your", "i", "it", "me", "my", "we", "to", "for", "have", "has", "want"),
        *("like", "would", "could", "can", "will", "please", "what", "which", "this", "not", "no", "be"),
        *("on", "at", "hello", "hi", "hey", "sorry", "so", "just", "one", "how", "many", "much", "number"),
        *("wish", "us"),
    }
)
"""Words of speech that tell nothing about its topic."""

_PUNCTUATION = re.compile(r"[^\w\s]+")


def with_repetition_problems(
    found: CheckResult, begun: str, remaining: Sequence[Outcome] = ()
) -> CheckResult:
    """Return a check with further problems: repeated steps, and a held thing that is never put down.

    Args:
        found: the check of a program for the rest of a mission; `room_map.past` has the steps done so far.
        begun: the first program of the mission.
        remaining: what the first program would still do, in several worlds; empty if that is unknown.
    """
    past, problems, samples = found.room_map.past, list(found.problems), []
    others = len(_distinct(past)) + len(_distinct(event for one in remaining for event in one.trace))
    if others * max((len(one.outcome.trace) for one in found.samples), default=0) > MAX_COMPARED_PAIRS:
        message = "the mission has too many earlier steps; this program cannot be compared with them"
        return replace(found, problems=(*problems, Problem("LongPast", message)))
    for sample in found.samples:
        repeated = (*repeated_steps(sample.outcome.trace, found.room_map, remaining),)
        samples.append(replace(sample, repeated=repeated))
        for event in repeated:
            again = f'{phrase(replace(event, answer=None), "base")} in "{brief(event.place)}"'
            message = f"the robot has done this already and would do it again: {again}"
            if all(problem.message != message for problem in problems):
                problems.append(Problem("RepeatedStep", message, samples=(sample.number,)))
    held = held_after(past)
    finished = [one for one in found.samples if one.outcome.status is Status.FINISHED]
    puts_down = "place" in called_skills(parse_leniently(begun))
    has_placed = any(event.kind == PLACE for one in finished for event in one.outcome.trace)
    if held and puts_down and finished and not has_placed:
        message = f'at the end, the robot still holds "{brief(held)}", which the first program puts down'
        problems.append(Problem("KeepsThing", message, samples=tuple(one.number for one in finished)))
    return replace(found, problems=tuple(problems), samples=tuple(samples))


def repeated_steps(trace: Trace, room_map: RoomMap, remaining: Sequence[Outcome] = ()) -> Iterator[Event]:
    """Yield the steps of a trace that the robot has done already, such as the same question in the same room.

    If no run in `remaining` has as many steps of a kind in a room, steps on the same topic count as well.
    """
    done = _distinct(event for event in room_map.past if not event.failed)
    later = _distinct(event for one in remaining for event in one.trace)
    left: Counter[tuple[str, str]] = Counter()
    for one in remaining:
        counted = Counter(_sort(event, room_map) for event in one.trace)
        left |= Counter(dict.fromkeys(counted, UNBOUNDED_COUNT)) if one.status is Status.TIMEOUT else counted
    is_done = {_key(event): _is_done(event, done, later, room_map) for event in _distinct(trace)}
    counts = Counter(_sort(event, room_map) for event in trace if not is_done.get(_key(event)))
    sorted_done = [(_sort(before, room_map), before) for before in done]
    for event in trace:
        sort = _sort(event, room_map)
        alike = (before for of, before in sorted_done if of == sort)
        is_surplus = bool(remaining) and counts[sort] > left[sort]
        if is_done.get(_key(event)) or (is_surplus and any(is_about_same(event, one) for one in alike)):
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
    return list({_key(one): one for one in events if _has_effect(one.kind)}.values())


def _has_effect(kind: str) -> bool:
    """Return whether a person would notice if a step of a kind were done twice. A drive may be repeated."""
    row = by_event(kind)
    return row is None or is_spoken(kind) or not (row.is_idle or row.is_drive)


def _key(event: Event) -> tuple[str, ...]:
    return event.kind, event.text, event.place, event.to or ""


def _sort(event: Event, room_map: RoomMap) -> tuple[str, str]:
    return event.kind, _room(event, room_map)


def has_same_effect(one: Event, other: Event, room_map: RoomMap) -> bool:
    """Whether two steps say, ask or do the same in the same room. False for looks, drives and pick-ups."""
    if one.kind != other.kind or one.kind == PICK or not _has_effect(one.kind):
        return False
    is_in_same_room = _room(one, room_map) == _room(other, room_map)
    if not is_in_same_room or normalized(one.to or "") != normalized(other.to or ""):
        return False
    is_equal = _words(one.text) == _words(other.text) and one.more == other.more
    return is_equal or (is_spoken(one.kind) and _says_same(one.text, other.text))


def is_about_same(one: Event, other: Event) -> bool:
    """Whether two steps of the same kind have the same topic, such as "Is it ready?" and "Ready yet?"."""
    if not is_spoken(one.kind):
        return _words(one.text) == _words(other.text)
    if not one.options and polarity(one.text) is not polarity(other.text):
        return False  # what was announced is now denied, or the other way round
    topic, other_topic = _topic(one), _topic(other)
    shared, least = len(topic & other_topic), min(len(topic), len(other_topic))
    if 2 * shared >= max(1, least):
        return True
    options, others = ({_sense(text) for text, _ in each.options} for each in (one, other))
    return options == others and (bool(shared) or bool(options - {"yes", "no"}))


def _topic(event: Event) -> set[str]:
    return {word.removesuffix("s") for word in _words(event.text)} - EMPTY_WORDS


def _sense(option: str) -> str:
    """Return `yes` or `no` for options that mean this, and others without case and articles."""
    if AGREEING_TEXT.match(option):
        return "yes"
    return "no" if polarity(option) is Polarity.DENIES else normalized(option)


def _room(event: Event, room_map: RoomMap) -> str:
    room = room_map.room(event.place)
    return (event.place if room is None else room).casefold()


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
