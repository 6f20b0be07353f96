"""`HoldFile`: a file that passes a person's STOP, and the loss of a robot, to all processes of a user."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from codebotler.core.files import make_folder

HOLD_POLL_SECONDS = 0.1
HOLD_WRITE_SECONDS = 2.0


class HoldFile:
    """A file that exists from a STOP, or the loss of a robot, until a person approves a later mission.

    To signal STOP, a process rewrites the file with the same warning. All others then call `on_press`.

    Args:
        path: the file, whose text is the warning about a lost robot, or empty.
        on_press: a function to call after each press in another process.

    Attributes:
        warning: the warning in the file.
    """

    def __init__(self, path: Path, on_press: Callable[[], object]) -> None:
        self._path, self._on_press = path, on_press
        self.warning = ""
        self._seen: int | None = None  # the file's time in nanoseconds, or None without a file
        self._lock = threading.Lock()  # held while the file is read or written
        self._is_pending = False  # whether there may be a hold that is not on the disk yet
        self._writer, self._ended = threading.Thread(), threading.Event()

    def open(self) -> None:
        """Start a thread that notices when another process writes the file."""
        make_folder(self._path.parent)
        self._look()
        threading.Thread(target=self._watch, daemon=True).start()

    def close(self) -> None:
        """Stop watching the file, and wait up to 2 s for a write to end."""
        self._ended.set()
        self.finish()

    def finish(self) -> None:
        """Wait up to 2 s for a write to end."""
        if self._writer.is_alive():
            self._writer.join(HOLD_WRITE_SECONDS)

    @property
    def exists(self) -> bool:
        """Whether a person must approve the next mission."""
        return self._is_pending or self._path.exists()

    def write(self, warning: str = "") -> None:
        """Write the file in a thread, because STOP must not wait. Keep the old warning if `warning` is ""."""
        self._is_pending = True
        self._writer = threading.Thread(target=self._write, args=(warning,), daemon=True)
        self._writer.start()

    def _write(self, warning: str) -> None:
        with self._lock, suppress(OSError):
            self._look()
            make_folder(self._path.parent)
            new, now = self._path.with_suffix(".new"), time.time_ns()
            new.write_text(warning or self.warning, encoding="utf-8", errors="backslashreplace")
            os.utime(new, ns=(now, now))  # the kernel's own time is coarse
            new.replace(self._path)
            self._is_pending = False
            self._look()

    def remove(self, *, before: float) -> None:
        """Remove the file if it was written before this time, in seconds since 1970."""
        if not self._lock.acquire(timeout=HOLD_POLL_SECONDS):
            return  # a write takes long, and a STOP must not wait for it
        self._is_pending = False
        with suppress(OSError):
            if self._path.stat().st_mtime < before:
                self._path.unlink()
                self._look()
        self._lock.release()

    def _look(self) -> bool:
        """Read the file if it has changed. Return whether this was a press of STOP."""
        before, known = self._seen, self.warning
        try:
            self._seen = self._path.stat().st_mtime_ns
            if self._seen != before:
                self.warning = self._path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            self._seen, self.warning = None, ""
        return self._seen not in (before, None) and self.warning == known

    def _watch(self) -> None:
        while not self._ended.wait(HOLD_POLL_SECONDS):
            with self._lock:
                is_press = self._look()
            if is_press:
                self._on_press()
