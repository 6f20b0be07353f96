"""The result of a check: the problems of a program and the samples that show them."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, TypeAlias

from codebotler.checking.contracts.file import contract_data
from codebotler.core.errors import VIOLATION
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.words import brief, counted, elide_list, listed
from codebotler.core.trace import Outcome, Trace, outcome_data
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.worlds.fact_sampler import Draw, FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_facts import SampledFact
from codebotler.simulator.worlds.simulated_world import ambiguous

MAX_ASSUMED_FACTS = 4


@dataclass(frozen=True)
class Problem:
    """A reason to reject a program.

    Args:
        kind: the kind of error, such as `GoToInvalidLocation` or `NameError`.
        message: what is wrong, in a plain sentence.
        line: the line of the program, counted from 1; None if no single line is at fault.
        where: the facts that the worlds with the problem share, in words; empty if it occurs in every world.
        samples: the numbers of the worlds with the problem; empty if static analysis found it.
    """

    kind: str
    message: str
    line: int | None = None
    where: str = ""
    samples: tuple[int, ...] = ()

    @property
    def rule(self) -> str:
        """The name of the house rule that the program breaks, or an empty string."""
        return self.message.split('"')[1] if self.kind == VIOLATION else ""

    @property
    def sentence(self) -> str:
        """The problem in one sentence, for a person or a model."""
        line = "" if self.line is None else f"line {self.line}: "
        where = f", where {self.where}" if self.where else ""
        return f"{line}{self.kind}: {self.message}{where}"


RuleVerdict: TypeAlias = Literal["never", "possible", "unknown"]


@dataclass(frozen=True)
class RuleProof:
    """Whether a program can break a house rule, as far as its explored worlds show.

    Args:
        rule: the name of the rule.
        verdict: `never` if the program breaks it in no world with these rooms, `possible` if in some world;
            `unknown` if not all worlds were explored, or if facts may change while the program runs.
        cases: the number of explored worlds.
        sample: the number of the world in which the program breaks it; None if there is none.
        if_skills_fail: whether `never` also holds if skills fail, since the first failure ends the program.
    """

    rule: str
    verdict: RuleVerdict
    cases: int
    sample: int | None = None
    if_skills_fail: bool = True

    @property
    def in_words(self) -> str:
        """The verdict in words, such as "can be broken, as in imagined world 3"."""
        if self.sample is not None:
            return f"can be broken, as in imagined world {self.sample}"
        worlds = counted(self.cases, "world")
        if self.verdict == "never":
            unless = "" if self.if_skills_fail else " unless skills fail"
            return f"cannot be broken{unless}, whatever the program meets ({worlds})"
        return f"was kept in {worlds}, but others are possible"


@dataclass(frozen=True)
class Sample:
    """One run of a program in a sampled world: how it ended, and the facts that it met."""

    number: int  # the number of the world, counted from 0
    outcome: Outcome
    facts: tuple[SampledFact, ...] = field(default=(), repr=False)  # facts that the run discovered
    draws: tuple[Draw, ...] = field(default=(), repr=False)  # the draws that decided the facts, in order
    in_vain: bool = False  # whether it waited or searched without success, so that its end says little
    is_chosen: bool = False  # whether the world was chosen to try a fact that no random world had
    repeated: Trace = ()  # the steps that a mission which the program continues has done already

    def would_repeat_in(self, sampler: FactSampler) -> bool:
        """Whether a run in the sampler's world would be the same, since all facts that it met hold there."""
        return all(draw.holds_in(sampler) for draw in self.draws)

    @property
    def drawn(self) -> tuple[str, ...]:
        """The random facts that the run met, one sentence each."""
        return tuple(dict.fromkeys(fact.sentence for fact in self.facts if fact.is_random))

    @property
    def world(self) -> str:
        """All facts that the run met, in words: "Anne is in the lab and ..."."""
        return listed(list(dict.fromkeys(fact.sentence for fact in self.facts)))


@dataclass(frozen=True)
class CheckResult:
    """The result of checking a program.

    Args:
        problems: sorted by line; the program is accepted if there are none.
        samples: the runs; empty if the program does not parse.
        room_map: the rooms of all worlds.
        seed: the seed of the worlds.
        strict: whether all facts were random, even those that the program takes for granted.
        proofs: a verdict on each house rule; empty unless the check explored worlds.
        contract: the limits of what the program may do; None unless the check explored worlds.
    """

    problems: tuple[Problem, ...]
    samples: tuple[Sample, ...]
    room_map: RoomMap
    seed: int = 0
    strict: bool = False
    proofs: tuple[RuleProof, ...] = ()
    contract: Contract | None = None

    def __repr__(self) -> str:
        problems, samples = counted(len(self.problems), "problem"), counted(len(self.samples), "sample")
        return f"CheckResult({problems}, {samples})"

    @property
    def rooms(self) -> tuple[str, ...]:
        """The names of the rooms, in the order in which the robot lists them."""
        return self.room_map.rooms

    @property
    def rooms_are_guessed(self) -> bool:
        """Whether the rooms were guessed from the program, because none were given."""
        return self.room_map.guessed

    @property
    def assumption(self) -> str:
        """A sentence that lists the facts the program takes for granted; empty if there are none."""
        facts = (one.sentence for sample in self.samples for one in sample.facts if not one.is_random)
        found = listed(elide_list([*dict.fromkeys(facts)], MAX_ASSUMED_FACTS))
        return f"The program takes for granted that {found}." if found else ""

    @property
    def vain_runs(self) -> str:
        """A note: "in 2 of 5 worlds, the robot waits or ends without success"; empty if that is a problem."""
        count, total = sum(sample.in_vain for sample in self.samples), len(self.samples)
        is_note = count > 0 and (count < total or not self.problems)
        return f"in {count} of {total} worlds, the robot waits or ends without success" * is_note

    @property
    def evidence(self) -> frozenset[int]:
        """The numbers of the samples that show the problems: for each problem, the first sample with it."""
        failed = [sample for sample in reversed(self.samples) if sample.outcome.error]
        ends = {sample.outcome.line: sample.number for sample in failed}
        first = (
            problem.samples[0] if problem.samples else ends.get(problem.line) for problem in self.problems
        )
        return frozenset(number for number in first if number is not None)

    def data(self, skills: SkillTable = SKILLS) -> dict[str, Any]:
        """Convert the result to a dictionary for JSON. `skills` are those that the program could call."""
        return {
            "accepted": not self.problems,
            "problems": [
                asdict(problem) | {"samples": list(problem.samples), "sentence": problem.sentence}
                for problem in self.problems
            ],
            "rooms": list(self.rooms),
            "start": self.room_map.start,
            "rooms_are_guessed": self.rooms_are_guessed,
            "seed": self.seed,
            "strict": self.strict,
            "contract": None if self.contract is None else contract_data(self.contract),
            "proofs": [asdict(proof) for proof in self.proofs],
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
    """Return why a request means no room or several: `there is no room "hal"; the closest is "hall"`."""
    if len(possible := room_map.possible_rooms(request)) > 1:
        return ambiguous(brief(request), possible)
    name = brief(request)
    return f'there is no room "{name}"{closest_room(name, room_map.goals)}'


def closest_room(name: str, rooms: Sequence[str]) -> str:
    """Return a clause such as `; the closest is "hall"`, or an empty string if no room has a similar name."""
    closest = difflib.get_close_matches(name.lower(), rooms, n=1)
    return f'; the closest is "{closest[0]}"' if closest else ""
