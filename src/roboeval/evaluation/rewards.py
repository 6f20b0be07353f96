"""Rewards for training: how much of what a task requires each of many programs does, as a number."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass
from functools import partial
from os import PathLike
from statistics import fmean

from codebotler.arguments import expect_texts
from codebotler.badinput import BadInput
from codebotler.simulator.engine import digest
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.warm import warm
from codebotler.trace import Outcome
from roboeval.evaluation.completions import unknown
from roboeval.evaluation.judge import is_met, may_satisfy
from roboeval.suites.load import Scenario, Suite, load_suite

ERRED = 0.5
"""What is left of a run's share that ends in an error: who errs had better returned at that line."""

KEPT = 100_000  # rewards that are remembered; a policy that learns writes the same program again and again


def reward(
    task: str,
    prompt: int,
    programs: Sequence[str],
    *,
    worlds: int | None = None,
    seed: int | None = None,
    suite: Suite | str | PathLike[str] = "paper",
) -> list[float]:
    """Say of each program how much of its task it does: 1 exactly if it passes, 0 if it does nothing.

    In each world, requirements that hold before the robot has moved (such as "never say it in the lobby")
    are worth nothing by themselves: the share of the others that are satisfied counts, times the share of
    these that are still satisfied at the end. A run that ends in an error counts half. The reward is the mean
    over the worlds; it depends on nothing but the arguments.

    The processes that run programs stay until the end of this one. May be called from many threads, and in a
    forked process, which gets processes of its own.

    Args:
        task: its name.
        prompt: which phrasing the programs were written for, counted from 0; all have the same worlds.
        programs: their sources, which need not even parse; equal ones are judged once.
        worlds: how many worlds to draw, 1 to 10,000, for a suite whose worlds are drawn; as many as it says
            by default.
        seed: from which to draw them; that of the suite by default.
        suite: a suite, or the name or folder of one.

    Raises:
        BadInput: there is no such suite, task or prompt, its worlds are written by hand or too many, or
            a program is no text.
        EngineError: no isolated process could be started.
    """
    expect_texts(programs, "the programs")
    chosen = suite if isinstance(suite, Suite) else load_suite(suite)
    if worlds is not None or seed is not None:
        chosen = chosen.with_worlds(worlds, seed)
    if (problem := unknown((task, prompt, 0), chosen)) is not None:
        raise BadInput(problem)
    return REWARDS.of(chosen, task, programs)


@dataclass(frozen=True)
class Share:
    """How a program did in one world.

    Args:
        gained: the share of the requirements that did not hold before it began, and do now; None if there are
            none.
        kept: the share of the others that still hold, halved by an error.
    """

    gained: float | None
    kept: float

    @classmethod
    def of(cls, outcome: Outcome, scenario: Scenario, free: Sequence[bool]) -> Share:
        """Look at a run.

        Args:
            outcome: of the run.
            scenario: its world, with the requirements.
            free: for each requirement, whether it holds before the robot has done anything.
        """
        held = [is_met(requirement, outcome.trace) for requirement in scenario.require]
        gained = [holds for holds, is_free in zip(held, free, strict=True) if not is_free]
        kept = [holds for holds, is_free in zip(held, free, strict=True) if is_free]
        whole = 1.0 if may_satisfy(outcome, scenario) else ERRED
        return cls(fmean(gained) if gained else None, whole * (fmean(kept) if kept else 1.0))


def total(shares: Sequence[Share]) -> float:
    """The reward for what a program did in all worlds of its task.

    Where there is nothing to gain, and a world only asks to let something be, it counts as much as was gained
    in the other worlds; if no world asks for anything to be done, doing nothing is right.
    """
    earned = [share.gained * share.kept for share in shares if share.gained is not None]
    elsewhere = fmean(earned) if earned else 1.0
    return fmean([*earned, *(share.kept * elsewhere for share in shares if share.gained is None)])


class Rewards:
    """Judges programs, equal ones once, and remembers what came of each."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._known: OrderedDict[bytes, float] = OrderedDict()
        self._running: dict[bytes, Future[float]] = {}

    def of(self, suite: Suite, task: str, programs: Sequence[str]) -> list[float]:
        """The rewards of programs, in their order.

        Raises:
            EngineError: a process was lost twice.
        """
        scenarios = suite.tasks[task].scenarios
        free = [[is_met(requirement, ()) for requirement in scenario.require] for scenario in scenarios]

        def judged(program: str) -> float:
            lane = warm().here()
            shares = []
            for scenario, its in zip(scenarios, free, strict=True):
                outcome = lane.run(program, partial(SimulatedRobot, scenario.world, suite.rules))
                shares.append(Share.of(outcome, scenario, its))
            return total(shares)

        names = [digest(suite.digest, task, program) for program in programs]
        asked: list[float | Future[float]] = []
        try:
            asked.extend(self._ask(*each, judged) for each in zip(names, programs, strict=True))
            return [self._told(*each, judged) for each in zip(asked, names, programs, strict=True)]
        except BaseException:  # nobody waits for the rest any more
            for one in asked:
                if isinstance(one, Future):
                    one.cancel()
            raise

    def before_fork(self) -> None:
        """Let nothing change in the meantime."""
        self._lock.acquire()

    def after_fork(self) -> None:
        """Go on, in the process that has forked."""
        self._lock.release()

    def begin_anew(self) -> None:
        """Expect nothing of threads that are not here, in the process that was forked."""
        self._running.clear()
        self._lock.release()

    def _ask(self, name: bytes, program: str, judged: Callable[[str], float]) -> float | Future[float]:
        with self._lock:
            if name in self._known:
                self._known.move_to_end(name)
                return self._known[name]
            if name not in self._running:
                future = self._running[name] = warm().submit(judged, program)
                future.add_done_callback(lambda ended: self._remember(name, ended))
                return future
            return self._running[name]

    def _told(
        self, asked: float | Future[float], name: bytes, program: str, judged: Callable[[str], float]
    ) -> float:
        while isinstance(asked, Future):
            try:
                return asked.result()
            except CancelledError:  # by another thread, which was interrupted
                asked = self._ask(name, program, judged)
        return asked

    def _remember(self, name: bytes, ended: Future[float]) -> None:
        with self._lock:
            self._running.pop(name, None)
            if ended.cancelled() or ended.exception() is not None:
                return
            self._known[name] = ended.result()
            if len(self._known) > KEPT:
                self._known.popitem(last=False)


REWARDS = Rewards()
os.register_at_fork(
    before=REWARDS.before_fork, after_in_parent=REWARDS.after_fork, after_in_child=REWARDS.begin_anew
)
