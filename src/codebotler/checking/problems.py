"""What a check finds: `Check`, with its problems and the samples that show them."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome, outcome_data
from codebotler.core.words import brief, counted, listed
from codebotler.simulator.fact_sampler import Draw, FactSampler
from codebotler.simulator.sampled_robot import RoomMap, SampledFact


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
        """All of it in one sentence, for a person or a model."""
        line = "" if self.line is None else f"line {self.line}: "
        where = f", where {self.where}" if self.where else ""
        return f"{line}{self.kind}: {self.message}{where}"


@dataclass(frozen=True)
class Sample:
    """One run in a sampled world."""

    number: int  # of the world, from 0
    outcome: Outcome
    facts: tuple[SampledFact, ...] = field(default=(), repr=False)  # about the world, in the order of the run
    draws: tuple[Draw, ...] = field(default=(), repr=False)  # that settled them, in order
    in_vain: bool = False  # it waited or searched in vain, so that its end says little
    is_chosen: bool = False  # the world was no random one, but chosen for a fact that had not been met

    def is_as_in(self, sampler: FactSampler) -> bool:
        """Whether a run in another world would meet the same facts, and so be the same."""
        return all(draw.holds_in(sampler) for draw in self.draws)

    @property
    def drawn(self) -> tuple[str, ...]:
        """The facts that chance settled, in words."""
        return tuple(dict.fromkeys(fact.sentence for fact in self.facts if fact.is_random))

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
        room_map: the rooms that the worlds have in common.
        seed: from which the worlds were drawn.
        strict: whether all facts were drawn.
    """

    problems: tuple[Problem, ...]
    samples: tuple[Sample, ...]
    room_map: RoomMap
    seed: int = 0
    strict: bool = False

    def __repr__(self) -> str:
        return f"Check({counted(len(self.problems), 'problem')}, {counted(len(self.samples), 'sample')})"

    @property
    def rooms(self) -> tuple[str, ...]:
        """The rooms, in the order in which the robot knew them."""
        return self.room_map.rooms

    @property
    def rooms_are_guessed(self) -> bool:
        """Whether the rooms were taken from the program itself."""
        return self.room_map.guessed

    @property
    def showing(self) -> frozenset[int]:
        """The numbers of samples that show the problems: for each the first that ends so, if one does."""
        ends = {
            sample.outcome.line: sample.number for sample in reversed(self.samples) if sample.outcome.error
        }
        first = (
            problem.samples[0] if problem.samples else ends.get(problem.line) for problem in self.problems
        )
        return frozenset(number for number in first if number is not None)

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
            "start": self.room_map.start,
            "rooms_are_guessed": self.rooms_are_guessed,
            "seed": self.seed,
            "strict": self.strict,
            "samples": [
                {
                    "sample": sample.number,
                    "world": [{"fact": f.sentence, "drawn": f.is_random} for f in sample.facts],
                    "in_vain": sample.in_vain,
                    **outcome_data(sample.outcome, skills),
                }
                for sample in self.samples
            ],
        }


def no_room(request: str, room_map: RoomMap) -> str:
    """The message for an unknown room, with the closest match."""
    name = brief(request)
    return f'there is no room "{name}"{closest_room(name, room_map.rooms)}'


def closest_room(name: str, rooms: Sequence[str]) -> str:
    """A clause that names the room with the closest name; empty if none is close."""
    closest = difflib.get_close_matches(name.lower(), rooms, n=1)
    return f'; the closest is "{closest[0]}"' if closest else ""
