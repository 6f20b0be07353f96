"""Where programs are run: on the cores of this machine, or on those of a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Protocol, Self, TypeVar

from codebotler.arguments import expect_whole
from codebotler.simulator.engine import Lanes
from codebotler.simulator.lane import Lane

Key = TypeVar("Key")
Ran = TypeVar("Ran")
Value = TypeVar("Value")


class Engine(Protocol):
    """Calls a function with a lane, which runs programs isolated, and with each of many keys."""

    def map_distinct(
        self,
        function: Callable[[Lane, Key], Ran],
        keys: Iterable[Key],
        *,
        name: Callable[[Key], bytes],
        then: Callable[[Ran], Value],
    ) -> Iterator[Value]:
        """The results in the order of the keys; equal keys are one call, and keys are read as needed.

        Args:
            function: what to call; it, the keys and the results can be pickled.
            keys: what to call it with.
            name: a short name of a key, which no other key has.
            then: what to call with what comes of it, in the main thread of a process where that is possible.

        Raises:
            EngineError: no isolated process can be started, or none is left.
        """
        ...


OpenEngine = AbstractContextManager[Engine]


class Local:
    """The cores of this machine; use as a context manager.

    Args:
        lanes: those that run programs, or how many are to be started and ended.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.

    Raises:
        BadInput: there are to be less than 1.
    """

    def __init__(self, lanes: Lanes | int, *, require_isolation: bool = False) -> None:
        if not isinstance(lanes, Lanes):
            expect_whole(lanes, "the number of workers", least=1)
        self._given, self._required = lanes, require_isolation
        self._lanes = lanes if isinstance(lanes, Lanes) else None

    def __enter__(self) -> Self:
        if self._lanes is None and not isinstance(self._given, Lanes):
            self._lanes = Lanes(self._given, require_isolation=self._required)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._lanes is not None and self._lanes is not self._given:
            self._lanes.__exit__(kind, error, where)
            self._lanes = None

    def map_distinct(
        self,
        function: Callable[[Lane, Key], Ran],
        keys: Iterable[Key],
        *,
        name: Callable[[Key], bytes],
        then: Callable[[Ran], Value],
    ) -> Iterator[Value]:
        """The results in the order of the keys."""
        lanes = self._lanes
        assert lanes is not None, "enter it first"
        return lanes.map_distinct(lambda key: function(lanes.here(), key), keys, name=name, then=then)
