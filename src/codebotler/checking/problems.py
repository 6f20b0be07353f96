"""What a check finds: problems, the runs that show them, and what is special about their worlds."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.trace import Outcome, Status
from codebotler.core.tracefile import outcome_data
from codebotler.core.words import counted, listed
from codebotler.simulator.fact_sampler import Draw, FactSampler
from codebotler.simulator.isolated_process import PROCESSOR_TIME
from codebotler.simulator.sampled_robot import Fact, RoomMap, brief

MOST_FACTS = 4


@dataclass(frozen=True)
class Problem:
    """Something for which a program is rejected.

    Args:
        kind: of the failure, such as `GoToInvalidLocation` or `NameError`.
        message: what is wrong, in a plain sentence.
        line: where, counted from 1; None where no line is to blame.
        where: what is special about the worlds in which it arises, in words; empty where it always does.
        samples: the numbers of these worlds; none where the text of the program alone shows it.
    """

    kind: str
    message: str
    line: int | None = None
    where: str = ""
    samples: tuple[int, ...] = ()

    @property
    def sentence(self) -> str:
        """All of it, as one says it to a person or to a model."""
        line = "" if self.line is None else f"line {self.line}: "
        where = f", where {self.where}" if self.where else ""
        return f"{line}{self.kind}: {self.message}{where}"


@dataclass(frozen=True)
class Sample:
    """One run in an imagined world.

    Args:
        number: of the world, from 0.
        outcome: how the run ended.
        facts: what was settled about the world while it ran, in that order.
        draws: of the lots by which that was settled, in order.
        in_vain: whether the robot waited or searched in vain, so that the end says little of the program.
    """

    number: int
    outcome: Outcome
    facts: tuple[Fact, ...] = field(default=(), repr=False)
    draws: tuple[Draw, ...] = field(default=(), repr=False)
    in_vain: bool = False

    def is_as_in(self, lot: FactSampler) -> bool:
        """Whether the same run in another world would meet the same facts, and so be the same."""
        return all(draw.is_drawn_by(lot) for draw in self.draws)

    @property
    def only_computed(self) -> bool:
        """Whether it used up its processor time; that costs seconds, and is no waiting."""
        error = self.outcome.error
        return self.in_vain and error is not None and error.message.endswith(PROCESSOR_TIME)

    @property
    def lots(self) -> tuple[str, ...]:
        """What chance settled, in words."""
        return tuple(dict.fromkeys(fact.sentence for fact in self.facts if fact.by_lot))

    @property
    def world(self) -> str:
        """The world, in words."""
        return listed(list(dict.fromkeys(fact.sentence for fact in self.facts)))


@dataclass(frozen=True)
class Check:
    """What a check found.

    Args:
        problems: by line; the program is rejected if there is one.
        samples: the runs; none of a program that does not parse.
        plan: the rooms that the worlds have in common.
        seed: from which the worlds were drawn.
        strict: whether all facts were drawn.
    """

    problems: tuple[Problem, ...]
    samples: tuple[Sample, ...]
    plan: RoomMap
    seed: int = 0
    strict: bool = False

    def __repr__(self) -> str:
        return f"Check({counted(len(self.problems), 'problem')}, {counted(len(self.samples), 'sample')})"

    @property
    def rooms(self) -> tuple[str, ...]:
        """The rooms, in the order in which the robot knew them."""
        return self.plan.rooms

    @property
    def rooms_are_guessed(self) -> bool:
        """Whether the rooms were taken from the program itself."""
        return self.plan.guessed

    def data(self, skills: SkillTable = SKILLS) -> dict[str, Any]:
        """All of it as plain data; equal checks give equal data.

        Args:
            skills: those with which it was checked.
        """
        return {
            "accepted": not self.problems,
            "problems": [
                {
                    **{name: getattr(problem, name) for name in ("kind", "message", "line", "where")},
                    "samples": list(problem.samples),
                    "sentence": problem.sentence,
                }
                for problem in self.problems
            ],
            "rooms": list(self.rooms),
            "start": self.plan.start,
            "rooms_are_guessed": self.rooms_are_guessed,
            "seed": self.seed,
            "strict": self.strict,
            "samples": [
                {
                    "sample": sample.number,
                    "world": [{"fact": f.sentence, "drawn": f.by_lot} for f in sample.facts],
                    "in_vain": sample.in_vain,
                    **outcome_data(sample.outcome, skills),
                }
                for sample in self.samples
            ],
        }


def no_room(request: str, plan: RoomMap) -> str:
    """That a room does not exist, in a sentence that names the closest one."""
    name = brief(request)
    closest = difflib.get_close_matches(name.lower(), plan.rooms, n=1)
    hint = f'; the closest is "{closest[0]}"' if closest else ""
    return f'there is no room "{name}"{hint}'


def failures(ran: Sequence[Sample], plan: RoomMap) -> Iterator[Problem]:
    """What the runs show: one problem for the runs that ended at the same line in the same way."""
    in_vain = all(sample.in_vain for sample in ran)
    groups: dict[tuple[int | None, str], list[Sample]] = {}
    for sample in ran:
        outcome = sample.outcome
        if outcome.error is not None and (in_vain or not sample.in_vain):
            line = None if outcome.status is Status.TIMEOUT else outcome.line  # any of those where it waits
            groups.setdefault((line, outcome.error.kind), []).append(sample)
    for (_, kind), same in groups.items():
        numbers = tuple(sample.number for sample in same)
        yield Problem(kind, _message(same, ran, plan), same[0].outcome.line, _where(same, ran), numbers)


def _message(same: Sequence[Sample], ran: Sequence[Sample], plan: RoomMap) -> str:
    """What the first of some runs says at its end."""
    first = same[0].outcome
    assert first.error is not None
    if first.status is Status.TIMEOUT:
        all_or_some = "each" if len(same) == len(ran) else str(len(same))
        often = f"in {all_or_some} of {len(ran)} imagined worlds " if same[0].draws else ""
        return f"the program never ends: {often}it reached a limit, {first.error.message}"
    if first.error.kind == "GoToInvalidLocation" and first.trace and first.trace[-1].kind == "goto":
        return no_room(first.trace[-1].text, plan)
    return first.error.message


def _where(same: Sequence[Sample], ran: Sequence[Sample]) -> str:
    """What some runs have in common that the others have not."""
    others = [sample for sample in ran if sample not in same]
    shared = [fact for fact in same[0].lots if all(fact in sample.lots for sample in same)]
    telling = [fact for fact in shared if not others or not all(fact in other.lots for other in others)]
    facts = telling or list(same[0].lots if others else ())
    left = len(facts) - MOST_FACTS
    return listed([*([f"{left} more such facts hold"] if left > 0 else []), *facts[-MOST_FACTS:]])
