"""Run a program in sampled worlds, and group its failures into problems."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from codebotler.checking.problems import Problem, Sample, no_room
from codebotler.core.errors import VIOLATION, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.words import listed
from codebotler.core.trace import Outcome, Status
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.process.errors import PROCESSOR_TIME
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worker import Job, Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import AS_WRITTEN, SampledRobot

DEFAULT_SAMPLES, MAX_SAMPLES = 5, 10_000
EXPLORATION_FACTOR = 2  # worlds added per sample, at most, to try both values of each fact
MAX_EXTRA_WORLDS = 20  # worlds added, at most, while every run waits without success
MAX_SHOWN_FACTS = 4
WORLDS_AT_ONCE = 16


@dataclass(frozen=True)
class CheckSettings:
    """The settings of a check: how many worlds there are, and which skills and house rules apply."""

    samples: int = DEFAULT_SAMPLES  # how many random worlds come first
    seed: int = 0  # gives the same worlds on all machines
    strict: bool = False  # whether to randomize even facts that the program takes for granted
    simulation: SimulationSettings = AS_WRITTEN
    skills: SkillTable = SKILLS
    house_rules: tuple[Rule, ...] = ()  # rules that the program must keep in every world
    is_wanted: Callable[[], bool] = lambda: True  # asked before each run, since a check may take minutes

    def __post_init__(self) -> None:
        if not 1 <= self.samples <= MAX_SAMPLES:
            raise UserError(f"the number of samples must be from 1 to {MAX_SAMPLES:,}, not {self.samples:,}")


class UnwantedCheckError(Exception):
    """Raised before the next run of a check whose result is no longer wanted (see `CheckSettings`)."""


class SampledRuns:
    """Prepares one program's runs in sampled worlds as a job for a worker, and collects their samples."""

    def __init__(
        self, program: str, room_map: RoomMap, samplers: Sequence[FactSampler], settings: CheckSettings
    ) -> None:
        self.program, self.room_map = program, room_map
        self.samplers, self.settings = samplers, settings
        self.robots: dict[int, SampledRobot] = {}
        self.job: Job = program, [partial(self._new_robot, number) for number in range(len(samplers))]

    def samples_on(self, worker: Worker, known: Mapping[int, Outcome]) -> list[Sample]:
        """Return a sample per world, but skip repeated runs. `known` has outcomes by the world's index."""
        ran: list[Sample] = []
        for number, sampler in enumerate(self.samplers):
            if number in known:
                outcome = known[number]
            elif any(one.would_repeat_in(sampler) for one in ran):
                continue
            else:
                outcome = worker.run_alone(self.program, partial(self._new_robot, number))
            robot = self.robots[number]
            facts, draws = tuple(robot.facts), tuple(robot.draws)
            ran.append(Sample(sampler.sample, outcome, facts, draws, _is_in_vain(outcome, robot)))
        return ran

    def new_guard(self) -> RuleGuard | None:
        """Return a guard that enforces the house rules in one run, or None if there are no rules."""
        rules = self.settings.house_rules
        return RuleGuard(rules, self.room_map) if rules else None

    def _new_robot(self, number: int) -> SampledRobot:
        how, sampler, guard = self.settings, self.samplers[number], self.new_guard()
        if not how.is_wanted():
            raise UnwantedCheckError
        robot = SampledRobot(self.room_map, sampler, how.simulation, how.skills, guard=guard)
        self.robots[number] = robot
        return robot


def run_together(worker: Worker, runs: Sequence[SampledRuns]) -> list[list[Sample]]:
    """Run several programs, and return a list of samples for each. Simple programs share a process."""
    known: list[dict[int, Outcome]] = [{} for _ in runs]
    for (number, run), outcome in worker.run_tame([one.job for one in runs]).items():
        known[number][run] = outcome
    return [one.samples_on(worker, outcomes) for one, outcomes in zip(runs, known, strict=True)]


def _is_in_vain(outcome: Outcome, robot: SampledRobot) -> bool:
    if outcome.status is Status.ROBOT_ERROR and outcome.error is not None:
        return any(excuse.startswith(outcome.error.message) for excuse in robot.excuses)
    return outcome.status is Status.TIMEOUT


def run_in_sampled_worlds(
    worker: Worker, program: str, room_map: RoomMap, settings: CheckSettings, known: Sequence[Sample] = ()
) -> list[Sample]:
    """Run a program in random worlds, then in worlds that vary the facts it met, up to a limit.

    More worlds are added while every run waits or searches without success. A run that would repeat
    an earlier one, or one in `known`, is skipped, and its result is copied.
    """
    runs = [*known]  # which differ
    ran: list[Sample] = []
    drew: list[FactSampler] = []  # the samplers of these worlds

    def add(samplers: Sequence[FactSampler]) -> None:
        drew.extend(samplers)
        for start in range(0, len(samplers), WORLDS_AT_ONCE):
            these = samplers[start : start + WORLDS_AT_ONCE]
            new = [s for s in these if not any(one.would_repeat_in(s) for one in runs)]
            job = [SampledRuns(program, room_map, new, settings)] if new else []
            runs.extend(sample for some in run_together(worker, job) for sample in some)
            for sampler in these:
                same = next(one for one in runs if one.would_repeat_in(sampler))
                ran.append(replace(same, number=len(ran), is_chosen=bool(sampler.forced)))

    first = FactSampler(settings.seed, 0, settings.strict)
    add(first_samplers(settings))
    for more in range(MAX_EXTRA_WORLDS):
        if not all(sample.in_vain and sample.draws for sample in ran) or all(map(_only_computed, ran)):
            break
        # A program that waits in several places ends only in a lucky world. A search may need an empty world.
        add([replace(first, sample=len(ran), lucky=more % 2 == 1)])
    most = len(ran) + EXPLORATION_FACTOR * settings.samples
    while len(ran) < most and not all(map(_only_computed, ran)) and (new := unexplored_samplers(ran, drew)):
        add(new[: most - len(ran)])
    return ran


def unexplored_samplers(ran: Sequence[Sample], drew: Sequence[FactSampler]) -> list[FactSampler]:
    """Return samplers of new worlds: each changes one fact of an earlier run to a value that no run met."""
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
    """Return one sampler per random world. A check runs its program in these worlds before any others."""
    return [FactSampler(settings.seed, number, settings.strict) for number in range(settings.samples)]


def _only_computed(sample: Sample) -> bool:
    """Whether a run used up its processor time by computing, not by waiting."""
    error = sample.outcome.error
    return sample.in_vain and error is not None and error.message.endswith(PROCESSOR_TIME)


# --- problems


_NO_ROOM_MESSAGE = re.compile('there is no room "(?P<request>.*)"', re.DOTALL)
"""Matches the simulated robot's message about an unknown room."""


def group_failures(ran: Sequence[Sample], room_map: RoomMap) -> Iterator[Problem]:
    """Yield one problem for each group of runs that failed at the same line with the same error or rule."""
    in_vain = all(sample.in_vain for sample in ran)
    groups: dict[tuple[int | None, str, str], list[Sample]] = {}
    for sample in ran:
        outcome = sample.outcome
        if outcome.error is not None and (in_vain or not sample.in_vain):
            line = None if outcome.status is Status.TIMEOUT else outcome.line  # any line of its loop
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
    found = _NO_ROOM_MESSAGE.fullmatch(first.error.message)
    return no_room(found["request"], room_map) if found else first.error.message


def _where(same: Sequence[Sample], ran: Sequence[Sample]) -> str:
    """Return the facts that only these runs share, comparing only random worlds if there are any."""
    if not all(sample.is_chosen for sample in same):
        same, ran = ([sample for sample in those if not sample.is_chosen] for those in (same, ran))
    others = [sample for sample in ran if sample not in same]
    shared = [fact for fact in same[0].drawn if all(fact in sample.drawn for sample in same)]
    telling = [fact for fact in shared if not others or not all(fact in other.drawn for other in others)]
    facts = telling or list(same[0].drawn if others else ())
    left = len(facts) - MAX_SHOWN_FACTS
    return listed([*([f"{left} more facts like these"] if left > 0 else []), *facts[-MAX_SHOWN_FACTS:]])
