"""Rewards for training: how much of its task a program does, as a number from 0 to 1."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import chain
from os import PathLike
from statistics import fmean
from typing import Generic, TypeVar

from codebotler.core.errors import UserError, expect_list
from codebotler.core.trace import Outcome
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import CALLS_PER_THREAD, MAX_BATCH_KEYS, shared_pool
from roboeval.evaluation.judge import are_met, is_met, may_satisfy, robot_in
from roboeval.evaluation.runs.completions import unknown
from roboeval.suites.load import Scenario, Suite, load_suite

Judged = TypeVar("Judged")
ERRED = 0.5  # the part of what a run did before an error that counts: it had better returned there

REMEMBERED = 100_000  # rewards; a policy that learns writes the same program again and again


def reward(
    task: str,
    prompt: int,
    programs: Sequence[str],
    *,
    worlds: int | None = None,
    seed: int | None = None,
    suite: Suite | str | PathLike[str] = "paper",
) -> list[float]:
    """The reward of each program: 1 exactly if it passes, 0 if it does nothing.

    In each world, requirements that hold before the robot has moved (such as "never say it in the lobby")
    are worth nothing by themselves: the share of the others that are satisfied counts, times the share of
    these that are still satisfied at the end. A run that ends in an error counts half. The reward is the mean
    over the worlds; it depends on nothing but the arguments.

    The processes that run programs stay until the end of this one. May be called from many threads, and in a
    forked process, which gets processes of its own.

    Args:
        task: its name.
        prompt: for which phrasing the programs were written, counted from 0; all have the same worlds, and
            most requirements.
        programs: their sources, which need not even parse; equal ones are judged once.
        worlds: how many worlds to draw, 1 to 10,000, for a suite whose worlds are drawn.
        seed: from which to draw them.
        suite: a suite, or the name or folder of one.

    Raises:
        UserError: there is no such suite, task or prompt, its worlds are written by hand or too many, or
            a program is no text.
        EngineError: no isolated process could be started.
    """
    expect_list(programs, "the programs")
    chosen = suite if isinstance(suite, Suite) else load_suite(suite)
    if worlds is not None or seed is not None:
        chosen = chosen.with_worlds(worlds, seed)
    if (problem := unknown((task, prompt, 0), chosen)) is not None:
        raise UserError(problem)
    return REWARDS.of(chosen, task, first_alike(chosen, task, prompt), programs)


@dataclass(frozen=True)
class Share:
    """How much a program did in one world."""

    gained: float | None  # of the requirements that did not hold at the start; None without any
    kept: float  # of the others, halved by an error

    @classmethod
    def of(cls, outcome: Outcome, scenario: Scenario, at_start: Sequence[bool]) -> Share:
        """The share of a run in a world, of whose requirements some were met at the start."""
        gained: list[bool] = []
        kept: list[bool] = []
        for is_now, was_met in zip(are_met(outcome, scenario), at_start, strict=True):
            (kept if was_met else gained).append(is_now)
        whole = 1.0 if may_satisfy(outcome, scenario) else ERRED
        return cls(fmean(gained) if gained else None, whole * (fmean(kept) if kept else 1.0))


@lru_cache(maxsize=160)  # prompts of a suite, twice
def first_alike(suite: Suite, task: str, prompt: int) -> int:
    """The first prompt that asks for the same as a prompt."""
    scenarios = suite.tasks[task].scenarios
    asked = [[scenario.asked_by(number) for scenario in scenarios] for number in range(prompt + 1)]
    return asked.index(asked[prompt])


@lru_cache(maxsize=160)
def asked_in(suite: Suite, task: str, prompt: int) -> list[tuple[Scenario, list[bool]]]:
    """What a prompt asks for in each world, and whether that is met before the robot has done anything."""
    asked = [scenario.asked_by(prompt) for scenario in suite.tasks[task].scenarios]
    return [(scenario, [is_met(one, ()) for one in scenario.require]) for scenario in asked]


def total(shares: Sequence[Share]) -> float:
    """The reward for what a program did in all worlds of its task.

    A world in which there is nothing to gain counts as much as was gained in the others; if there is nothing
    to gain in any, doing nothing is right.
    """
    earned = [share.gained * share.kept for share in shares if share.gained is not None]
    elsewhere = fmean(earned) if earned else 1.0
    return fmean([*earned, *(share.kept * elsewhere for share in shares if share.gained is None)])


class Remembered(Generic[Judged]):
    """What was judged, by a name for each, so that nothing is judged twice; what is old is forgotten."""

    def __init__(self) -> None:
        self._known: OrderedDict[bytes, Judged] = OrderedDict()
        self._lock = threading.Lock()
        release = self._lock.release
        os.register_at_fork(before=self._lock.acquire, after_in_parent=release, after_in_child=release)

    def among(self, names: Iterable[bytes]) -> dict[bytes, Judged]:
        """What is known of these."""
        with self._lock:
            return {name: self._known[name] for name in names if name in self._known}

    def add(self, judged: Mapping[bytes, Judged]) -> None:
        """Remember these, which are new or were asked for again."""
        with self._lock:
            self._known |= judged
            for name in judged:
                self._known.move_to_end(name)
            while len(self._known) > REMEMBERED:
                self._known.popitem(last=False)


class Rewards:
    """The rewards of programs, remembered so that each is judged once."""

    def __init__(self) -> None:
        self._known: Remembered[float] = Remembered()

    def of(self, suite: Suite, task: str, prompt: int, programs: Sequence[str]) -> list[float]:
        """The rewards of programs, in their order."""
        names = [digest(suite.digest, task, str(prompt), program) for program in programs]
        rewards = self._known.among(names)
        new = {name: program for name, program in zip(names, programs, strict=True) if name not in rewards}
        futures: list[Future[list[float]]] = []
        try:
            pool = shared_pool()
            futures.extend(
                pool.submit(judged, suite, task, prompt, batch)
                for batch in batches([*new.values()], pool.workers)
            )
            found = chain.from_iterable(future.result() for future in futures)
            rewards.update(zip(new, found, strict=True))
        finally:  # after an interrupt, nobody waits for the rest
            for future in futures:
                future.cancel()
        self._known.add(rewards)
        return [rewards[name] for name in names]


def batches(programs: Sequence[str], workers: int) -> list[Sequence[str]]:
    """Programs in batches, enough of them that all workers have some."""
    size = max(1, min(MAX_BATCH_KEYS, -(-len(programs) // (CALLS_PER_THREAD * workers))))
    return [programs[start : start + size] for start in range(0, len(programs), size)]


def judged(suite: Suite, task: str, prompt: int, programs: Sequence[str]) -> list[float]:
    """The rewards of programs, in a thread that has a worker."""
    asked = asked_in(suite, task, prompt)
    robots = [partial(robot_in, scenario.world, suite) for scenario, _ in asked]
    ran = shared_pool().here().run_all([(program, robots) for program in programs])
    return [
        total([Share.of(outcome, *one) for outcome, one in zip(outcomes, asked, strict=True)])
        for outcomes in ran
    ]


REWARDS = Rewards()
