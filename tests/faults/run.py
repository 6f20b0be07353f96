"""Plants the faults of faults.yaml one by one, and says which tests find each.

Tests are worth what they find. So faults.yaml lists faults that a user would suffer from, spread over all
packages. This script plants one at a time in a copy of the project, runs the tests that concern it, and says
which of them failed (the fault is killed) or that none did (it survived). The working tree is never touched.

    .venv/bin/python tests/faults/run.py                            all faults
    .venv/bin/python tests/faults/run.py log-keeps-a-torn-line ...  these
    .venv/bin/python tests/faults/run.py --check                    none: do all of them fit the sources?
    .venv/bin/python tests/faults/run.py --tests-from DIR           with the tests of another checkout

First the concerned tests are run without any fault: one that fails then could tell nothing. With
--tests-from, an entry that DIR's own faults.yaml has under the same name names the tests, since they may be
called otherwise there.

To add a fault, add an entry to faults.yaml: a `name` of its own; the `file`; `old`, which stands exactly once
in it, and `new`, which takes its place; the `tests` that concern it, few and cheap: folders, files, or single
tests of files that take long; and what a user `suffers`. Take a mistake that somebody might make, and no two
alike; what nobody would notice is no fault. Then run this script with its name. Where code is rewritten and
`old` is gone, plant a fault of the same kind in what stands there now. A fault that survives shows what no
test looks at: write that test.
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
LEAST = 57
"""How many of all faults must be killed."""

NO_TESTS = 5
"""The status of pytest where it has run no test, since all of them are slow."""

PATIENCE, SLOWER = 60.0, 10.0
"""A fault is killed by time after so many seconds, and so many times what the tests take without a fault."""

LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv*", ".hypothesis", ".*_cache", "__pycache__", "build", "dist", "*.egg-info"
)
FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/.+?)(?: - .*)?$", re.MULTILINE)


class Fault(BaseModel):
    """A fault that can be planted.

    Args:
        name: by which it is called.
        file: where it is planted, below the project's folder.
        old: what stands there exactly once.
        new: what takes its place.
        tests: what is run to find it: files, folders or single tests.
        suffers: what a user would suffer.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")]
    file: Annotated[str, Field(pattern=r"^src/")]
    old: Annotated[str, Field(min_length=1)]
    new: str
    tests: Annotated[tuple[str, ...], Field(min_length=1)]
    suffers: Annotated[str, Field(min_length=1)]


@dataclass(frozen=True)
class Ended:
    """How a run of pytest ended.

    Args:
        status: of the process; None where its time was over.
        failed: the tests that failed.
        cpu: seconds of processor time, of the processes it has waited for too.
        said: what it printed.
    """

    status: int | None
    failed: tuple[str, ...]
    cpu: float
    said: str = field(repr=False)


@dataclass(frozen=True)
class Fate:
    """What became of a fault.

    Args:
        fault: which one.
        by: the first test that failed, or why it is killed without one; empty if it survived.
        cpu: seconds of processor time of its run.
    """

    fault: Fault
    by: str
    cpu: float


class WrongError(Exception):
    """Faults that do not fit, or tests that fail without one."""


def faults_of(root: Path) -> list[Fault]:
    """The faults that a checkout lists."""
    return [Fault(**entry) for entry in yaml.safe_load((root / FAULTS).read_text())]


def complaints(faults: Sequence[Fault], tests_from: Path) -> Iterator[str]:
    """What is wrong with the list, each in a sentence that names the entry."""
    names = [fault.name for fault in faults]
    yield from (
        f"{name}: two entries have this name" for name in sorted({n for n in names if names.count(n) > 1})
    )
    for fault in faults:
        path = ROOT / fault.file
        if not path.is_file():
            yield f"{fault.name}: there is no {fault.file}"
        elif (count := path.read_text().count(fault.old)) != 1:
            yield f"{fault.name}: `old` stands {count} times in {fault.file}, and not once"
        elif fault.new == fault.old:
            yield f"{fault.name}: `new` is `old`"
        elif path.suffix == ".py" and not _parses(planted(path.read_text(), fault)):
            yield f"{fault.name}: with `new`, {fault.file} is no Python"
        there = [test for test in fault.tests if not (tests_from / test.partition("::")[0]).exists()]
        yield from (f"{fault.name}: there is no {test} in {tests_from}" for test in there)


def planted(text: str, fault: Fault) -> str:
    """A string of a source with the fault in it."""
    return text.replace(fault.old, fault.new)


def _parses(text: str) -> bool:
    with suppress(SyntaxError):
        ast.parse(text)
        return True
    return False


# --- copies of the project


def copied(to: Path, tests_from: Path) -> Path:
    """A copy of the project to plant faults in, with tests, and all that these need, from a checkout."""
    own_runs = shutil.ignore_patterns("runs")

    def left_out(folder: str, names: list[str]) -> set[str]:
        return LEFT_OUT(folder, names) | (own_runs(folder, names) if Path(folder) == tests_from else set())

    shutil.copytree(tests_from, to, ignore=left_out, symlinks=True)
    shutil.rmtree(to / "src")
    shutil.copytree(ROOT / "src", to / "src", ignore=LEFT_OUT, symlinks=True)
    # Bytecode is checked by the content of its source: a fault may have the size and time of what was there.
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
        """A copy that nobody else uses meanwhile."""
        tree = self._free.get()
        try:
            yield tree
        finally:
            self._free.put(tree)

    def fate(self, fault: Fault) -> Fate:
        """Plant a fault, run its tests, and take it out again."""
        with self.tree() as tree:
            path = tree / fault.file
            before, limit = path.read_text(), self.limits[fault.name]
            path.write_text(planted(before, fault))
            try:
                ended = self.pytest(tree, ["-x", "-q"], fault.tests, limit)
            finally:
                path.write_text(before)
        if ended.status is None:
            return Fate(fault, f"time ({limit:.0f} s were over)", ended.cpu)
        if ended.status in {0, NO_TESTS}:
            return Fate(fault, "", ended.cpu)
        return Fate(fault, next(iter(ended.failed), f"pytest, with status {ended.status}"), ended.cpu)

    def pytest(self, tree: Path, how: Sequence[str], tests: Iterable[str], limit: float) -> Ended:
        """Run tests in a copy, in a session of their own, and leave nothing of it behind."""
        paths = {"PYTHONPATH": str(tree / "src"), "CI": "1"}
        quick = ["-m", "not slow"]  # what `make test` runs
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *quick, *how, *tests]
        with tempfile.TemporaryFile("w+", errors="replace") as said:
            process = subprocess.Popen(
                command,
                cwd=tree,
                env={**os.environ, **paths},
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                start_new_session=True,
            )
            status, cpu = self._waited(process, limit)
            said.seek(0)
            text = said.read()
        if self.stopping.is_set():
            raise KeyboardInterrupt
        return Ended(status, tuple(FAILED.findall(text)), cpu, text)

    def _waited(self, process: subprocess.Popen[bytes], limit: float) -> tuple[int | None, float]:
        """The status, None if it had to be killed, and the seconds of processor time."""
        until, is_late = time.monotonic() + limit, False
        try:
            while not (found := os.wait4(process.pid, os.WNOHANG))[0]:
                if not is_late and (time.monotonic() > until or self.stopping.is_set()):
                    is_late = True
                    os.killpg(process.pid, signal.SIGKILL)
                time.sleep(0.05)
        finally:
            with suppress(ProcessLookupError):  # whatever a failed test has left
                os.killpg(process.pid, signal.SIGKILL)
        _, status, usage = found
        process.returncode = os.waitstatus_to_exitcode(status)
        return None if is_late else process.returncode, usage.ru_utime + usage.ru_stime


# --- without a fault


def expect_sound(runner: Runner, faults: Sequence[Fault], console: Console) -> float:
    """Run all concerned tests once without a fault, and note how long each entry's may take then.

    Returns:
        seconds of processor time.

    Raises:
        WrongError: a test fails, or is not there.
    """
    tests = dict.fromkeys(test for fault in faults for test in fault.tests)
    with runner.tree() as tree:
        report = tree / "report.xml"
        ended = runner.pytest(tree, ["-q", f"--junitxml={report}"], tests, 3600.0)
        if ended.status != 0:
            told = "\n".join(ended.failed) or ended.said
            raise WrongError(f"these tests fail without a fault, and could tell nothing:\n{told}")
        seconds = _seconds(report)
    for fault in faults:
        alone = sum(took for file, took in seconds.items() if any(_is_in(file, test) for test in fault.tests))
        runner.limits[fault.name] = PATIENCE + SLOWER * alone
    console.print(f"without a fault all concerned tests pass ({ended.cpu:.0f} s)", highlight=False)
    return ended.cpu


def _seconds(report: Path) -> dict[str, float]:
    """How long the tests of each file took."""
    seconds: defaultdict[str, float] = defaultdict(float)
    for case in ET.parse(report).iter("testcase"):
        seconds[case.get("classname", "").replace(".", "/") + ".py"] += float(case.get("time", "0"))
    return seconds


def _is_in(file: str, named: str) -> bool:
    path = named.partition("::")[0]
    return file == path or file.startswith(path.rstrip("/") + "/")


# --- the command


def as_named_there(faults: Sequence[Fault], tests_from: Path) -> list[Fault]:
    """The same faults with the tests that another checkout names for them, where it does."""
    if not (tests_from / FAULTS).exists():
        return [*faults]
    theirs = {fault.name: fault for fault in faults_of(tests_from)}
    return [
        fault.model_copy(update={"tests": theirs[fault.name].tests}) if fault.name in theirs else fault
        for fault in faults
    ]


def chosen(names: Sequence[str], tests_from: Path) -> list[Fault]:
    """The faults of some names, or all.

    Raises:
        WrongError: there is no such fault, or one of the list does not fit.
    """
    listed = as_named_there(faults_of(ROOT), tests_from)
    unknown = set(names) - {fault.name for fault in listed}
    wrong = [
        *complaints(listed, tests_from),
        *(f"{name}: there is no such fault" for name in sorted(unknown)),
    ]
    if wrong:
        raise WrongError("\n".join(wrong))
    return [fault for fault in listed if not names or fault.name in names]


def fates_of(runner: Runner, faults: Sequence[Fault], jobs: int, console: Console) -> list[Fate]:
    """Plant all faults, and tell what becomes of each."""
    found: dict[str, Fate] = {}
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(runner.fate, fault) for fault in faults]
        try:
            for number, future in enumerate(as_completed(futures), 1):
                fate = future.result()
                found[fate.fault.name] = fate
                told = f"killed by {fate.by}" if fate.by else "SURVIVED"
                line = f"{number} of {len(faults)}  {fate.fault.name}: {told} ({fate.cpu:.1f} s)"
                console.print(line, highlight=False, markup=False, soft_wrap=True)
        except BaseException:
            runner.stopping.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [found[fault.name] for fault in faults]


def table_of(fates: Sequence[Fate]) -> Table:
    """What became of all faults."""
    table = Table("fault", "file", "killed by", box=None, pad_edge=False)
    for fate in fates:
        table.add_row(fate.fault.name, fate.fault.file.removeprefix("src/"), fate.by or "SURVIVED")
    return table


def data_of(fates: Sequence[Fate]) -> list[dict[str, object]]:
    """The same for machines."""
    return [
        {**fate.fault.model_dump(), "killed_by": fate.by or None, "cpu": round(fate.cpu, 2)} for fate in fates
    ]


def main() -> int:
    """Run the command; the status is 1 where too many faults survive, 2 where nothing can be told."""
    parser = argparse.ArgumentParser(description="Plant faults, and say which tests find them.")
    parser.add_argument("names", nargs="*", help="only these faults")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    parser.add_argument(
        "--tests-from", type=Path, default=ROOT, metavar="DIR", help="a checkout whose tests to run"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="where to write what became of each")
    parser.add_argument("--check", action="store_true", help="only say whether all faults fit the sources")
    arguments = parser.parse_args()
    console = Console(width=None if sys.stdout.isatty() else 220)
    try:
        tests_from = arguments.tests_from.resolve()
        faults = chosen(arguments.names, tests_from)
        if arguments.check:
            console.print(f"{len(faults)} faults fit the sources and the tests")
            return 0
        with tempfile.TemporaryDirectory(prefix="faults-") as folder:
            trees = [
                copied(Path(folder) / str(n), tests_from) for n in range(min(arguments.jobs, len(faults)))
            ]
            runner = Runner(trees)
            cpu = expect_sound(runner, faults, console)
            fates = fates_of(runner, faults, arguments.jobs, console)
    except WrongError as error:
        print(error, file=sys.stderr)  # noqa: T201 - a script
        return 2
    console.print(table_of(fates), highlight=False, markup=False)
    killed = sum(bool(fate.by) for fate in fates)
    cpu += sum(fate.cpu for fate in fates)
    console.print(f"{killed} of {len(fates)} killed, in {cpu:.0f} s of processor time", highlight=False)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(data_of(fates), indent=1) + "\n")
    return 0 if killed >= min(LEAST, len(fates)) else 1


if __name__ == "__main__":
    sys.exit(main())
