"""Finds the runs in a folder by name, and reads them again when their files change."""

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
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import Results, read_results
from roboeval.suites.load import ABLATED, Suite, has_suite, load_suite
from roboeval.web.snapshot import Snapshot

MAX_SNAPSHOTS = 16  # number of evaluations kept in memory
REPORT_PAGE, MAX_REPORT_BYTES = "index.html", 20_000_000  # file name and maximum size of a report
REST_FACTOR = 10  # pause between two reads of a run, as a multiple of the time that a read takes
OUTSIDE_FOLDER = "is a link that leads outside the folder of runs; replace the link by its target"

FileStamps: TypeAlias = tuple[tuple[int, ...] | None, ...]


class MissingError(UserError):
    """Raised if a run, or a part of a run, does not exist or was removed."""


class RunStore:
    """Finds and reads the runs in a folder. The folder may be a run itself, or not exist yet. Thread-safe."""

    def __init__(self, folder: Path, suites: Sequence[Suite] = ()) -> None:
        self.folder = folder
        self._suites: dict[str, Suite | None] = {suite.name: suite for suite in suites}
        self._reader_of = lru_cache(maxsize=MAX_SNAPSHOTS)(partial(_Reader, self))

    def names(self) -> list[str]:
        """Return the sorted names of the runs."""
        return sorted(name for name, path in self._folders().items() if _is_run(path))

    def open(self, name: str, key: str | None = None) -> Snapshot:
        """Return a run's latest snapshot. `key` is its evaluation (default: one without ablation, if any)."""
        return self._reader(name, key).read()

    def version(self, name: str) -> Hashable:
        """Return a value that changes when a file of the run changes, without reading the run."""
        return self._reader(name, None).version()

    def report(self, name: str, part: str = REPORT_PAGE) -> bytes:
        """Read a file of a run's report, such as its page. Raise UserError if it is missing or too large."""
        path = self._reader(name, None).folder / "report" / part
        try:
            if _stamp(path, self.folder.resolve()) is not None:
                if (size := path.stat().st_size) > MAX_REPORT_BYTES:
                    raise UserError(f"the file is too big ({size:,} bytes); open it on disk", file=path.name)
                return path.read_bytes()
        except OSError:
            pass
        raise MissingError(f'the run "{shortened(name)}" has no file "report/{part}"; write a new report')

    def has_report(self, name: str) -> bool:
        """Whether a run has a report that is small enough to show."""
        try:
            self.report(name)
        except UserError:
            return False
        return True

    def suite(self, name: str) -> Suite | None:
        """Load a given, built-in or installed suite by name. Return None if it is missing or not valid."""
        if name not in self._suites:
            try:
                self._suites[name] = load_suite(name) if has_suite(name) else None
            except UserError as error:
                note(f"a suite is ignored: {error}")
                self._suites[name] = None
        return self._suites[name]

    def _folders(self) -> dict[str, Path]:
        """Return the folder if it is a run itself, otherwise its entries, by name."""
        if RunFolder(self.folder).completions.is_file():
            return {self.folder.resolve().name: self.folder.resolve()}
        try:
            return {path.name: path for path in self.folder.iterdir()}
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise UserError(f"the folder cannot be read ({error.strerror})", file=self.folder) from None

    def _reader(self, name: str, key: str | None) -> _Reader:
        path = self._folders().get(name)  # looking up names prevents paths to other folders
        if path is None or not _is_run(path):
            raise MissingError(f'this folder has no run "{shortened(name)}"; it may have been deleted')
        if not path.resolve().is_relative_to(self.folder.resolve()):
            raise UserError(f'"{shortened(name)}" {OUTSIDE_FOLDER}')
        run = RunFolder(path)
        keys = (path.stem for path in run.rows("").parent.glob("*.jsonl"))
        known = tuple(sorted(keys, key=lambda one: (one.endswith(ABLATED), one)))
        if key is not None and key not in known:
            raise UserError(f'the run "{shortened(name)}" has no evaluation "{shortened(key)}"')
        reader = self._reader_of(run, key or next(iter(known), None))
        reader.evaluations = known
        return reader


class _Reader:
    """Reads one evaluation of a run, and reads it again when one of its files changes."""

    def __init__(self, store: RunStore, run: RunFolder, key: str | None) -> None:
        self._store, self._run, self._key = store, run, key
        self.evaluations: tuple[str, ...] = ()
        self._lock = threading.Lock()
        self._results: Results | None = None
        self._stamps: FileStamps = ()
        self._rests_until = 0.0
        self._snapshot: Snapshot | None = None

    @property
    def folder(self) -> Path:
        return self._run.path

    def read(self) -> Snapshot:
        with self._lock:
            stamps = self._stamps_now()
            is_new = stamps != self._stamps and time.monotonic() >= self._rests_until
            if self._results is None or is_new:
                began = time.monotonic()
                self._results, self._stamps = self._read_files(), stamps
                ended = time.monotonic()
                self._rests_until = ended + REST_FACTOR * (ended - began)
            version = self._version(self._stamps)
            if self._snapshot is None or self._snapshot.version != version:
                is_written = self._run.is_being_written
                self._snapshot = Snapshot(self._results, self.evaluations, is_written, version)
            return self._snapshot

    def version(self) -> Hashable:
        return self._version(self._stamps_now())

    def _version(self, stamps: FileStamps) -> Hashable:
        return self._key, self.evaluations, self._run.is_being_written, stamps

    def _stamps_now(self) -> FileStamps:
        """Return the stamps of all files, which change when the content changes."""
        run, key = self._run, self._key or ""
        checks = run.checks(key.removesuffix(ABLATED))
        within = self._store.folder.resolve()
        paths = (run.completions, run.about, run.rows(key), run.manifest(key), checks)
        return tuple(_stamp(path, within) for path in paths)

    def _read_files(self) -> Results:
        try:
            results = read_results(self._run, self._key)
        except UserError as error:  # pages show no folders of this machine
            raise UserError(error.sentence, file=Path(str(error.file)).name, line=error.line) from None
        name = results.manifest.get("suite") or results.about.get("suite")
        return replace(results, suite=self._store.suite(name if isinstance(name, str) else "paper"))


def _stamp(path: Path, within: Path) -> tuple[int, ...] | None:
    """Return a value that changes when a file changes, or None if the file does not exist."""
    try:
        found = path.resolve(strict=True)
        status = found.stat()
    except OSError:
        return None
    if not found.is_relative_to(within):
        raise UserError(OUTSIDE_FOLDER, file=path.name)
    if not stat.S_ISREG(status.st_mode):
        raise UserError("the path is not a regular file; replace or remove it", file=path.name)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _is_run(path: Path) -> bool:
    """Whether a folder looks like a run, even if it has no completions yet."""
    run = RunFolder(path)
    is_named = path.name.isprintable() and not path.name.startswith(".")
    return is_named and (run.completions.exists() or run.about.exists())
