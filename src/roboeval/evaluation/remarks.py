"""Describes runs that repeated steps until a limit, or whose questions got answers meant for others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from codebotler.core.phrases import phrase
from codebotler.core.trace import Event, Status, Trace
from codebotler.core.words import counted, elide_list, listed
from codebotler.core.world import Answer, Person, World
from codebotler.rtl.regex_words import choices, one_of
from codebotler.rtl.wording import quoted, room_name
from codebotler.simulator.matching import finds
from codebotler.simulator.settings import SimulationSettings, choose

MIN_REPETITIONS = 3  # fewer repetitions are not called a cycle
MAX_CYCLE_STEPS = 100


def remarks_on(
    verdict: Mapping[str, Any], trace: Trace, world: World | None, settings: SimulationSettings | None
) -> list[str]:
    """Return sentences that help to explain a run beyond its failed checks."""
    remarks = []
    if verdict["status"] == Status.TIMEOUT and (cycle := cycle_at_end(trace)) is not None:
        more = " times: " if verdict.get("cut") is None else " times or more: "
        remarks.append(cycle.sentence.replace(" times: ", more, 1))
    if not verdict["satisfied"] and world is not None and settings is not None:
        remarks += misplaced_questions(trace, world, settings)
    return remarks


@dataclass(frozen=True)
class Cycle:
    """A sequence of steps that is repeated at the end of a trace."""

    first: int  # the number of the first step, from 1
    steps: Trace  # the steps of one repetition
    times: int

    @property
    def sentence(self) -> str:
        """Return a sentence that says which steps were repeated, from where on, and how often."""
        those = "" if len(self.steps) == 1 else f"{counted(len(self.steps), 'step')} "
        deeds = ", ".join(elide_list([*(phrase(step, "base") for step in self.steps)]))
        return f"From step {self.first} on, it repeated {those}{self.times:,} times: {deeds}."


def cycle_at_end(trace: Trace) -> Cycle | None:
    """Return the cycle that covers most steps at the end of a trace, or None. Prefer short cycles."""
    numbers: dict[Event, int] = {}
    each = [numbers.setdefault(event, len(numbers)) for event in trace]
    most, found = 0, None
    for length in range(1, min(MAX_CYCLE_STEPS, len(each) // MIN_REPETITIONS) + 1):
        start = len(each) - length
        while start > 0 and each[start - 1] == each[start - 1 + length]:
            start -= 1
        covered = len(each) - start
        if covered >= MIN_REPETITIONS * length and covered > most:
            most, found = covered, Cycle(start + 1, trace[start : start + length], covered // length)
    return found


def misplaced_questions(trace: Trace, world: World, settings: SimulationSettings) -> Iterator[str]:
    """Yield a sentence for each room where a question got an answer meant for another question."""
    for room in world.rooms:
        match room.people:
            case [Person(answers=[_, _, *_], after_looks=0) as person]:
                pass
            case _:  # rows do not record which of several people was asked
                continue
        asked = [
            e for e in trace if e.options and e.place == room.name and not _has_topic(e, person, settings)
        ]
        for number, question in enumerate(asked):
            own = person.answers[min(number, len(person.answers) - 1)]
            others = [answer for answer in person.answers if answer != own]
            if not _fits(own, question, settings) and any(_fits(each, question, settings) for each in others):
                yield _misplaced(room.name, person, number, question)
                break


def _has_topic(question: Event, person: Person, settings: SimulationSettings) -> bool:
    return any(finds(question.text, topic, settings.matching) for topic, _ in person.topics)


def _fits(answer: Answer, question: Event, settings: SimulationSettings) -> bool:
    chosen = choose(answer, question.text, question.options, settings)
    return chosen is not None and (
        isinstance(answer, int) or finds(question.options[chosen].text, answer, settings.matching)
    )


def _misplaced(room: str, person: Person, number: int, question: Event) -> str:
    given = [f"the {_ordinal(n)} gets {_answer(answer)}" for n, answer in enumerate(person.answers, 1)]
    own = _answer(person.answers[min(number, len(person.answers) - 1)])
    return (
        f"In {room_name(room)}, questions are answered in a fixed order: {listed(elide_list(given))}; "
        f"the {_ordinal(number + 1)} was {quoted(question.text)}, and none of its options fits {own}."
    )


def _answer(answer: Answer) -> str:
    if isinstance(answer, int):
        return "the last option" if answer == -1 else f"option {answer}"
    return "the first option" if answer == ".*" else one_of(choices(answer) or ()) or "an answer of its own"


def _ordinal(number: int) -> str:
    ending = "th" if number // 10 % 10 == 1 else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"
