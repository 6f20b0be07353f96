"""Workers that tests share: to start the processes of one costs more than most tests do."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import TypeVar

import pytest

from codebotler.core.trace import Outcome
from codebotler.simulator.ledger import SkillPerformer
from codebotler.simulator.process.fork_server_client import ForkServer
from codebotler.simulator.process.isolated_call import ClosedProcess
from codebotler.simulator.worker import EngineError, Job, NewRobot, Worker

Started = TypeVar("Started")
Ran = TypeVar("Ran")
IDLE: list[SharedWorker] = []
STARTER = [ThreadPoolExecutor(1, "starter")]  # processes of an engine end with the thread that started them


class SharedWorker(Worker):
    """A worker that waits for its next user when it is closed, unless it was stopped during a run."""

    def __init__(self, *, one_process_per_run: bool = False) -> None:
        self.is_running = self.is_leaving = self.was_stopped = False
        super().__init__(one_process_per_run=one_process_per_run)

    def run_tame(self, jobs: Sequence[Job]) -> dict[tuple[int, int], Outcome]:
        """Run the tame ones of some programs."""
        return self._running(lambda: super(SharedWorker, self).run_tame(jobs))

    def run_alone(self, source: str, new_robot: NewRobot) -> Outcome:
        """Run a program in a process of its own."""
        return self._running(lambda: super(SharedWorker, self).run_alone(source, new_robot))

    def run_live(self, source: str, robot: SkillPerformer) -> Outcome:
        """Run a program on a robot."""
        return self._running(lambda: super(SharedWorker, self).run_live(source, robot))

    def _running(self, run: Callable[[], Ran]) -> Ran:
        self._expect_a_user()
        self.is_running = True
        try:
            ran = run()
        except (EngineError, OSError):
            raise
        except Exception:  # the robot's own, after which the program has ended
            self.is_running = False
            raise
        self.is_running = False
        return ran

    def stop(self) -> None:
        """End what is running, if anything is, and with it the worker."""
        self.is_leaving = True
        if self.is_running:
            self.was_stopped = True  # also where the run ends by itself just now
            super().stop()

    def close(self) -> None:
        """Wait for the next user; one that was stopped, or whose last run has failed, ends."""
        if self.is_running or self.was_stopped:
            super().close()
        elif self not in IDLE:
            IDLE.append(self)

    def end(self) -> None:
        """End it."""
        super().close()

    def _fork_server(self, kind: type[ForkServer]) -> ForkServer:
        if kind in self._fork_servers:
            return self._fork_servers[kind]
        return lasting(partial(super()._fork_server, kind))

    def _expect_a_user(self) -> None:
        if self.is_leaving:
            raise EngineError("the engine was stopped")


def worker(*, one_process_per_run: bool = False) -> Worker:
    """One that waits, or else a new one."""
    for found in IDLE:
        if found._one_process_per_run == one_process_per_run:
            IDLE.remove(found)
            found.is_leaving = False
            return found
    return lasting(partial(SharedWorker, one_process_per_run=one_process_per_run))


def lasting(start: Callable[[], Started]) -> Started:
    """Start something on a thread that lasts as long as this process."""
    is_there = threading.current_thread().name.startswith("starter")
    return start() if is_there else STARTER[0].submit(start).result()


@contextmanager
def shared() -> Iterator[None]:
    """Let whoever starts a worker be given one of these, and keep closed processes for all threads."""
    with pytest.MonkeyPatch.context() as patch:
        for user in ("codebotler.simulator.pool", "codebotler.missions.mission"):
            patch.setattr(f"{user}.Worker", worker)
        patch.setattr(
            "codebotler.simulator.process.isolated_call.ClosedProcess",
            lambda module: lasting(partial(ClosedProcess, module)),
        )
        yield


def end_all() -> None:
    """End those that wait."""
    while IDLE:
        IDLE.pop().end()


atexit.register(end_all)


def begin_anew() -> None:
    """Forget those of the process that has forked this one."""
    IDLE.clear()
    STARTER[0] = ThreadPoolExecutor(1, "starter")


os.register_at_fork(after_in_child=begin_anew)
