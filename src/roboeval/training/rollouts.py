"""Judges rollouts of a policy: the reward of each program, and the parts that it comes from."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from itertools import islice
from statistics import fmean
from typing import TypeAlias

from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Outcome
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import AHEAD, shared_pool
from roboeval.evaluation.judge import are_met, may_satisfy, robot_in
from roboeval.evaluation.rewards import Remembered, Share, asked_in, total
from roboeval.suites.families.tasks import WORLDS, trained_task
from roboeval.suites.house import HouseRules
from roboeval.suites.task import Scenario

TOGETHER = 16  # programs for the same task that are run together


@dataclass(frozen=True)
class Rollout:
    """A program that a policy wrote for a prompt of `load_prompts`.

    Args:
        family: of the task.
        seed: of the task.
        prompt_index: which phrasing, counted from 0.
        program: its source, which need not even parse.
    """

    family: str
    seed: int
    prompt_index: int
    program: str


@dataclass(frozen=True)
class Components:
    """What a program did, in parts from 0 to 1.

    Args:
        reward: as of `roboeval.reward`: 1 exactly if the program passes, 0 if it does nothing.
        passed: 1 if all requirements hold in all worlds.
        requirements: the share of the requirements that hold, the mean over worlds; some hold if nothing is
            done, so that this part alone is no reward.
        without_errors: the share of the worlds in which the program ends by itself.
        parses: 1 if it is Python.
        rules_kept: the share of the worlds in which it breaks no rule of the house.
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
    worlds: int = WORLDS,
    house: HouseRules | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Components]:
    """Judge programs of a policy, each in the worlds of its task.

    Only a few batches are under way at a time, however many rollouts there are.

    Args:
        rollouts: the programs; equal ones are judged once.
        worlds: how many a task has at least, 1 to 10,000.
        house: rules that no program may break; one that does is stopped there.
        progress: called with the number of distinct rollouts that are judged, each time that it has grown.

    Raises:
        UserError: there is no such family or prompt.
        EngineError: the engine failed; no program is to blame for that.
    """
    names = {one: _name(one, worlds, house) for one in rollouts}
    known = KNOWN.among(names.values())
    groups: dict[tuple[str, int, int], list[Rollout]] = {}
    for one, name in names.items():
        if name not in known:
            groups.setdefault((one.family, one.seed, one.prompt_index), []).append(one)
    for batch, found in _under_way(_batches(groups.values()), partial(_judged, worlds, house)):
        known.update(zip((names[one] for one in batch), found, strict=True))
        if progress is not None:
            progress(len(known))
    KNOWN.add(known)
    return [known[names[one]] for one in rollouts]


KNOWN: Remembered[Components] = Remembered()


def _name(one: Rollout, worlds: int, house: HouseRules | None) -> bytes:
    """What a rollout is remembered by."""
    rules = "" if house is None else house.digest
    return digest(one.family, f"{one.seed} {one.prompt_index} {worlds}", rules, one.program)


Batch: TypeAlias = Sequence[Rollout]


def _batches(groups: Iterable[Batch]) -> Iterator[Batch]:
    for group in groups:
        for start in range(0, len(group), TOGETHER):
            yield group[start : start + TOGETHER]


def _under_way(
    batches: Iterator[Batch], judged: Callable[[Batch], list[Components]]
) -> Iterator[tuple[Batch, list[Components]]]:
    """Each batch with what is found of it, in order, with as many under way as keep all workers busy."""
    pool = shared_pool()
    waiting: deque[tuple[Batch, Future[list[Components]]]] = deque()
    try:
        while True:
            for batch in islice(batches, AHEAD * pool.workers - len(waiting)):
                waiting.append((batch, pool.submit(judged, batch)))
            if not waiting:
                return
            batch, future = waiting.popleft()
            yield batch, future.result()
    finally:  # after an interrupt, nobody waits for the rest
        for _, future in waiting:
            future.cancel()


def _judged(worlds: int, house: HouseRules | None, batch: Batch) -> list[Components]:
    """What programs for the same prompt did, in a thread that has a worker."""
    first = batch[0]
    task = trained_task(first.family, first.seed, worlds=worlds)
    task.expect_prompt(first.prompt_index)
    suite = task.suite.with_house_rules(house)
    asked = asked_in(task.suite, task.name, first.prompt_index)
    robots = [partial(robot_in, scenario.world, suite) for scenario, _ in asked]
    worker = shared_pool().here()
    ran = worker.run_all([(one.program, robots) for one in batch])
    return [
        _components(outcomes, asked, parses=_has_run(outcomes) or worker.compiles(one.program, robots[0]()))
        for one, outcomes in zip(batch, ran, strict=True)
    ]


def _has_run(outcomes: Sequence[Outcome]) -> bool:
    """Whether a program has certainly been executed, so that it is Python."""
    return any(outcome.trace or outcome.error is None for outcome in outcomes)


def _components(
    outcomes: Sequence[Outcome], asked: Sequence[tuple[Scenario, list[bool]]], *, parses: bool
) -> Components:
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
