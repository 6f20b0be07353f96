"""Judges a policy's rollouts: computes the reward of each program and its components."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from codebotler.simulator.engine import digest
from roboeval.evaluation.rewards import AskedWorlds, Components, RewardWork, judge_works, requirements_of
from roboeval.suites.families.tasks import TRAINING_WORLDS, trained_task
from roboeval.suites.suite import HouseRules, Suite

__all__ = ["Components", "Rollout", "judge"]


@dataclass(frozen=True)
class Rollout:
    """A program that a policy wrote for a prompt of `load_prompts`."""

    family: str  # the family of the task
    seed: int  # the seed of the task
    prompt_index: int  # the number of the phrasing, from 0
    program: str  # the source text, which need not parse


def judge(
    rollouts: Sequence[Rollout],
    *,
    worlds: int = TRAINING_WORLDS,
    house: HouseRules | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Components]:
    """Return the reward and its components for each program, in order, from the worlds of its task.

    Args:
        rollouts: the programs. Equal programs are judged once.
        worlds: the minimum number of worlds per task, 1 to 10,000.
        house: the house rules. A program that breaks a rule is stopped.
        progress: a function that is called with the number of distinct rollouts judged so far.

    Raises:
        UserError: a family or prompt does not exist, or `worlds` is out of range.
        EngineError: the engine failed, for a reason unrelated to the programs.
    """
    rules = "" if house is None else house.digest
    works = [
        RewardWork(
            digest(one.family, f"{one.seed} {one.prompt_index} {worlds}", rules, one.program),
            one.program,
            partial(_asked, one, worlds, house),
        )
        for one in rollouts
    ]
    return judge_works(works, progress or bool)


def _asked(one: Rollout, worlds: int, house: HouseRules | None) -> tuple[Suite, AskedWorlds]:
    task = trained_task(one.family, one.seed, worlds=worlds)
    task.expect_prompt(one.prompt_index)
    suite = task.suite.with_house_rules(house)
    return suite, requirements_of(task.suite, task.name, one.prompt_index)
