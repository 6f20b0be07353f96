"""Judging in several local processes: the same rows, and no processes left."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from textwrap import dedent
from types import SimpleNamespace
from typing import Any

import pytest

from codebotler.simulator.pool import NO_SECCOMP
from codebotler.simulator.worker import EngineError, Worker
from command_line import ENVIRONMENT, roboeval
from roboeval.cli import engine_choice
from roboeval.evaluation.engines import engine as engines
from roboeval.evaluation.engines.engine import Local, Work, own_worker
from roboeval.evaluation.engines.processes import Processes
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import load_suite


@pytest.mark.slow
def test_processes_give_the_rows_of_threads() -> None:
    suite = load_suite()
    completions = list(recorded_completions("recorded:hasty", suite))
    in_threads = list(evaluate(completions, suite, engine=Local(2)))
    assert list(evaluate(completions, suite, engine=nullcontext(Processes(3)))) == in_threads


def test_judging_restores_the_thresholds_of_the_garbage_collector() -> None:
    outside = gc.get_threshold()  # An earlier test may have changed it.
    gc.set_threshold(123, 4, 5)
    try:
        with Local(1):
            assert gc.get_threshold() != (123, 4, 5)
        assert gc.get_threshold() == (123, 4, 5)
    finally:
        gc.set_threshold(*outside)


# Other processes import this module and call these functions by name.


def list_pids(_: Worker, works: Sequence[Work]) -> list[int]:
    return [os.getpid()] * len(works)


def sleep_after_first(_: Worker, works: Sequence[Work]) -> list[int]:
    if works[0][1] != "0":
        time.sleep(60)
    return list_pids(_, works)


def kill_worker(_: Worker, works: Sequence[Work]) -> list[int]:
    os.kill(os.getpid(), signal.SIGKILL)
    return [0] * len(works)


def are_alone(worker: Worker, works: Sequence[Work]) -> list[bool]:
    return [worker._one_process_per_run for _ in works]


def make_works(count: int) -> list[Work]:
    return [("", str(number)) for number in range(count)]


def has_ended(pid: int) -> bool:
    """Wait for the end of a process for up to 10 seconds, and return whether it ended."""
    for _ in range(100):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


@pytest.mark.slow
def test_processes_end_with_the_results() -> None:
    found = set(Processes(2).map_distinct(list_pids, make_works(100), abs))
    assert found
    assert os.getpid() not in found
    assert all(map(has_ended, found))


@pytest.mark.slow
def test_closing_the_results_ends_their_processes() -> None:
    results = Processes(2).map_distinct(sleep_after_first, make_works(100), abs)
    pid = next(results)
    began = time.monotonic()
    results.close()  # type: ignore[attr-defined]  # It is a generator.
    assert has_ended(pid)
    assert time.monotonic() - began < 30


@pytest.mark.slow
def test_a_lost_process_is_an_engine_error() -> None:
    with pytest.raises(EngineError, match="worker process died"):
        list(Processes(2).map_distinct(kill_worker, make_works(3), abs))


def kill_worker_at_the_last(worker: Worker, works: Sequence[Work]) -> list[int]:
    if works[-1][1] == "99":
        os.kill(os.getpid(), signal.SIGKILL)
    return list_pids(worker, works)


@pytest.mark.slow
def test_results_before_a_lost_process_are_kept() -> None:
    results = Processes(1).map_distinct(kill_worker_at_the_last, make_works(100), abs)
    assert next(results)
    with pytest.raises(EngineError, match="worker process died"):
        list(results)


@pytest.mark.slow
def test_each_run_can_have_a_process_of_its_own() -> None:
    for alone in (False, True):
        engine = Processes(1, one_process_per_run=alone)
        assert list(engine.map_distinct(are_alone, make_works(3), bool)) == [alone] * 3


def refuse(worker: Worker, works: Sequence[Work]) -> list[int]:
    own_worker.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engines, "Worker", lambda **_: SimpleNamespace(has_seccomp=False, close=lambda: None))
        with pytest.raises(EngineError) as refused:
            own_worker(require_isolation=True)
    return [str(refused.value) == NO_SECCOMP] * len(works) if worker.has_seccomp else []


@pytest.mark.slow
def test_missing_isolation_is_refused() -> None:
    assert list(Processes(1, require_isolation=True).map_distinct(refuse, make_works(1), int)) == [1]


def is_sigint_blocked(_: Worker, works: Sequence[Work]) -> list[bool]:
    return [signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())] * len(works)


@pytest.mark.slow
def test_worker_processes_leave_ctrl_c_to_the_command() -> None:
    assert list(Processes(1).map_distinct(is_sigint_blocked, make_works(1), bool)) == [True]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.slow
def test_processes_end_with_their_parent(tmp_path: Path) -> None:
    (tmp_path / "killed.py").write_text(
        dedent("""
        from test_processes import make_works, sleep_after_first
        from roboeval.evaluation.engines.processes import Processes

        if __name__ == "__main__":
            results = Processes(2).map_distinct(sleep_after_first, make_works(100), abs)
            print(next(results), flush=True)
            next(results)
        """)
    )
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    with subprocess.Popen(
        [sys.executable, "killed.py"],
        cwd=tmp_path,
        env=ENVIRONMENT | {"PYTHONPATH": path},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        process.kill()
    assert has_ended(pid)


@pytest.mark.slow
def test_many_programs_are_judged_in_processes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("codebotler.simulator.pool.cores", lambda: 3)
    monkeypatch.setattr(engine_choice, "MIN_PROGRAMS_FOR_PROCESSES", 20)
    chosen: list[str] = []

    def record_choice(engine: type[Local | Processes]) -> None:
        maps = engine.map_distinct

        def record_and_map(*given: Any) -> Any:  # noqa: ANN401 - the arguments of Engine
            chosen.append(engine.__name__)
            return maps(*given)

        monkeypatch.setattr(engine, "map_distinct", record_and_map)

    record_choice(Local)
    record_choice(Processes)
    few = ["recorded:hasty", "--tasks", "SayGoodDay"]  # 13 programs
    many = ["recorded:hasty", "--tasks", "LunchTime,SayGoodDay"]  # 28 programs
    with monkeypatch.context() as patch:
        patch.setattr("codebotler.simulator.pool.cores", lambda: 2)
        assert roboeval("evaluate", *many, "--workers", "3").status == 0
    for words in ([*few, "--workers", "3"], [*many, "--workers", "2"], [*many, "--workers", "3"]):
        ended = roboeval("evaluate", *words, cwd=tmp_path)
        assert ended.status == 0, ended.err
    assert chosen == ["Local", "Local", "Local", "Processes"]
