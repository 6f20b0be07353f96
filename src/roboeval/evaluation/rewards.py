"""Computes rewards for training. A reward, from 0 to 1, measures how much of a task a program does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from os import PathLike
from statistics import fmean
from typing import Generic, TypeVar

from codebotler.core.errors import UserError, expect_list
from codebotler.core.trace import Outcome
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.judge import are_met, is_met, may_satisfy, run_in
from roboeval.evaluation.runs.completions import find_key_fault
from roboeval.suites.load import Scenario, Suite, load_suite

Judged = TypeVar("Judged")
ERROR_FACTOR = 0.5  # factor for a run that ends in an error, so that returning early would earn more

MAX_CACHED_REWARDS = 100_000  # a policy often repeats a program


def reward(
    task: str,
    prompt: int,
    programs: Sequence[str],
    *,
    worlds: int | None = None,
    seed: int | None = None,
    suite: Suite | str | PathLike[str] = "paper",
) -> list[float]:
    """Compute the reward of each program: 1 if and only if it passes, 0 if it does nothing.

    In each world, the reward is the share of requirements that the program satisfies, not counting those
    that hold before the robot moves (such as "never say it in the lobby"). It is multiplied by the share of
    these initial requirements that still hold at the end, and halved if the run ends in an error. The result
    is the mean over all worlds, and depends only on the arguments.

    Worker processes live until this process ends. The function can be called from many threads. Forked
    processes start their own workers.

    Args:
        task: the name of the task.
        prompt: the number of the phrasing that the programs were written for, from 0.
        programs: source texts, which need not parse; equal programs are judged once.
        worlds: the number of worlds, 1 to 10,000, if the suite samples worlds.
        seed: the random seed for sampling worlds.
        suite: a suite, or the name or folder of a suite.

    Raises:
        UserError: the suite, task or prompt does not exist, its worlds are not sampled or are too many,
            or a program is not a string.
        EngineError: no isolated process could be started.
    """
    expect_list(programs, "the programs")
    chosen = suite if isinstance(suite, Suite) else load_suite(suite)
    if worlds is not None or seed is not None:
        chosen = chosen.with_worlds(worlds, seed)
    if (problem := find_key_fault((task, prompt, 0), chosen)) is not None:
        raise UserError(problem)
    return rewards_of(chosen, task, first_equal_prompt(chosen, task, prompt), programs)


@dataclass(frozen=True)
class Share:
    """The share of requirements that a run satisfies in one world."""

    gained: float | None  # satisfied share of the requirements not met at the start, or None
    kept: float  # share of the other requirements still met, halved by an error

    @classmethod
    def of(cls, outcome: Outcome, scenario: Scenario, at_start: Sequence[bool]) -> Share:
        """Compute the share for a run, given which requirements held at the start."""
        gained: list[bool] = []
        kept: list[bool] = []
        for is_now, was_met in zip(are_met(outcome, scenario), at_start, strict=True):
            (kept if was_met else gained).append(is_now)
        whole = 1.0 if may_satisfy(outcome, scenario) else ERROR_FACTOR
        return cls(fmean(gained) if gained else None, whole * (fmean(kept) if kept else 1.0))


@lru_cache(maxsize=160)  # twice the number of prompts in a suite
def first_equal_prompt(suite: Suite, task: str, prompt: int) -> int:
    """Return the number of the first prompt with the same requirements."""
    scenarios = suite.tasks[task].scenarios
    asked = [[scenario.asked_by(number) for scenario in scenarios] for number in range(prompt + 1)]
    return asked.index(asked[prompt])


@lru_cache(maxsize=160)
def requirements_of(suite: Suite, task: str, prompt: int) -> list[tuple[Scenario, list[bool]]]:
    """Return a prompt's requirements in each world, and whether each holds at the start."""
    asked = [scenario.asked_by(prompt) for scenario in suite.tasks[task].scenarios]
    return [(scenario, [is_met(one, ()) for one in scenario.require]) for scenario in asked]


def total(shares: Sequence[Share]) -> float:
    """Compute the reward over all worlds of a task.

    A world with nothing to gain counts like the mean of the others. If no world has anything to gain, a
    program that does nothing gets the full reward.
    """
    earned = [share.gained * share.kept for share in shares if share.gained is not None]
    elsewhere = fmean(earned) if earned else 1.0
    return fmean([*earned, *(share.kept * elsewhere for share in shares if share.gained is None)])


class RewardCache(Generic[Judged]):
    """Caches results by name, so that equal programs are judged once.

    Each operation on the dictionary is atomic, so that threads and forks need no lock.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, Judged] = {}

    def among(self, names: Iterable[bytes]) -> dict[bytes, Judged]:
        """Return the cached results for these names."""
        return {name: found for name in names if (found := self._known.get(name)) is not None}

    def add(self, results: Mapping[bytes, Judged]) -> None:
        """Add results. A full cache is emptied first."""
        if len(self._known) >= MAX_CACHED_REWARDS:
            self._known.clear()
        self._known.update(results)


REWARD_CACHE: RewardCache[float] = RewardCache()


def rewards_of(suite: Suite, task: str, prompt: int, programs: Sequence[str]) -> list[float]:
    """Return the reward of each program, in input order. Equal programs are judged once."""
    names = [digest(suite.digest, task, str(prompt), program) for program in programs]
    rewards = REWARD_CACHE.among(names)
    new = {name: program for name, program in zip(names, programs, strict=True) if name not in rewards}
    judging = partial(judge_programs, suite, task, prompt)
    found = shared_pool().map_distinct(judging, new.values(), name=digest)
    rewards.update(zip(new, found, strict=True))
    REWARD_CACHE.add(rewards)
    return [rewards[name] for name in names]


def judge_programs(suite: Suite, task: str, prompt: int, programs: Sequence[str]) -> list[float]:
    """Compute the rewards of programs. The calling thread must have a worker."""
    asked = requirements_of(suite, task, prompt)
    ran = run_in(shared_pool().here(), programs, [scenario for scenario, _ in asked], suite)
    return [
        total([Share.of(outcome, *one) for outcome, one in zip(outcomes, asked, strict=True)])
        for outcomes in ran
    ]
