"""Reduce a run to what a person would notice. Its wording and the order of its visits do not count."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import lru_cache, reduce
from itertools import groupby
from operator import or_
from typing import NamedTuple, TypeAlias

from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE, SAY
from codebotler.core.trace import Outcome, Status, Trace
from codebotler.rtl.text.clauses import clauses, complete_clauses, sentences
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import Polarity, polarity, without_harmless
from codebotler.rtl.text.times import times_in
from codebotler.simulator.worlds.matching import SOMEBODY, means_person, normalized, whole_words
from codebotler.simulator.worlds.sampled_robot import AGREEING_TEXT

PAPER_KINDS = frozenset({GOTO, SAY, CHECK, ASK, PICK, PLACE})
ENDLESS_RUN = "waits"  # the ending of a run that reached a limit
NO_NAME = re.compile(r"(?!)")  # matches nothing
MAX_NAMES, MAX_NAME_LENGTH = 200, 60
MAX_STATEMENT_TEXTS, MAX_STATEMENT_LENGTH = 100, 4_000  # of a statement, since a program may talk without end
HALF_DAY, ZERO = 12 * 60, (0,)  # minutes, and the time of day that "eggs: 0" might give

Claims: TypeAlias = frozenset[tuple[str, str]]
"""The claims of a statement: `("number", "3")` for "three mugs", `("denies", "mug")` for "no mug"."""


@dataclass(frozen=True)
class Behaviour:
    """The part of a run that a person would notice. Visits, looks, waiting and the wording do not count.

    Args:
        said: for all that is said between two drives, the room and the claims, such as names and numbers.
            Statements without claims, such as greetings, are all alike.
        moved: for each thing picked up or put down, `pick` or `place`, the thing and the room; sorted.
        asked: the room, the options and the person of each question; case and order do not matter. The
            person is empty unless candidates ask different people in this room.
        done: for each call of another skill, its kind of event and its arguments; sorted.
        ending: `waits` if the run reached a limit, or else the kind of its error; empty if it finished.
        room: the room where the robot ended; empty unless the run finished.
    """

    said: frozenset[tuple[str, Claims]] = frozenset()
    moved: tuple[tuple[str, str, str], ...] = ()
    asked: frozenset[tuple[str, tuple[str, ...], str]] = frozenset()
    done: tuple[tuple[str, ...], ...] = ()
    ending: str = ""
    room: str = ""

    def differences(self, other: Behaviour) -> frozenset[str]:
        """Return the names of the fields in which two behaviours differ."""
        names = (one.name for one in fields(self))
        return frozenset(name for name in names if getattr(self, name) != getattr(other, name))


def behaviour_of(
    outcome: Outcome,
    start: str,
    names: re.Pattern[str] = NO_NAME,
    shared_rooms: frozenset[str] = frozenset(),
) -> Behaviour:
    """Return what a person would notice of a run.

    Args:
        outcome: the run.
        start: the room where the robot started.
        names: a regex from `names_in` for the names about which statements may make claims.
        shared_rooms: the rooms in which it matters who is asked, from `rooms_with_several`.
    """
    trace = outcome.trace
    is_done = outcome.status is Status.FINISHED
    error = outcome.status.value if outcome.error is None else outcome.error.kind
    rooms = [one.destination for one in trace if one.kind == GOTO and one.destination is not None]
    return Behaviour(
        said=frozenset((room, claims_of(text, names)) for room, text in statements(trace)),
        moved=tuple(
            sorted((one.kind, normalized(one.text), one.place) for one in trace if one.kind in {PICK, PLACE})
        ),
        asked=frozenset(
            (
                one.place,
                tuple(sorted({_plain(option) for option, _ in one.options})),
                normalized(one.to or "") if one.place in shared_rooms else "",
            )
            for one in trace
            if one.kind == ASK
        ),
        done=tuple(sorted((one.kind, one.text, *one.more) for one in trace if one.kind not in PAPER_KINDS)),
        ending="" if is_done else ENDLESS_RUN if outcome.status is Status.TIMEOUT else error,
        room=[start, *rooms][-1] if is_done else "",
    )


def statements(trace: Trace) -> Iterator[tuple[str, str]]:
    """Yield the room and the text of each statement. All texts between two drives form one statement."""
    spoken = (one for one in trace if one.kind == SAY or (one.kind == GOTO and one.destination != one.place))
    for is_drive, some in groupby(spoken, key=lambda one: one.kind == GOTO):
        if not is_drive:
            said = [*some]
            text = "\n".join(one.text for one in said[:MAX_STATEMENT_TEXTS])
            yield said[0].place, text[:MAX_STATEMENT_LENGTH]


def count_conflicts(traces: Iterable[Trace], homes: Iterable[tuple[str, str]] = ()) -> int:
    """Count contradictions between runs in the same world.

    For example, one run meets a person whom another misses, a person is in several rooms, or a question has
    several answers. `homes` lists more people who are present, as (name, room) pairs.
    """
    seen = {one for trace in traces for one in _encounters(trace)}
    people = {(one.name, one.room) for one in seen if one.is_there and one.is_person} | {*homes}
    rooms = Counter(name for name, _ in people if name != SOMEBODY)
    answers = Counter(said[:2] for said in {(one.room, *one.said) for one in seen if one.said})
    met = {(one.name, one.room) for one in seen if one.is_there} | {(SOMEBODY, room) for _, room in people}
    missed = {(one.name, one.room) for one in seen if not one.is_there}
    return len(met & missed) + sum(count - 1 for count in (*rooms.values(), *answers.values()))


def people_sought(traces: Iterable[Trace]) -> set[tuple[str, str]]:
    """Return the people that runs looked for or asked, as (name, room) pairs."""
    found = (one for trace in traces for one in _encounters(trace))
    return {(one.name, one.room) for one in found if one.is_person and one.name != SOMEBODY}


def count_in_other_rooms(traces: Iterable[Trace]) -> int:
    """Count the people and things that runs in the same world find in different rooms, but each in only one.

    So there may be one charger, where each run takes the first that it finds, but not if a run finds two.
    """
    rooms = [{(one.name, one.room) for one in _encounters(trace) if one.is_there} for trace in traces]
    per_run = [Counter(name for name, _ in found) for found in rooms]
    in_all = Counter(name for name, _ in reduce(or_, rooms))
    return sum(count > 1 and all(one[name] <= 1 for one in per_run) for name, count in in_all.items())


class Encounter(NamedTuple):
    """A person or thing that the robot found in a room, or looked for there without success."""

    name: str
    room: str
    is_there: bool
    is_person: bool
    said: tuple[str, ...]  # a question and its answer, if this person was asked


def _encounters(trace: Trace) -> Iterator[Encounter]:
    """Yield the encounters of a run with people, and with things in rooms where it has put none of them.

    After it has picked up a mug in a room, the next one there is `mug 2`.
    """
    taken, put = Counter[tuple[str, str]](), set[tuple[str, str]]()
    for one in trace:
        name = normalized(one.to or SOMEBODY if one.kind == ASK else one.text)
        is_person = one.kind == ASK or means_person(one.text)
        is_known = one.kind in {CHECK, PICK} or (one.kind == ASK and bool(one.answer))
        at = name, one.place
        if is_known and at not in put and not one.failed:
            said = (_plain(one.text), _plain(one.answer or "")) if one.kind == ASK else ()
            which = f"{name} {taken[at] + 1}" if taken[at] else name
            yield Encounter(which, one.place, one.found is not False, is_person, said)
        taken[at] += one.kind == PICK
        if one.kind == PLACE:
            put.add(at)


def rooms_with_several(traces: Iterable[Trace]) -> frozenset[str]:
    """Return the rooms in which runs ask people with different names."""
    people: dict[str, set[str]] = {}
    for event in (event for trace in traces for event in trace if event.kind == ASK):
        people.setdefault(event.place, set()).update({normalized(event.to or "")} - {SOMEBODY, ""})
    return frozenset(room for room, names in people.items() if len(names) > 1)


def names_in(rooms: Iterable[str], traces: Iterable[Trace]) -> re.Pattern[str]:
    """Return a regex for the names of rooms, and of the people, things and options that runs mention.

    Words such as "anybody", "yes" and "no" are not names.
    """
    found = dict.fromkeys(map(_plain, rooms))
    places = set(found)
    for event in (event for trace in traces for event in trace):
        texts = [event.text] if event.kind != ASK else [event.to or "", *(text for text, _ in event.options)]
        if event.kind in {ASK, CHECK, PICK, PLACE}:
            found.update(dict.fromkeys(map(normalized, texts)))
    names = [one for one in found if _is_name(one)][:MAX_NAMES]
    longest_first = sorted(names, key=len, reverse=True)
    # "The printer rooms" names no room, while "staplers" names a thing.
    regexes = (
        rf"\b{re.escape(one)}\b" if one in places else whole_words(re.escape(one)) for one in longest_first
    )
    return re.compile("|".join(regexes), re.IGNORECASE) if names else NO_NAME


@lru_cache(maxsize=16_384)
def claims_of(text: str, names: re.Pattern[str]) -> Claims:
    """Return a statement's claims: numbers, times of day, and affirmed or denied names (see `Claims`)."""
    found = {_clock_claim(readings[0]) for readings in times_in(text) if readings != ZERO}
    parts = [clause for sentence in sentences(text) for clause in clauses(sentence, lists=True)]
    for clause in complete_clauses(parts):
        found |= _claims_of_clause(clause, names)
    in_times = {("number", part) for kind, time in found if kind == "time" for part in time.split(":")}
    return frozenset(found - in_times)


def _clock_claim(minutes: int) -> tuple[str, str]:
    """Return the claim for a time of day. A full hour is a number, since "at 5" may be both."""
    hour, minute = divmod(minutes % HALF_DAY, 60)
    return ("time", f"{hour or 12}:{minute}") if minute else ("number", str(hour or 12))


def _claims_of_clause(clause: str, names: re.Pattern[str]) -> set[tuple[str, str]]:
    view = polarity(clause)
    claims = {(view.value, _plain(match[0]).removesuffix("s")) for match in names.finditer(clause)}
    rest = without_harmless(names.sub(" it ", clause))
    numbers = {value for _, _, values in numerals(rest) for value in values}
    is_about_nothing = bool(claims) and view is Polarity.DENIES  # "no mug" is a denial, and no number
    claims |= {("number", f"{value:g}") for value in numbers if value or not is_about_nothing}
    if not claims and view is Polarity.DENIES:
        claims.add((view.value, ""))
    return claims


def _is_name(text: str) -> bool:
    is_short = 1 < len(text) <= MAX_NAME_LENGTH
    is_answer = AGREEING_TEXT.match(text) or polarity(text) is Polarity.DENIES
    return is_short and text != SOMEBODY and not is_answer and not text.isdigit()


def _plain(text: str) -> str:
    return " ".join(text.casefold().split())
