"""Calls a function in threads, once for equal keys, and yields the results in the order of the keys."""

from __future__ import annotations

import contextlib
import os
import pickle
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from itertools import islice
from queue import SimpleQueue
from typing import Any, Generic, Self, TypeVar

Key = TypeVar("Key")
Called = TypeVar("Called")
Value = TypeVar("Value")

IN_MEMORY = 8_000_000  # bytes of results
MOST_AHEAD = 4_000  # keys read whose results are not yet asked for; a thread may be held up for seconds


class Distinct(Generic[Key, Called, Value]):
    """One such series of calls.

    Args:
        pool: the threads.
        busy: how many calls are begun or wait for a thread at any time.
        function: what to call.
        name: a short name of a key, which no other key has.
        then: what to call with each result, in the thread that asks for them; what it returns is pickled.
    """

    def __init__(
        self,
        pool: Executor,
        busy: int,
        function: Callable[[Key], Called],
        name: Callable[[Key], bytes],
        then: Callable[[Called], Value],
    ) -> None:
        self._pool, self._busy, self._function, self._name, self._then = pool, busy, function, name, then
        self._waiting: deque[bytes] = deque()
        self._running: set[bytes] = set()
        self._ended: SimpleQueue[tuple[bytes, tuple[Called] | None]] = SimpleQueue()
        self._failed: dict[bytes, BaseException] = {}
        self._unreadable: list[Exception] = []

    def results(self, keys: Iterable[Key]) -> Iterator[Value]:
        """The results, as they are asked for; what is thrown by a call or by the keys comes in its place."""
        remaining = self._readable(keys)
        with Done() as done:
            while self._read(remaining, done):
                if self._waiting[0] in self._running or not self._ended.empty():
                    self._finish(*self._ended.get(), done)
                    continue
                named = self._waiting.popleft()
                if named in self._failed:
                    raise self._failed[named]
                yield done[named]
        for error in self._unreadable:
            raise error

    def _readable(self, keys: Iterable[Key]) -> Iterator[Key]:
        try:
            yield from keys
        except Exception as error:  # noqa: BLE001 - thrown after the results of what was read before
            self._unreadable.append(error)

    def _read(self, remaining: Iterator[Key], done: Done) -> bool:
        """Read so many keys that the threads have work; whether any result is still to be told."""
        room = min(self._busy - len(self._running), MOST_AHEAD - len(self._waiting))
        for key in islice(remaining, max(0, room)):
            named = self._name(key)
            self._waiting.append(named)
            if named not in done and named not in self._running:
                self._running.add(named)
                self._pool.submit(self._call, named, key)
        return bool(self._waiting)

    def _call(self, named: bytes, key: Key) -> None:
        try:
            result = self._function(key)
        except BaseException as error:  # noqa: BLE001 - thrown where the result is waited for
            self._failed[named] = error
            self._ended.put((named, None))
        else:
            self._ended.put((named, (result,)))  # an interrupt of who waits for it leaves nothing locked

    def _finish(self, named: bytes, result: tuple[Called] | None, done: Done) -> None:
        self._running.remove(named)
        try:
            if result is not None:
                done[named] = self._then(*result)
        except Exception as error:  # noqa: BLE001 - thrown where the result is waited for
            self._failed[named] = error


class Done:
    """Results by name; most in a file that nobody else sees, so that a million of them need little memory."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115 - closed by __exit__
        self._lock = threading.Lock()
        self._places: dict[bytes, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):  # of a full disk has been told
            self._file.close()

    def __contains__(self, name: bytes) -> bool:
        return name in self._places

    def __setitem__(self, name: bytes, value: object) -> None:
        data = pickle.dumps(value)
        try:
            with self._lock:
                place = self._file.seek(0, os.SEEK_END)
                self._file.write(data)
                self._file.flush()
        except OSError as error:
            raise OSError(error.errno, error.strerror, tempfile.gettempdir()) from None
        self._places[name] = place

    def __getitem__(self, name: bytes) -> Any:  # noqa: ANN401 - whatever was put there
        with self._lock:
            self._file.seek(self._places[name])
            return pickle.load(self._file)  # noqa: S301 - we wrote it
