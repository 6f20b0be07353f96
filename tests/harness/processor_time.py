"""The processor time of each test, with that of the processes it starts, and the list of the dearest."""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path

import pytest

LISTED = 10
"""How many of the dearest tests are listed."""

LIMIT = 0.1
"""Processor seconds above which a test is slow."""

TICKS = os.sysconf("SC_CLK_TCK")
ATTRIBUTE = "processor_time"


def used() -> float:
    """Return the processor seconds of this process and of all its descendants so far."""
    while True:
        ended = os.times()[2:4]
        running = sum(used_by(child) for child in _children(os.getpid()))
        if os.times()[2:4] == ended:  # otherwise a child has ended and may be missing from both
            return time.process_time() + sum(ended) + running


def _children(pid: int) -> list[int]:
    """Return the children of all threads of a process, none if it has just ended."""
    while True:
        try:
            threads = list(Path(f"/proc/{pid}/task").iterdir())
        except OSError:
            return []
        try:
            files = [(thread / "children").read_text() for thread in threads]
        except OSError:
            continue  # a thread has ended, and its children now belong to another one
        return [int(child) for file in files for child in file.split()]


def used_by(pid: int) -> float:
    """Return the processor seconds of a child, of those it has waited for, and of its descendants."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / TICKS + sum(map(used_by, _children(pid)))


class ProcessorTime:
    """Measures each test where it runs, and lists the dearest where the results are gathered.

    Tests that share a fixture count it once, for the first of them.

    Args:
        file: gets the seconds of all tests, one line each.
    """

    def __init__(self, file: str | None = None) -> None:
        self.file = file
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.slow: set[str] = set()
        self._phase = 0.0

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(
        self,
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        now = used()
        setattr(report, ATTRIBUTE, max(0.0, now - self._phase))
        self._phase = now
        return report

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logstart(self) -> None:
        self._phase = used()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] += getattr(report, ATTRIBUTE, 0.0)
        if "slow" in report.keywords:
            self.slow.add(report.nodeid)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.file:
            Path(self.file).write_text("".join(f"{seconds:.3f} {test}\n" for seconds, test in self._costs()))
        terminalreporter.section("processor time")
        for line in self.lines():
            terminalreporter.write_line(line)

    def lines(self) -> list[str]:
        """Return the dearest tests, a line each, and how many more should be marked slow."""
        costs = self._costs()
        dear = sum(seconds > LIMIT and test not in self.slow for seconds, test in costs)
        total = sum(self.seconds.values())
        return [
            *(f"{seconds:6.2f} s  {test}" for seconds, test in costs[:LISTED]),
            f"{total:.0f} s in all; {dear} tests above {LIMIT} s are not marked slow",
        ]

    def _costs(self) -> list[tuple[float, str]]:
        return sorted(((seconds, test) for test, seconds in self.seconds.items()), reverse=True)
