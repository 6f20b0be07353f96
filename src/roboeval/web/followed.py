"""A run that is followed as its files grow: of each completion a small entry is kept, and where it stands."""

from __future__ import annotations

import fcntl
import json
import os
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from codebotler.badinput import BadInput
from codebotler.files import MAX_ROW
from codebotler.terminal import shortened
from roboeval.evaluation.completions import Completion, Key, name_of
from roboeval.evaluation.rows import BROKEN, HASH_LINE, MAX_EVALUATION, NO_ROW, Seal, row_of
from roboeval.evaluation.run import Run, load_head
from roboeval.evaluation.tables import RowData, key_of
from roboeval.web.seen import Entry, Judged, Seen, Written
from roboeval.web.tail import Change, Tail

MOST_FAULTS = 5
MOST_WORDS = 300
AT_ONCE = 0.2
"""Seconds that a look reads at most; whoever looks on sees the rest."""


class GoneError(BadInput):
    """A run is not there any more."""


class FollowedRun:
    """Follows one evaluation of a run, for any thread.

    Args:
        run: its folder.
        key: the evaluation's; None where nothing has been judged.
        within: the folder that all its files must lie in, whatever links say.
    """

    def __init__(self, run: Run, key: str | None, within: Path) -> None:
        self.run, self.key = run, key
        self._lock = threading.Lock()
        name = key or ""
        self._completions = Tail(run.completions, within, MAX_ROW)
        self._rows = Tail(run.rows(name), within, MAX_EVALUATION)
        self._hashes = Tail(run.programs(name), within, HASH_LINE)
        self._seen = Seen()
        self._start_over()

    def _start_over(self) -> None:
        for tail in (self._completions, self._rows, self._hashes):
            tail.start_over()
        self._written: dict[Key, Written] = {}
        self._judged: dict[Key, Judged] = {}
        self._order: list[
            Key | None
        ] = []  # None for a damaged row, so that the next ones keep their programs
        self._digests: list[bytes] = []
        self._seal = Seal()
        self._faults: list[str] = []
        self._fault_count = 0

    def look(self, seconds: float = AT_ONCE) -> Seen:
        """Read what is new, and say what is known by now.

        Args:
            seconds: how long to read at most.

        Raises:
            GoneError: the run is not there any more.
        """
        with self._lock:
            if not self.run.path.is_dir():
                raise GoneError("is gone: its folder was deleted or renamed", file=self.run.path.name)
            before = self._size, self._fault_count
            head = self._head(self.run.head(self.key)) if self.key else {}
            is_whole = self._read(time.monotonic() + seconds)
            faults = self._faults
            if is_whole and self._is_broken(head):
                faults = [f"{self._rows.path.name}: {BROKEN}; --redo judges again", *faults]
            found = Seen(
                version=self._seen.version,
                name=self.run.path.name,
                key=self.key,
                about=self._head(self.run.about),
                head=head,
                is_written=_is_locked(self.run.path / ".lock"),
                share=1.0 if is_whole else self._share(),
                faults=tuple(faults),
                fault_count=self._fault_count + len(faults) - len(self._faults),
                entries=self._seen.entries if before == (self._size, self._fault_count) else self._entries(),
            )
            if found != self._seen:
                found = found.next()
                self._seen = found
            return self._seen

    def _is_broken(self, head: Mapping[str, Any]) -> bool:
        """Whether the rows are others than those of the finished evaluation, and no other fault was found.

        An evaluation that is gone on with meanwhile is not finished any more.
        """
        broken = not self._fault_count and self._seal.is_broken(head)
        return broken and self._head(self.run.head(self.key or "")) == head

    def wait(self) -> Seen:
        """Read all there is, and say what is known then.

        Raises:
            GoneError: the run is not there any more.
        """
        while (seen := self.look()).share < 1:
            pass
        return seen

    def row(self, entry: Entry) -> RowData | None:
        """The row of an evaluation again, with all its traces; None if there is none yet.

        Raises:
            BadInput: it does not stand there any more.
        """
        if entry.judged is None:
            return None
        row = self._again(self._rows, entry.judged.at, entry.judged.size)
        with suppress(BadInput):
            if key_of(found := row_of(row)) == entry.key:
                return found
        raise BadInput("was written anew meanwhile; reload the page", file=self._rows.path.name)

    def completion(self, entry: Entry) -> Completion | None:
        """The completion again, with its program; None if it is not there.

        Raises:
            BadInput: it does not stand there any more.
        """
        if entry.written is None:
            return None
        row = self._again(self._completions, entry.written.at, entry.written.size)
        completion = _completion(row)
        if completion is not None and completion.key == entry.key:
            return completion
        raise BadInput("was written anew meanwhile; reload the page", file=self._completions.path.name)

    # --- reading on

    @property
    def _size(self) -> tuple[int, int, int]:
        return self._completions.offset, self._rows.offset, self._hashes.offset

    def _read(self, until: float) -> bool:
        """Read on, and say whether all was read. Rows come first: their programs are there before them."""
        tails = (self._rows, self._hashes) if self.key else ()
        try:
            changes = {tail: tail.look() for tail in (*tails, self._completions)}
            if Change.ANOTHER in changes.values():
                self._start_over()
                changes = {tail: tail.look() for tail in changes}
        except BadInput as error:
            self._fault(error)
            return True
        return all(self._read_on(tail, until) for tail, change in changes.items() if change is Change.MORE)

    def _read_on(self, tail: Tail, until: float) -> bool:
        while True:
            try:
                for at, line in tail.lines():
                    self._take(tail, at, line)
                    if time.monotonic() > until:
                        return False
            except BadInput as error:
                self._fault(error)
                if error.line is None:
                    return True
            else:
                return True

    def _take(self, tail: Tail, at: int, line: bytes) -> None:
        if tail is self._hashes:
            with suppress(ValueError):
                self._digests.append(bytes.fromhex(line.decode("ascii", "replace")))
            return
        if tail is self._rows:
            self._seal.add(line)
        if not line.strip():
            return
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            row = None
        if tail is self._completions:
            self._take_completion(row, at, line)
        else:
            self._take_row(row, at, line)

    def _take_completion(self, row: object, at: int, line: bytes) -> None:
        completion = _completion(row)
        if completion is None:
            raise BadInput(
                "this line is no completion; correct or remove it",
                file=self._completions.path.name,
                line=self._completions.number,
            )
        key = _interned(completion.key)
        if key in self._written:
            raise BadInput(
                f"{shortened(name_of(key))} stands here again; remove one of them",
                file=self._completions.path.name,
                line=self._completions.number,
            )
        model = completion.model and sys.intern(completion.model)
        self._written[key] = Written(at, len(line), bytes.fromhex(completion.program_sha256), model)

    def _take_row(self, row: object, at: int, line: bytes) -> None:
        try:
            key, judged = _judged(row, at, len(line))
        except BadInput as error:
            self._order.append(None)
            raise BadInput(
                f"{error.sentence}; --redo judges again",
                file=self._rows.path.name,
                line=self._rows.number,
            ) from None
        self._order.append(key)
        self._judged[key] = judged

    def _fault(self, error: BadInput) -> None:
        if len(self._faults) < MOST_FAULTS and str(error) not in self._faults:
            self._faults.append(str(error))
            self._fault_count += 1
        elif str(error) not in self._faults:
            self._fault_count += 1

    def _entries(self) -> tuple[Entry, ...]:
        judged_program = dict(zip(self._order, self._digests, strict=False))
        return tuple(
            Entry(key, written, judged, judged is not None and not _is_same(written, judged_program.get(key)))
            for key in dict.fromkeys([*self._written, *self._judged])
            for written, judged in [(self._written.get(key), self._judged.get(key))]
        )

    def _share(self) -> float:
        tails = (self._completions, self._rows)
        return min(0.99, sum(tail.offset for tail in tails) / max(1, sum(tail.size for tail in tails)))

    def _again(self, tail: Tail, at: int, size: int) -> Any:  # noqa: ANN401 - JSON has no types
        with suppress(ValueError, RecursionError):
            return json.loads(tail.at(at, size))
        return None

    def _head(self, path: Path) -> Mapping[str, Any]:
        """What a small file says, if it is there and says anything."""
        try:
            inside = path.resolve(strict=True).is_relative_to(self._completions.within)
            return load_head(path) if inside and path.is_file() else {}
        except (OSError, BadInput):
            return {}


def _is_same(written: Written | None, judged: bytes | None) -> bool:
    return written is not None and written.digest == judged


def _interned(key: Key) -> Key:
    return sys.intern(key[0]), key[1], key[2]


def _completion(row: object) -> Completion | None:
    """The completion that a line says; None if it is none."""
    with suppress(BadInput):
        return Completion.of(row) if isinstance(row, dict) else None
    return None


def _judged(data: object, at: int, size: int) -> tuple[Key, Judged]:
    """What is kept of a row of an evaluation."""
    row = row_of(data)
    verdicts = [(v["satisfied"], v["status"] == "finished" or v["error"] is None) for v in row["verdicts"]]
    worlds = "".join("+" if ok else "-" if finished else "!" for ok, finished in verdicts)
    why = row["failure"]
    if why is None:
        return _interned(key_of(row)), Judged(at, size, row["passed"], None, None, None, None, worlds, "")
    check, error = why["check"], row["verdicts"][why["world"]]["error"]
    if check is None and error is None:
        raise BadInput(NO_ROW)
    told = shortened(error["message"] if check is None else check, MOST_WORDS)
    names = sys.intern(why["class"]), sys.intern(why["kind"])
    return _interned(key_of(row)), Judged(at, size, row["passed"], *names, why["world"], check, worlds, told)


def _is_locked(path: Path) -> bool:
    """Whether a process writes the run. Our hold lasts a moment, for which a writer has patience."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
