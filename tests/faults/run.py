"""Plants the faults of faults.yaml one by one, and prints which tests find each.

Tests are worth the faults that they find. So faults.yaml lists faults that would hurt users, from all
packages. This script plants one at a time in a copy of the project, runs its tests, and prints which of them
failed (the fault is killed) or that none did (it survived). It never changes the working tree.

    .venv/bin/python tests/faults/run.py                            all faults
    .venv/bin/python tests/faults/run.py log-keeps-a-torn-line ...  these
    .venv/bin/python tests/faults/run.py --check                    none: check that all fit the sources
    .venv/bin/python tests/faults/run.py --tests-from DIR           with the tests of another checkout

First the script runs all these tests without a fault: a test that fails then proves nothing. With
--tests-from, tests may have other names in DIR, so they are taken from entries of the same name in its
faults.yaml.

To add a fault, add an entry to faults.yaml: a unique `name`; the `file`; `old`, a string that occurs exactly
once in it, and `new`, its replacement; the `tests` to run, few and cheap: folders, files, or single tests of
slow files; and the harm that a user `suffers`. Choose a mistake that people make and notice, unlike the other
entries. Then run this script with its name. Where code was rewritten and `old` is gone, plant a fault of the
same kind in the new code. Where a fault survives, a test is missing: write it.
"""

from __future__ import annotations

import argparse
import ast
import compileall
import json
import os
import py_compile
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated

import yaml
from pydantic import BaseModel, ConfigDict, Field
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[2]
FAULTS = "tests/faults/faults.yaml"
MIN_KILLED = 57
"""Smallest number of faults that must be killed."""

NO_TESTS = 5
"""Exit status of pytest where it ran no test because all are slow."""

EXTRA_SECONDS, TIME_FACTOR = 60.0, 10.0
"""Timeout of tests with a fault: a constant, plus a multiple of their time without a fault."""

IGNORED = shutil.ignore_patterns(
    ".git", ".venv*", ".hypothesis", ".*_cache", "__pycache__", "build", "dist", "*.egg-info"
)
FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/.+?)(?: - .*)?$", re.MULTILINE)


class Fault(BaseModel):
    """A fault that can be planted.

    Args:
        name: its unique name.
        file: the file to plant it in, relative to the project's folder.
        old: a string that occurs exactly once in the file.
        new: the replacement of `old`.
        tests: files, folders or single tests to run.
        suffers: the harm to users.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")]
    file: Annotated[str, Field(pattern=r"^src/")]
    old: Annotated[str, Field(min_length=1)]
    new: str
    tests: Annotated[tuple[str, ...], Field(min_length=1)]
    suffers: Annotated[str, Field(min_length=1)]


@dataclass(frozen=True)
class PytestResult:
    """The result of a run of pytest.

    Args:
        status: exit status of the process; None after a timeout.
        failed: the tests that failed.
        cpu: seconds of processor time, with those of processes that it waited for.
        output: its standard output and errors.
    """

    status: int | None
    failed: tuple[str, ...]
    cpu: float
    output: str = field(repr=False)


@dataclass(frozen=True)
class FaultResult:
    """The result of a run with a fault.

    Args:
        fault: the fault.
        killer: the first test that failed, or another reason; empty if the fault survived.
        cpu: seconds of processor time of the run.
    """

    fault: Fault
    killer: str
    cpu: float


class WrongError(Exception):
    """Raised for faults that do not fit the sources, and for tests that fail without a fault."""


def read_faults(root: Path) -> list[Fault]:
    """Return the faults that a checkout lists."""
    return [Fault(**entry) for entry in yaml.safe_load((root / FAULTS).read_text())]


def find_mistakes(faults: Sequence[Fault], tests_from: Path) -> Iterator[str]:
    """Yield a sentence for each mistake in the list."""
    names = [fault.name for fault in faults]
    yield from (
        f"{name}: two entries have this name" for name in sorted({n for n in names if names.count(n) > 1})
    )
    for fault in faults:
        path = ROOT / fault.file
        if not path.is_file():
            yield f"{fault.name}: there is no {fault.file}"
        elif (count := path.read_text().count(fault.old)) != 1:
            yield f"{fault.name}: `old` occurs {count} times in {fault.file}, not once"
        elif fault.new == fault.old:
            yield f"{fault.name}: `new` is `old`"
        elif path.suffix == ".py" and not _parses(plant(path.read_text(), fault)):
            yield f"{fault.name}: with `new`, {fault.file} is not valid Python"
        there = [test for test in fault.tests if not (tests_from / test.partition("::")[0]).exists()]
        yield from (f"{fault.name}: there is no {test} in {tests_from}" for test in there)


def plant(text: str, fault: Fault) -> str:
    """Return a source with the fault in it."""
    return text.replace(fault.old, fault.new)


def _parses(text: str) -> bool:
    with suppress(SyntaxError):
        ast.parse(text)
        return True
    return False


# --- copies of the project


def clone(to: Path, tests_from: Path) -> Path:
    """Copy the project to plant faults in it; tests, and all that they need, come from a checkout."""
    own_runs = shutil.ignore_patterns("runs")

    def ignored(folder: str, names: list[str]) -> set[str]:
        return IGNORED(folder, names) | (own_runs(folder, names) if Path(folder) == tests_from else set())

    shutil.copytree(tests_from, to, ignore=ignored, symlinks=True)
    shutil.rmtree(to / "src")
    shutil.copytree(ROOT / "src", to / "src", ignore=IGNORED, symlinks=True)
    # Bytecode is checked by the hash of its source: a fault may leave the file's size and time unchanged.
    compileall.compile_dir(to / "src", quiet=2, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)
    return to


class Runner:
    """Runs tests in copies of the project, as many at a time as there are copies.

    Args:
        trees: the copies.
    """

    def __init__(self, trees: Sequence[Path]) -> None:
        self._free: SimpleQueue[Path] = SimpleQueue()
        for tree in trees:
            self._free.put(tree)
        self.stopping = threading.Event()
        self.limits: dict[str, float] = {}

    @contextmanager
    def tree(self) -> Iterator[Path]:
        """Lend a copy that no other thread uses."""
        tree = self._free.get()
        try:
            yield tree
        finally:
            self._free.put(tree)

    def run_fault(self, fault: Fault) -> FaultResult:
        """Plant a fault, run its tests, and remove it."""
        with self.tree() as tree:
            path = tree / fault.file
            before, limit = path.read_text(), self.limits[fault.name]
            path.write_text(plant(before, fault))
            try:
                ended = self.pytest(tree, ["-x", "-q"], fault.tests, limit)
            finally:
                path.write_text(before)
        if ended.status is None:
            return FaultResult(fault, f"timeout (after {limit:.0f} s)", ended.cpu)
        if ended.status in {0, NO_TESTS}:
            return FaultResult(fault, "", ended.cpu)
        return FaultResult(fault, next(iter(ended.failed), f"pytest, with status {ended.status}"), ended.cpu)

    def pytest(self, tree: Path, how: Sequence[str], tests: Iterable[str], limit: float) -> PytestResult:
        """Run tests in a copy, in a separate session, and kill the processes that they leave behind."""
        paths = {"PYTHONPATH": str(tree / "src"), "CI": "1"}
        quick = ["-m", "not slow"]  # Run what `make test` runs.
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *quick, *how, *tests]
        with tempfile.TemporaryFile("w+", errors="replace") as output:
            process = subprocess.Popen(
                command,
                cwd=tree,
                env={**os.environ, **paths},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
            status, cpu = self._wait(process, limit)
            output.seek(0)
            text = output.read()
        if self.stopping.is_set():
            raise KeyboardInterrupt
        return PytestResult(status, tuple(FAILED.findall(text)), cpu, text)

    def _wait(self, process: subprocess.Popen[bytes], limit: float) -> tuple[int | None, float]:
        """Wait for a process; return its status, None after a timeout, and its seconds of processor time."""
        until, is_late = time.monotonic() + limit, False
        try:
            while not (found := os.wait4(process.pid, os.WNOHANG))[0]:
                if not is_late and (time.monotonic() > until or self.stopping.is_set()):
                    is_late = True
                    os.killpg(process.pid, signal.SIGKILL)
                time.sleep(0.05)
        finally:
            with suppress(ProcessLookupError):  # A failed test may leave processes.
                os.killpg(process.pid, signal.SIGKILL)
        _, status, usage = found
        process.returncode = os.waitstatus_to_exitcode(status)
        return None if is_late else process.returncode, usage.ru_utime + usage.ru_stime


# --- without a fault


def run_without_faults(runner: Runner, faults: Sequence[Fault], console: Console) -> float:
    """Run all tests once without a fault, and derive the timeout of each fault from their time.

    Returns:
        seconds of processor time.

    Raises:
        WrongError: a test fails or does not exist.
    """
    tests = dict.fromkeys(test for fault in faults for test in fault.tests)
    with runner.tree() as tree:
        report = tree / "report.xml"
        ended = runner.pytest(tree, ["-q", f"--junitxml={report}"], tests, 3600.0)
        if ended.status != 0:
            failures = "\n".join(ended.failed) or ended.output
            raise WrongError(f"these tests fail without a fault and prove nothing:\n{failures}")
        seconds = _seconds(report)
    for fault in faults:
        alone = sum(took for file, took in seconds.items() if any(_is_in(file, test) for test in fault.tests))
        runner.limits[fault.name] = EXTRA_SECONDS + TIME_FACTOR * alone
    console.print(f"without a fault all tests pass ({ended.cpu:.0f} s)", highlight=False)
    return ended.cpu


def _seconds(report: Path) -> dict[str, float]:
    """Return the seconds that the tests of each file took."""
    seconds: defaultdict[str, float] = defaultdict(float)
    for case in ET.parse(report).iter("testcase"):
        seconds[case.get("classname", "").replace(".", "/") + ".py"] += float(case.get("time", "0"))
    return seconds


def _is_in(file: str, named: str) -> bool:
    path = named.partition("::")[0]
    return file == path or file.startswith(path.rstrip("/") + "/")


# --- the command


def with_tests_of(faults: Sequence[Fault], tests_from: Path) -> list[Fault]:
    """Return the faults with the tests that another checkout lists for them, if any."""
    if not (tests_from / FAULTS).exists():
        return [*faults]
    theirs = {fault.name: fault for fault in read_faults(tests_from)}
    return [
        fault.model_copy(update={"tests": theirs[fault.name].tests}) if fault.name in theirs else fault
        for fault in faults
    ]


def select_faults(names: Sequence[str], tests_from: Path) -> list[Fault]:
    """Return the faults with these names, or all without names.

    Raises:
        WrongError: a name is unknown, or a fault of the list does not fit.
    """
    listed = with_tests_of(read_faults(ROOT), tests_from)
    unknown = set(names) - {fault.name for fault in listed}
    wrong = [
        *find_mistakes(listed, tests_from),
        *(f"{name}: there is no fault of this name" for name in sorted(unknown)),
    ]
    if wrong:
        raise WrongError("\n".join(wrong))
    return [fault for fault in listed if not names or fault.name in names]


def run_faults(runner: Runner, faults: Sequence[Fault], jobs: int, console: Console) -> list[FaultResult]:
    """Run the tests of all faults, and print each result."""
    found: dict[str, FaultResult] = {}
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(runner.run_fault, fault) for fault in faults]
        try:
            for number, future in enumerate(as_completed(futures), 1):
                result = future.result()
                found[result.fault.name] = result
                outcome = f"killed by {result.killer}" if result.killer else "SURVIVED"
                line = f"{number} of {len(faults)}  {result.fault.name}: {outcome} ({result.cpu:.1f} s)"
                console.print(line, highlight=False, markup=False, soft_wrap=True)
        except BaseException:
            runner.stopping.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [found[fault.name] for fault in faults]


def table_of(results: Sequence[FaultResult]) -> Table:
    """Return a table of all results."""
    table = Table("fault", "file", "killed by", box=None, pad_edge=False)
    for result in results:
        table.add_row(result.fault.name, result.fault.file.removeprefix("src/"), result.killer or "SURVIVED")
    return table


def data_of(results: Sequence[FaultResult]) -> list[dict[str, object]]:
    """Return all results as JSON data."""
    return [
        {**result.fault.model_dump(), "killed_by": result.killer or None, "cpu": round(result.cpu, 2)}
        for result in results
    ]


def main() -> int:
    """Run the command; the status is 1 if too many faults survive, 2 if the faults or tests are wrong."""
    parser = argparse.ArgumentParser(description="Plant faults, and print which tests find them.")
    parser.add_argument("names", nargs="*", help="only these faults")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    parser.add_argument(
        "--tests-from", type=Path, default=ROOT, metavar="DIR", help="a checkout whose tests to run"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="where to write the results")
    parser.add_argument("--check", action="store_true", help="only check that all faults fit the sources")
    arguments = parser.parse_args()
    console = Console(width=None if sys.stdout.isatty() else 220)
    try:
        tests_from = arguments.tests_from.resolve()
        faults = select_faults(arguments.names, tests_from)
        if arguments.check:
            console.print(f"{len(faults)} faults fit the sources and the tests")
            return 0
        with tempfile.TemporaryDirectory(prefix="faults-") as folder:
            trees = [
                clone(Path(folder) / str(n), tests_from) for n in range(min(arguments.jobs, len(faults)))
            ]
            runner = Runner(trees)
            cpu = run_without_faults(runner, faults, console)
            results = run_faults(runner, faults, arguments.jobs, console)
    except WrongError as error:
        print(error, file=sys.stderr)  # noqa: T201 - a script
        return 2
    console.print(table_of(results), highlight=False, markup=False)
    killed = sum(bool(result.killer) for result in results)
    cpu += sum(result.cpu for result in results)
    console.print(f"{killed} of {len(results)} killed, in {cpu:.0f} s of processor time", highlight=False)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(data_of(results), indent=1) + "\n")
    return 0 if killed >= min(MIN_KILLED, len(results)) else 1


if __name__ == "__main__":
    sys.exit(main())
