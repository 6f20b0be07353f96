"""Judging in several processes of this machine: the same rows, and nothing is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

from codebotler.simulator.pool import NO_SECCOMP
from codebotler.simulator.worker import EngineError, Worker
from command_line import ENVIRONMENT, roboeval
from roboeval.cli import options
from roboeval.evaluation.engines import Local, Work
from roboeval.evaluation.judge import evaluate
from roboeval.evaluation.processes import Processes
from roboeval.evaluation.runs.completions import recorded_completions
from roboeval.suites.load import load_suite


def test_the_rows_are_those_of_threads() -> None:
    suite = load_suite()
    completions = list(recorded_completions("recorded:hasty", suite))
    in_threads = list(evaluate(completions, suite, engine=Local(2)))
    assert list(evaluate(completions, suite, engine=Processes(3))) == in_threads


# Called by name in other processes, which can import this module.


def pids(_: Worker, works: Sequence[Work]) -> list[int]:
    return [os.getpid()] * len(works)


def sleeps(_: Worker, works: Sequence[Work]) -> list[int]:
    if works[0][1] != "0":
        time.sleep(60)
    return pids(_, works)


def dies(_: Worker, works: Sequence[Work]) -> list[int]:
    os.kill(os.getpid(), signal.SIGKILL)
    return [0] * len(works)


def unfiltered(worker: Worker, works: Sequence[Work]) -> list[str]:
    worker.has_seccomp = False
    return [program for _, program in works]


def numbered(count: int) -> list[Work]:
    return [("", str(number)) for number in range(count)]


def has_ended(pid: int) -> bool:
    """Whether a process is gone, or will be in a moment."""
    for _ in range(100):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def test_processes_end_with_the_results() -> None:
    found = set(Processes(2).map_distinct(pids, numbered(100), abs))
    assert found
    assert os.getpid() not in found
    assert all(map(has_ended, found))


def test_nobody_waits_for_what_is_no_longer_wanted() -> None:
    results = Processes(2).map_distinct(sleeps, numbered(100), abs)
    pid = next(results)
    began = time.monotonic()
    results.close()  # type: ignore[attr-defined]  # it is a generator
    assert has_ended(pid)
    assert time.monotonic() - began < 30


def test_a_lost_process_is_one_sentence() -> None:
    with pytest.raises(EngineError, match="was lost"):
        list(Processes(2).map_distinct(dies, numbered(3), abs))


def test_missing_isolation_is_warned_of_once(caplog: pytest.LogCaptureFixture) -> None:
    with Processes(2) as engine:
        assert list(engine.map_distinct(unfiltered, numbered(40), str)) == [str(n) for n in range(40)]
    assert caplog.messages == [NO_SECCOMP]


def test_processes_end_with_the_one_that_started_them(tmp_path: Path) -> None:
    (tmp_path / "killed.py").write_text(
        dedent("""
        from test_processes import numbered, sleeps
        from roboeval.evaluation.processes import Processes

        if __name__ == "__main__":
            results = Processes(2).map_distinct(sleeps, numbered(100), abs)
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


def test_many_programs_are_judged_in_processes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("codebotler.simulator.pool.cores", lambda: 3)
    monkeypatch.setattr(options, "MANY", 80)
    chosen: list[str] = []

    def noted(engine: type[Local | Processes]) -> None:
        enter = engine.__enter__

        def entered(self: Any) -> Any:  # noqa: ANN401 - of two kinds
            chosen.append(engine.__name__)
            return enter(self)

        monkeypatch.setattr(engine, "__enter__", entered)

    noted(Local)
    noted(Processes)
    for words in (["--tasks", "SayGoodDay", "--workers", "3"], ["--workers", "2"], ["--workers", "3"]):
        told = roboeval("evaluate", "recorded:hasty", *words, cwd=tmp_path)
        assert told.status == 0, told.err
    assert chosen == ["Local", "Local", "Processes"]
