"""The folder of runs: each run is found by its name, and read again when one of its files has changed."""

from __future__ import annotations

import stat
import threading
import time
from collections.abc import Hashable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.terminal import note, shortened
from roboeval.evaluation.runs.folder import Run
from roboeval.evaluation.runs.results import Results, read_results
from roboeval.suites.load import ABLATED, Suite, has_suite, load_suite
from roboeval.web.snapshot import Snapshot

MOST_HELD = 16  # evaluations that stay in memory
REPORT, MOST_REPORT = "index.html", 20_000_000  # the page of a report, and its bytes
REST = 10  # a run is not read again before this many times as long as reading it took
OUTSIDE = "leads outside the folder of runs, so it is not read"

Stamps: TypeAlias = tuple[tuple[int, ...] | None, ...]


class MissingError(UserError):
    """A run or a completion that is not there, or not any more."""


class RunStore:
    """The runs in a folder, for any thread; the folder may be a run itself, and need not exist yet."""

    def __init__(self, folder: Path, suites: Sequence[Suite] = ()) -> None:
        self.folder = folder
        self._suites: dict[str, Suite | None] = {suite.name: suite for suite in suites}
        self._reader_of = lru_cache(maxsize=MOST_HELD)(partial(_Reader, self))

    def names(self) -> list[str]:
        """The names of the runs, sorted."""
        return sorted(name for name, path in self._folders().items() if _is_run(path))

    def open(self, name: str, key: str | None = None) -> Snapshot:
        """A run as it is now, or was a moment ago; its first evaluation that is not ablated, unless named."""
        return self._reader(name, key).read()

    def version(self, name: str) -> Hashable:
        """The version that a run would have if it was opened now; it is not read."""
        return self._reader(name, None).version()

    def report(self, name: str, part: str = REPORT) -> bytes | None:
        """The page of the report in a run's folder, or another part of it; None if it cannot be read."""
        path = self._reader(name, None).folder / "report" / part
        if _stamp(path, self.folder.resolve()) is None:
            return None
        try:
            size = path.stat().st_size
            if size > MOST_REPORT:
                raise UserError(f"is too large to be shown here: {size:,} bytes", file=path.name)
            return path.read_bytes()
        except OSError:
            return None

    def has_report(self, name: str) -> bool:
        """Whether there is a report in a run's folder."""
        try:
            return self.report(name) is not None
        except UserError:
            return False

    def suite(self, name: str) -> Suite | None:
        """A suite that ships, is installed or was named; None if it is not at hand."""
        if name not in self._suites:
            try:
                self._suites[name] = load_suite(name) if has_suite(name) else None
            except UserError as error:
                note(f"a suite is left out: {error}")
                self._suites[name] = None
        return self._suites[name]

    def _folders(self) -> dict[str, Path]:
        """The folder if it is a run itself, else what lies in it, by name."""
        if Run(self.folder).completions.is_file():
            return {self.folder.resolve().name: self.folder.resolve()}
        try:
            return {path.name: path for path in self.folder.iterdir()}
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise UserError(f"cannot be read ({error.strerror})", file=self.folder) from None

    def _reader(self, name: str, key: str | None) -> _Reader:
        path = self._folders().get(name)  # letter by letter, so that no name leads anywhere else
        if path is None or not _is_run(path):
            raise MissingError(f'there is no run "{shortened(name)}" in this folder; perhaps it was deleted')
        if not path.resolve().is_relative_to(self.folder.resolve()):
            raise UserError(f'"{shortened(name)}" {OUTSIDE}')
        run = Run(path)
        keys = (path.stem for path in run.rows("").parent.glob("*.jsonl"))
        known = tuple(sorted(keys, key=lambda one: (one.endswith(ABLATED), one)))
        if key is not None and key not in known:
            raise UserError(f'"{shortened(name)}" has no evaluation "{shortened(key)}"')
        reader = self._reader_of(run, key or next(iter(known), None))
        reader.evaluations = known
        return reader


class _Reader:
    """One evaluation of a run, read again when one of its files has changed."""

    def __init__(self, store: RunStore, run: Run, key: str | None) -> None:
        self._store, self._run, self._key = store, run, key
        self.evaluations: tuple[str, ...] = ()
        self._lock = threading.Lock()
        self._results: Results | None = None
        self._stamps: Stamps = ()
        self._rests_until = 0.0
        self._snapshot: Snapshot | None = None

    @property
    def folder(self) -> Path:
        """Where the run is."""
        return self._run.path

    def read(self) -> Snapshot:
        with self._lock:
            stamps = self._stamps_now()
            is_new = stamps != self._stamps and time.monotonic() >= self._rests_until
            if self._results is None or is_new:
                began = time.monotonic()
                self._results, self._stamps = self._read_files(), stamps
                ended = time.monotonic()
                # Faults of files that changed while they were read may be gone by now.
                mixed = bool(self._results.faults) and self._stamps_now() != stamps
                self._rests_until = ended + (0 if mixed else REST * (ended - began))
            version = self._version(self._stamps)
            if self._snapshot is None or self._snapshot.version != version:
                self._snapshot = Snapshot(
                    self._results, self.evaluations, self._run.is_being_written, version
                )
            return self._snapshot

    def version(self) -> Hashable:
        return self._version(self._stamps_now())

    def _version(self, stamps: Stamps) -> Hashable:
        return self._key, self.evaluations, self._run.is_being_written, stamps

    def _stamps_now(self) -> Stamps:
        """What tells one state of its files from another."""
        run, key = self._run, self._key or ""
        checks = run.checks(key.removesuffix(ABLATED))
        within = self._store.folder.resolve()
        paths = (run.completions, run.about, run.rows(key), run.head(key), checks)
        return tuple(_stamp(path, within) for path in paths)

    def _read_files(self) -> Results:
        faults: list[UserError] = []
        results = read_results(self._run, self._key, keep_failed=False, faults=faults)
        there = tuple(fault for fault in faults if Path(str(fault.file)).exists())  # a new run lacks files
        name = results.head.get("suite") or results.about.get("suite")
        suite = self._store.suite(name if isinstance(name, str) else "paper")
        return replace(results, suite=suite, faults=there)


def _stamp(path: Path, within: Path) -> tuple[int, ...] | None:
    """What changes when a file does; None if there is none."""
    try:
        found = path.resolve(strict=True)
        status = found.stat()
    except OSError:
        return None
    if not found.is_relative_to(within):
        raise UserError(OUTSIDE, file=path.name)
    if not stat.S_ISREG(status.st_mode):
        raise UserError("is no file", file=path.name)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _is_run(path: Path) -> bool:
    """Whether a folder looks like a run; also while its first completion is waited for."""
    run = Run(path)
    is_named = path.name.isprintable() and not path.name.startswith(".")
    return is_named and (run.completions.exists() or run.about.exists())
