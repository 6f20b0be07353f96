"""Why what a test asks for has not happened, and what came nearest to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, assert_never

from codebotler.core.words import listed, times
from codebotler.rtl.formula import ActAtFirst, ActAtSome, AtLeast, Count, Exists, Stay
from codebotler.rtl.phrases import is_any, missing, room, room_name
from codebotler.rtl.semantics import Inconclusive, at_place, first, first_stay, matches
from codebotler.rtl.window import Window
from codebotler.rtl.wording import did, happened, lacking, pastimes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from codebotler.core.trace import Trace
    from codebotler.rtl.formula import EventPattern, Formula, Test
    from codebotler.rtl.wording import Deed

_MOST = 5
_MOST_COMPARED = 50_000
"""Characters among which the nearest text is looked for; in more it is not."""


@dataclass(frozen=True)
class Reason:
    """Why a formula fails.

    Args:
        clause: the smallest part of the formula, or its negation, that makes it fail.
        event: what makes it fail.
        told: what is or is not so.
        detail: what comes nearest to it, or what there is to see, from a colon on.
    """

    clause: Formula
    event: int | None
    told: str
    detail: str = ""


class Absence:
    """Why a test fails: what it asks for has not happened.

    Args:
        test: the test.
        deed: what it asks for, instead of its own element.
        trace: what the robot did.
    """

    def __init__(self, test: Test, deed: Deed, trace: Trace) -> None:
        self.test, self.deed, self.trace = test, deed, trace
        self.window = Window(test.cuts, trace)
        self.where = self.window.told()

    def explain(self) -> Reason:
        """What is missing, where it was looked for, and what came nearest."""
        match self.test:
            case Exists():
                return self._nowhere()
            case ActAtFirst(place):
                stay = first_stay(self.test.stay, self.trace, self.window.span)
                return self._not_there([*range(*stay)], place, self.test.stay) if stay else self._never_went()
            case ActAtSome(place):
                at = [*at_place(self.test.stay, self.trace, self.window.span)]
                arrived = first(self.test.stay.arrival, self.trace, self.window.span) is not None
                return self._not_there(at, place, self.test.stay) if arrived else self._never_went()
            case Count(_, number):
                return self._miscounted(number, "")
            case AtLeast(_, number):
                return self._miscounted(number, "at least ")
        assert_never(self.test)

    def _nowhere(self) -> Reason:
        if not self.trace:
            return self._because(
                f"the robot did nothing at all, so it never {did(self.deed, 'past', never=True)}"
            )
        event, detail = self.instead(range(*self.window.span))
        never = f"never {did(self.deed, 'past', never=True)}{self.where}"
        return self._because(self._robot() + never, event, detail)

    def _never_went(self) -> Reason:
        assert isinstance(self.test, ActAtFirst | ActAtSome)
        arrival = self.test.stay.arrival
        if not self.trace:
            return self._because(f"the robot did nothing at all, so it {self._never_arrived()}")
        _, detail = Absence(Exists(arrival, self.test.cuts), (arrival,), self.trace).instead(
            range(*self.window.span)
        )
        never = f"{self._never_arrived()}{self.window.told_until()}, where it was to "
        never += did(self.deed, "base")
        return self._because(self.window.told_after() + self._robot() + never, detail=detail)

    def _robot(self) -> str:
        """The subject, after what should have begun the part of the trace but never happened."""
        never = self.window.never_began()
        said_anyway = isinstance(self.test, ActAtFirst | ActAtSome) and never == self._never_arrived()
        needed = never and not self.window.told_after() and not said_anyway
        return f"the robot {never}; it " if needed else "the robot "

    def _never_arrived(self) -> str:
        assert isinstance(self.test, ActAtFirst | ActAtSome)
        return f"never {did((self.test.stay.arrival,), 'past', never=True)}"

    def _not_there(self, stay: list[int], place: str, moves: Stay) -> Reason:
        span = self.window.span
        arrivals = [at for at in range(*span) if matches(moves.arrival, self.trace, at)]
        inside = set(stay)
        outside = [at for at in arrivals if at not in inside]
        if isinstance(self.test, ActAtFirst):
            there = "there" if len(outside) == 1 else "during that stay"
            went = f"went to {room_name(self.trace[arrivals[0]].text)} at step {arrivals[0] + 1}"
        else:
            there = "there"
            went = f"went to {room(place)} at {steps_of(outside)}"
        event, detail = self.instead(stay)
        if not detail:
            only = pastimes(self.trace[at] for at in stay)
            detail = f": it only {only}" if only else ": it did nothing there"
        failed = f"did not {did(self.deed, 'base', never=True)} {there}"
        told = f"{self.window.told_after()}the robot {went} but {failed}{self.window.told_until()}"
        return self._because(told, arrivals[0] if event is None else event, detail)

    def _miscounted(self, number: int, least: str) -> Reason:
        found = [at for at in range(*self.window.span) if seen(self.deed[0], self.trace, at)]
        if not found:
            never = self._nowhere()
            often = "" if number == 1 else f", but it should have {least}{times(number)}"
            return replace(never, told=never.told + often)
        told = f"the robot {did(self.deed, 'past')} {times(len(found))} ({steps_of(found)}){self.where}"
        event = found[number] if len(found) > number else None
        return self._because(f"{told} instead of {least}{times(number)}", event)

    def instead(self, here: Sequence[int]) -> tuple[int | None, str]:
        """The nearest thing that the robot did: elsewhere, or here in other words."""
        done = _done_at(self.deed, self.trace)
        if done:
            return done[0], f": it did so only {self._placed(done)}"
        if self.deed[0].kind == "goto":
            return None, self._went(here)
        alike = [at for at in here if self.trace[at].kind == self.deed[0].kind]
        if not alike or sum(len(self.trace[at].text) for at in alike) > _MOST_COMPARED:
            return None, ""
        near = max(alike, key=self._likeness)
        event = self.trace[near]
        return near, f": it {happened(event, 'past')} at step {near + 1}, {lacking(self.deed, event)}"

    def _went(self, here: Sequence[int]) -> str:
        rooms = dict.fromkeys(self.trace[at].text for at in here if self.trace[at].kind == "goto")
        if not rooms:
            told = is_any(self.deed[0].text) or any(event.kind == "goto" for event in self.trace)
            return "" if told else ": it went nowhere"
        names = [room_name(name) for name in rooms]
        shown = names if len(names) <= _MOST else [*names[:_MOST], f"{len(names) - _MOST:,} more"]
        return f": it only went to {listed(shown)}"

    def _placed(self, done: list[int]) -> str:
        at = done[0]
        steps = steps_of(done)
        if at < self.window.span[0] and done[-1] < self.window.span[0]:
            return f"at {steps}, too early"
        if at >= self.window.span[1]:
            return f"at {steps}, too late"
        visit = next((i for i in range(at - 1, -1, -1) if self.trace[i].kind == "goto"), None)
        if len(done) > 1 or self.deed[0].kind == "goto":
            return f"at {steps}"
        if visit is None:
            return f"at {steps}, before going anywhere"
        return f"at {steps}, after {happened(self.trace[visit], 'ing')} at step {visit + 1}"

    def _likeness(self, at: int) -> tuple[int, int]:
        event = self.trace[at]
        return -max(missing(element.text, event.text) for element in self.deed), -at

    def _because(self, told: str, event: int | None = None, detail: str = "") -> Reason:
        return Reason(self.test, event, told, detail)


def seen(element: EventPattern, trace: Trace, at: int) -> bool:
    """Whether an event is of a kind, where that can be judged."""
    try:
        return matches(element, trace, at)
    except Inconclusive:
        return False


def _done_at(deed: Deed, trace: Trace) -> list[int]:
    return [at for at in range(len(trace)) if any(seen(element, trace, at) for element in deed)]


def steps_of(found: list[int]) -> str:
    """Positions in a trace as a reader counts them, such as `steps 1, 2 and 5`."""
    numbers = [str(at + 1) for at in found]
    if len(numbers) > _MOST:
        numbers[_MOST:] = [f"{len(numbers) - _MOST:,} more"]
    return f"step {numbers[0]}" if len(numbers) == 1 else f"steps {listed(numbers)}"
