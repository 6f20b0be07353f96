"""Computes rewards for training. A reward, from 0 to 1, measures how much of a task a program does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from os import PathLike
from statistics import fmean
from typing import NamedTuple, TypeAlias

from codebotler.core.errors import VIOLATION, UserError, expect_list
from codebotler.core.trace import Outcome
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.judging.judge import are_met, is_met, may_satisfy, robot_in
from roboeval.evaluation.runs.completions import find_key_fault
from roboeval.suites.load import Scenario, Suite, load_suite

AskedWorlds: TypeAlias = Sequence[tuple[Scenario, Sequence[bool]]]
"""The worlds of a prompt, each with its requirements and whether each of them holds at the start."""

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
        UserError: the suite, task or prompt does not exist, the suite samples no worlds, `worlds` is out of
            range, or a program is not a string.
        EngineError: no isolated process could be started.
    """
    expect_list(programs, "the programs")
    chosen = suite if isinstance(suite, Suite) else load_suite(suite)
    if worlds is not None or seed is not None:
        chosen = chosen.with_worlds(worlds, seed)
    if (problem := find_key_fault((task, prompt, 0), chosen)) is not None:
        raise UserError(problem)
    rules = "" if chosen.house is None else chosen.house.digest

    def asking() -> tuple[Suite, AskedWorlds]:
        return chosen, requirements_of(chosen, task, prompt)

    names = [digest(chosen.digest, rules, task, str(prompt), program) for program in programs]
    works = [RewardWork(name, program, asking) for name, program in zip(names, programs, strict=True)]
    return [one.reward for one in judge_works(works)]


@dataclass(frozen=True)
class Share:
    """The two factors of a program's reward in a world, `gained` and `kept`, which are shares from 0 to 1.

    `gained` covers the requirements not met at the start (None: all were met), and `kept` the others.
    """

    gained: float | None  # satisfied share of the requirements not met at the start, or None
    kept: float  # share of the other requirements still met, halved by an error

    @classmethod
    def of(cls, outcome: Outcome, scenario: Scenario, at_start: Sequence[bool]) -> Share:
        """Compute the shares of a run. `at_start` says which requirements held before the robot moved."""
        gained: list[bool] = []
        kept: list[bool] = []
        for is_now, was_met in zip(are_met(outcome, scenario), at_start, strict=True):
            (kept if was_met else gained).append(is_now)
        whole = 1.0 if may_satisfy(outcome, scenario) else ERROR_FACTOR
        return cls(fmean(gained) if gained else None, whole * (fmean(kept) if kept else 1.0))


@lru_cache(maxsize=160)  # twice the number of prompts in a suite
def requirements_of(suite: Suite, task: str, prompt: int) -> AskedWorlds:
    """Return a prompt's worlds with their requirements, and whether each requirement holds at the start."""
    asked = [scenario.asked_by(prompt) for scenario in suite.tasks[task].scenarios]
    return [(scenario, [is_met(one, ()) for one in scenario.require]) for scenario in asked]


def total(shares: Sequence[Share]) -> float:
    """Compute a program's reward from its shares in all worlds of a task.

    In a world where all requirements hold at the start, the reward is the mean of the other worlds times the
    share still met. If all worlds are like this, a program that does nothing gets the full reward.
    """
    earned = [share.gained * share.kept for share in shares if share.gained is not None]
    elsewhere = fmean(earned) if earned else 1.0
    return fmean([*earned, *(share.kept * elsewhere for share in shares if share.gained is None)])


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


def components_of(outcomes: Sequence[Outcome], asked: AskedWorlds, *, parses: bool = True) -> Components:
    """Compute a program's components from its outcome in each world. `parses`: whether it is valid Python."""
    ran = [(outcome, *one) for outcome, one in zip(outcomes, asked, strict=True)]
    reward = total([Share.of(*one) for one in ran])
    kinds = ["" if outcome.error is None else outcome.error.kind for outcome in outcomes]
    return Components(
        reward=reward,
        passed=float(reward == 1),
        requirements=fmean(fmean(are_met(outcome, scenario) or [True]) for outcome, scenario, _ in ran),
        without_errors=fmean(may_satisfy(outcome, scenario) for outcome, scenario, _ in ran),
        parses=float(parses),
        rules_kept=fmean(kind != VIOLATION for kind in kinds),
    )


class RewardWork(NamedTuple):
    """A program for `judge_works`, with a name that identifies the program and its requirements."""

    name: bytes  # the same for equal programs with equal requirements
    program: str
    asking: Callable[[], tuple[Suite, AskedWorlds]]  # returns what it is judged by, in another thread


REWARD_CACHE: dict[bytes, Components] = {}
"""Components of judged programs, by `RewardWork.name`. Threads need no lock: each operation is atomic."""


def judge_works(works: Sequence[RewardWork], progress: Callable[[int], object] = bool) -> list[Components]:
    """Return the reward and its components for each work, in order. Works with the same name run once.

    Results are kept in `REWARD_CACHE`. `progress` is called with the number of finished distinct programs.
    """
    distinct = {work.name: work for work in works}
    known = {name: found for name in distinct if (found := REWARD_CACHE.get(name)) is not None}
    new = [work for name, work in distinct.items() if name not in known]
    judged = shared_pool().map_distinct(judge_batch, new, name=lambda work: work.name)
    for work, found in zip(new, judged, strict=True):
        known[work.name] = found
        progress(len(known))
    if len(REWARD_CACHE) >= MAX_CACHED_REWARDS:
        REWARD_CACHE.clear()
    REWARD_CACHE.update(known)
    return [known[work.name] for work in works]


def judge_batch(works: Sequence[RewardWork]) -> list[Components]:
    """Run programs with this thread's worker of the shared pool, and compute the components of each."""
    worker = shared_pool().here()
    asked = [work.asking() for work in works]
    jobs = [
        (work.program, [partial(robot_in, scenario.world, suite) for scenario, _ in worlds])
        for work, (suite, worlds) in zip(works, asked, strict=True)
    ]
    judged = []
    for (program, robots), outcomes, (_, worlds) in zip(jobs, worker.run_all(jobs), asked, strict=True):
        has_run = any(outcome.trace or outcome.error is None for outcome in outcomes)
        parses = has_run or worker.compiles(program, robots[0]())
        judged.append(components_of(outcomes, worlds, parses=parses))
    return judged
