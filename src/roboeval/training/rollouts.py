"""Judges a policy's rollouts: computes the reward of each program and its components."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean

from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Outcome
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.judge import are_met, may_satisfy, robot_in, run_in
from roboeval.evaluation.rewards import RewardCache, Share, requirements_of, total
from roboeval.suites.families.tasks import TRAINING_WORLDS, trained_task
from roboeval.suites.house import HouseRules
from roboeval.suites.task import Scenario

ROLLOUTS_PER_BATCH = 16  # programs per batch, all for the same task


@dataclass(frozen=True)
class Rollout:
    """A program that a policy wrote for a prompt of `load_prompts`."""

    family: str  # the family of the task
    seed: int  # the seed of the task
    prompt_index: int  # the number of the phrasing, from 0
    program: str  # the source text, which need not parse


@dataclass(frozen=True)
class Components:
    """The reward of a program and its components, each from 0 to 1.

    Args:
        reward: the value of `roboeval.reward`: 1 if and only if the program passes, 0 if it does nothing.
        passed: 1 if all requirements hold in all worlds.
        requirements: the share of requirements that hold, averaged over worlds. It is not a reward by
            itself, because some requirements hold for a program that does nothing.
        without_errors: the share of worlds where the program ends without an error.
        parses: 1 if the program is valid Python.
        rules_kept: the share of worlds where the program breaks no house rule.
    """

    reward: float
    passed: float
    requirements: float
    without_errors: float
    parses: float
    rules_kept: float


def judge(
    rollouts: Sequence[Rollout],
    *,
    worlds: int = TRAINING_WORLDS,
    house: HouseRules | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Components]:
    """Judge a policy's programs in the worlds of their tasks, a few batches at a time.

    Args:
        rollouts: the programs. Equal programs are judged once.
        worlds: the minimum number of worlds per task, 1 to 10,000.
        house: the house rules. A program that breaks a rule is stopped.
        progress: a function that is called with the number of distinct rollouts judged so far.

    Raises:
        UserError: a family or prompt does not exist.
        EngineError: the engine failed, for a reason unrelated to the programs.
    """
    names = {one: _key(one, worlds, house) for one in rollouts}
    known = COMPONENT_CACHE.among(names.values())
    groups: dict[tuple[str, int, int], list[Rollout]] = {}
    for one, name in names.items():
        if name not in known:
            groups.setdefault((one.family, one.seed, one.prompt_index), []).append(one)
    batches = [
        group[start : start + ROLLOUTS_PER_BATCH]
        for group in groups.values()
        for start in range(0, len(group), ROLLOUTS_PER_BATCH)
    ]
    judged = shared_pool().map_distinct(
        lambda some: [_judge_batch(worlds, house, batch) for batch in some],
        batches,
        name=lambda batch: names[batch[0]],
    )
    for batch, found in zip(batches, judged, strict=True):
        known.update(zip((names[one] for one in batch), found, strict=True))
        if progress is not None:
            progress(len(known))
    COMPONENT_CACHE.add(known)
    return [known[names[one]] for one in rollouts]


COMPONENT_CACHE: RewardCache[Components] = RewardCache()


def _key(one: Rollout, worlds: int, house: HouseRules | None) -> bytes:
    rules = "" if house is None else house.digest
    return digest(one.family, f"{one.seed} {one.prompt_index} {worlds}", rules, one.program)


def _judge_batch(worlds: int, house: HouseRules | None, batch: Sequence[Rollout]) -> list[Components]:
    """Judge programs for one prompt. The calling thread must have a worker."""
    first = batch[0]
    task = trained_task(first.family, first.seed, worlds=worlds)
    task.expect_prompt(first.prompt_index)
    suite = task.suite.with_house_rules(house)
    asked = requirements_of(task.suite, task.name, first.prompt_index)
    worker = shared_pool().here()
    scenarios = [scenario for scenario, _ in asked]
    ran = run_in(worker, [one.program for one in batch], scenarios, suite)
    components = []
    for one, outcomes in zip(batch, ran, strict=True):
        has_run = any(outcome.trace or outcome.error is None for outcome in outcomes)
        parses = has_run or worker.compiles(one.program, robot_in(scenarios[0].world, suite))
        components.append(components_of(outcomes, asked, parses=parses))
    return components


def components_of(
    outcomes: Sequence[Outcome], asked: Sequence[tuple[Scenario, list[bool]]], *, parses: bool = True
) -> Components:
    """Compute the reward and its components from what happened in some worlds.

    Args:
        outcomes: the outcome in each world.
        asked: the requirements in each world, and whether each held at the start.
        parses: whether the program is valid Python.
    """
    ran = [(outcome, *one) for outcome, one in zip(outcomes, asked, strict=True)]
    reward = total([Share.of(*one) for one in ran])
    kinds = ["" if outcome.error is None else outcome.error.kind for outcome in outcomes]
    return Components(
        reward=reward,
        passed=float(reward == 1),
        requirements=fmean(fmean(are_met(outcome, scenario)) for outcome, scenario, _ in ran),
        without_errors=fmean(may_satisfy(outcome, scenario) for outcome, scenario, _ in ran),
        parses=float(parses),
        rules_kept=fmean(kind != VIOLATION for kind in kinds),
    )
