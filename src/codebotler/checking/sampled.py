"""Runs a program in sampled worlds, and groups its failures into problems."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

from codebotler.checking.problems import Problem, Sample, no_room
from codebotler.core.errors import VIOLATION, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome, Status
from codebotler.core.words import listed
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.process.exit_status import PROCESSOR_TIME
from codebotler.simulator.rule_guard import RuleGuard
from codebotler.simulator.sampled_robot import AS_WRITTEN, RoomMap, SampledRobot
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worker import DO_NOTHING, Job, Meanwhile, Worker

SAMPLES, MOST_SAMPLES = 5, 10_000
EXPLORED = 2  # times as many worlds at most, to meet each fact in every way
MOST_FURTHER_WORLDS = 20  # worlds in addition, where the program waits in vain in all that were drawn before
MOST_FACTS = 4


@dataclass(frozen=True)
class CheckSettings:
    """How programs are checked."""

    samples: int = SAMPLES
    seed: int = 0  # of the worlds: the same ones on every machine
    strict: bool = False  # whether to draw also what the program takes for granted
    simulation: SimulationSettings = AS_WRITTEN
    skills: SkillTable = SKILLS
    house_rules: tuple[Rule, ...] = ()  # what a program must keep to in every world

    def __post_init__(self) -> None:
        if not 1 <= self.samples <= MOST_SAMPLES:
            raise UserError(f"the number of samples must be from 1 to {MOST_SAMPLES:,}, not {self.samples:,}")


class SampledRuns:
    """The runs of one program in some sampled worlds, first as a job for a worker."""

    def __init__(
        self, program: str, room_map: RoomMap, samplers: Sequence[FactSampler], settings: CheckSettings
    ) -> None:
        self.program, self.room_map = program, room_map
        self.samplers, self.settings = samplers, settings
        self._robots: dict[int, SampledRobot] = {}
        self.job: Job = program, [partial(self._new_robot, number) for number in range(len(samplers))]

    def samples_on(self, worker: Worker, known: Mapping[int, Outcome]) -> list[Sample]:
        """What the runs show, of which some are known by number; of worlds that are alike, one may be run."""
        ran: list[Sample] = []
        for number, sampler in enumerate(self.samplers):
            if number in known:
                outcome = known[number]
            elif any(one.is_as_in(sampler) for one in ran):
                continue
            else:
                outcome = worker.run_alone(self.program, partial(self._new_robot, number))
            robot = self._robots[number]
            facts, draws = tuple(robot.facts), tuple(robot.draws)
            ran.append(Sample(sampler.sample, outcome, facts, draws, _is_in_vain(outcome, robot)))
        return ran

    def _new_robot(self, number: int) -> SampledRobot:
        how = self.settings
        guard = RuleGuard(how.house_rules, self.room_map.plan) if how.house_rules else None
        sampler = self.samplers[number]
        robot = SampledRobot(self.room_map, sampler, how.simulation, how.skills, guard=guard)
        self._robots[number] = robot
        return robot


def run_samples(
    worker: Worker,
    program: str,
    room_map: RoomMap,
    samplers: Sequence[FactSampler],
    settings: CheckSettings,
    *,
    meanwhile: Meanwhile = DO_NOTHING,
) -> list[Sample]:
    """Run a program in sampled worlds; of worlds that are alike to it, only the first may be run."""
    if not samplers:
        return []
    runs = SampledRuns(program, room_map, samplers, settings)
    known = worker.run_tame([runs.job], meanwhile)
    return runs.samples_on(worker, {number: outcome for (_, number), outcome in known.items()})


def _is_in_vain(outcome: Outcome, robot: SampledRobot) -> bool:
    if outcome.status is Status.ROBOT_ERROR and outcome.error is not None:
        return any(excuse.startswith(outcome.error.message) for excuse in robot.excuses)
    return outcome.status is Status.TIMEOUT


RunInWorlds: TypeAlias = Callable[[RoomMap, Sequence[FactSampler]], Iterable[Sample]]
"""Runs one program in several worlds, of which it may leave out those that are alike to the program."""


def sampled_runs(run: RunInWorlds, room_map: RoomMap, settings: CheckSettings, width: int) -> list[Sample]:
    """The runs in so many worlds, and in more to meet each fact both ways, or where all search in vain.

    Worlds that are alike to the program need one run only; `run` is called with at most `width` worlds.
    """
    known: list[Sample] = []
    ran: list[Sample] = []
    drew: list[FactSampler] = []  # the worlds of those that ran

    def add(samplers: Sequence[FactSampler]) -> None:
        drew.extend(samplers)
        for start in range(0, len(samplers), width):
            these = samplers[start : start + width]
            known.extend(run(room_map, [s for s in these if not any(one.is_as_in(s) for one in known)]))
            for sampler in these:
                same = next(one for one in known if one.is_as_in(sampler))
                ran.append(replace(same, number=len(ran), is_chosen=bool(sampler.forced)))

    first = FactSampler(settings.seed, 0, settings.strict)
    add(first_samplers(settings))
    for more in range(MOST_FURTHER_WORLDS):
        if not all(sample.in_vain and sample.draws for sample in ran) or all(map(_only_computed, ran)):
            break
        # A program that waits in many places needs luck to end; a search, that not all is full of things.
        add([replace(first, sample=len(ran), lucky=more % 2 == 1)])
    most = len(ran) + EXPLORED * settings.samples
    while len(ran) < most and not all(map(_only_computed, ran)) and (new := unexplored(ran, drew)):
        add(new[: most - len(ran)])
    return ran


def unexplored(ran: Sequence[Sample], drew: Sequence[FactSampler]) -> list[FactSampler]:
    """Worlds that differ from those in which a program ran by one fact, which was never so when it asked."""
    met = {(draw.method, draw.arguments, draw.result) for sample in ran for draw in sample.draws}
    found: list[FactSampler] = []
    for sample, sampler in zip(ran, drew, strict=True):
        for draw in sample.draws:
            for other in draw.alternatives:
                if (other.method, other.arguments, other.result) not in met:
                    met.add((other.method, other.arguments, other.result))
                    found.append(replace(sampler, forced=(*sampler.forced, other)))
    return found


def first_samplers(settings: CheckSettings) -> list[FactSampler]:
    """What draws the facts of the worlds in which a program runs at first."""
    return [FactSampler(settings.seed, number, settings.strict) for number in range(settings.samples)]


def _only_computed(sample: Sample) -> bool:
    """Whether a run used up its processor time, which costs seconds, and is no waiting."""
    error = sample.outcome.error
    return sample.in_vain and error is not None and error.message.endswith(PROCESSOR_TIME)


# --- problems


NO_ROOM = re.compile('there is no room "(?P<request>.*)"', re.DOTALL)
"""The message of a simulated robot that is sent to an unknown room."""


def failures(ran: Sequence[Sample], room_map: RoomMap) -> Iterator[Problem]:
    """One problem for the runs that ended at the same line in the same way, by the same rule if by one."""
    in_vain = all(sample.in_vain for sample in ran)
    groups: dict[tuple[int | None, str, str], list[Sample]] = {}
    for sample in ran:
        outcome = sample.outcome
        if outcome.error is not None and (in_vain or not sample.in_vain):
            line = None if outcome.status is Status.TIMEOUT else outcome.line  # any of those where it waits
            rule = outcome.error.message.split('"')[1] if outcome.error.kind == VIOLATION else ""
            groups.setdefault((line, outcome.error.kind, rule), []).append(sample)
    for (_, kind, _), same in groups.items():
        numbers = tuple(sample.number for sample in same)
        yield Problem(kind, _message(same, ran, room_map), same[0].outcome.line, _where(same, ran), numbers)


def _message(same: Sequence[Sample], ran: Sequence[Sample], room_map: RoomMap) -> str:
    first = same[0].outcome
    assert first.error is not None
    if first.status is Status.TIMEOUT:
        all_or_some = "each" if len(same) == len(ran) else str(len(same))
        often = f"in {all_or_some} of {len(ran)} imagined worlds " if same[0].draws else ""
        return f"the program never ends: {often}it reached a limit, {first.error.message}"
    found = NO_ROOM.fullmatch(first.error.message)
    return no_room(found["request"], room_map) if found else first.error.message


def _where(same: Sequence[Sample], ran: Sequence[Sample]) -> str:
    """What some runs have in common that the others have not; by random worlds, if they show it."""
    if not all(sample.is_chosen for sample in same):
        same, ran = ([sample for sample in those if not sample.is_chosen] for those in (same, ran))
    others = [sample for sample in ran if sample not in same]
    shared = [fact for fact in same[0].drawn if all(fact in sample.drawn for sample in same)]
    telling = [fact for fact in shared if not others or not all(fact in other.drawn for other in others)]
    facts = telling or list(same[0].drawn if others else ())
    left = len(facts) - MOST_FACTS
    return listed([*([f"{left} more facts like these"] if left > 0 else []), *facts[-MOST_FACTS:]])
