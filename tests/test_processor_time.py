"""Processor time includes that of child processes, and the most expensive tests are listed."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from typing import Literal

import pytest

from processor_time import ProcessorTime, used

BURN = "import time\nwhile time.process_time() < {}: pass\n"


def test_own_time_counts() -> None:
    before = used()
    until = time.process_time() + 0.01
    while time.process_time() < until:
        pass
    assert used() - before >= 0.01


def test_time_of_a_child_counts_while_it_runs_and_after_it_ended() -> None:
    before = used()
    script = BURN.format(0.03) + "print(flush=True)\ninput()\n"
    with subprocess.Popen([sys.executable, "-S", "-c", script], stdin=-1, stdout=-1) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert used() - before >= 0.02
        child.communicate(b"\n")
    assert used() - before >= 0.02


@pytest.mark.slow
def test_time_of_a_child_counts_while_threads_end() -> None:
    script = BURN.format(0.05) + "print(flush=True)\ninput()\n"
    has_ended = threading.Event()

    def start_threads() -> None:
        while not has_ended.is_set():
            threading.Thread(target=int).start()

    before = used()
    with subprocess.Popen([sys.executable, "-S", "-c", script], stdin=-1, stdout=-1) as child:
        assert child.stdout is not None
        child.stdout.readline()
        starter = threading.Thread(target=start_threads)
        starter.start()
        least = min(used() for _ in range(250))
        has_ended.set()
        starter.join()
        child.communicate(b"\n")
    assert least - before >= 0.04


def make_report(name: str, seconds: float, *markers: str) -> pytest.TestReport:
    keywords: dict[str, Literal[1]] = dict.fromkeys(markers, 1)
    made = pytest.TestReport(name, ("", 0, ""), keywords, "passed", None, "call")
    made.processor_time = seconds  # type: ignore[attr-defined]  # like makereport
    return made


def test_lines_list_most_expensive_tests_and_count_unmarked_slow_tests() -> None:
    measured = ProcessorTime()
    for number in range(20):
        measured.pytest_runtest_logreport(make_report(f"t{number:02}", number / 100))
    measured.pytest_runtest_logreport(make_report("setup and call", 0.06))
    measured.pytest_runtest_logreport(make_report("setup and call", 0.06))
    measured.pytest_runtest_logreport(make_report("marked", 5, "slow"))
    first, *others = measured.lines()
    assert first.split() == ["5.00", "s", "marked"]
    assert len(others) == 10
    assert "10 tests" in others[-1]
