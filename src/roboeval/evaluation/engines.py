"""Where programs run: on the cores of this machine, or on those of a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Protocol, Self, TypeAlias, TypeVar

from codebotler.arguments import expect_whole
from codebotler.simulator.engine import Lanes, digest
from codebotler.simulator.lane import Lane

Work: TypeAlias = tuple[str, str]
"""The name of a task, and a program."""

Ran = TypeVar("Ran")
Value = TypeVar("Value")


class Engine(Protocol):
    """Calls functions that run programs isolated."""

    def map_distinct(
        self, function: Callable[[Lane, Work], Ran], works: Iterable[Work], then: Callable[[Ran], Value]
    ) -> Iterator[Value]:
        """The results for programs, in their order; equal ones are one call, and they are read as needed.

        Args:
            function: what to call with each program; it and its results can be pickled.
            works: the programs.
            then: what to call with each result, in the main thread of a process where that is possible.

        Raises:
            EngineError: no isolated process can be started, or none is left.
        """
        ...


OpenEngine = AbstractContextManager[Engine]


class Local:
    """The cores of this machine; use as a context manager.

    Args:
        lanes: those that run programs, or how many to start and end.
        require_isolation: whether to refuse where programs are not fully isolated, rather than warn.

    Raises:
        BadInput: there are to be less than 1.
    """

    def __init__(self, lanes: Lanes | int, *, require_isolation: bool = False) -> None:
        if not isinstance(lanes, Lanes):
            expect_whole(lanes, "the number of workers", least=1)
        self._given, self._required = lanes, require_isolation

    def __enter__(self) -> Self:
        given = self._given
        self._lanes = given if isinstance(given, Lanes) else Lanes(given, require_isolation=self._required)
        return self

    def __exit__(self, *_: object) -> None:
        if self._lanes is not self._given:
            self._lanes.__exit__()

    def map_distinct(
        self, function: Callable[[Lane, Work], Ran], works: Iterable[Work], then: Callable[[Ran], Value]
    ) -> Iterator[Value]:
        """The results for programs, in their order."""
        here = self._lanes.here
        return self._lanes.map_distinct(
            lambda work: function(here(), work), works, name=lambda work: digest(*work), then=then
        )
