"""Runs programs on a Ray cluster: in shards, which are given out anew where a machine is lost."""

from __future__ import annotations

import logging
import os
import platform
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import islice
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from codebotler import __version__
from codebotler.badinput import BadInput
from codebotler.simulator.distinct import MOST_AHEAD, Done
from codebotler.simulator.engine import NO_SECCOMP
from codebotler.simulator.lane import EngineError, Lane
from roboeval.evaluation.rayaddress import LOCAL, expect_cluster, is_here_only, named_address, outside

LOG = logging.getLogger("roboeval.ray")
Key = TypeVar("Key")
Ran = TypeVar("Ran")
Value = TypeVar("Value")

LARGEST = 16  # keys of a shard: some tens of milliseconds, beside which Ray's one or two are little
AHEAD = 2  # shards for each core that are under way, so that none waits for this process
TRIES = 20  # of a shard whose machine is lost
PATIENCE = 10  # seconds until it is asked whether the cluster has any core left


class Cluster:
    """The cores of a Ray cluster; use as a context manager.

    The cluster is the one that RAY_ADDRESS names, or else the one that this machine is part of. Where there
    is none, or RAY_ADDRESS is "local", one is started on this machine, which is reached by nobody else, and
    ended again.

    Args:
        workers: how many shards are under way at the same time; twice the cores of the cluster by default.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.

    Raises:
        BadInput: Ray is not installed, or no cluster answers at the address.
    """

    def __init__(self, workers: int | None = None, *, require_isolation: bool = False) -> None:
        self._ray = _imported()
        expect_cluster()
        self._workers, self._required = workers, require_isolation
        self._warned = False

    def __enter__(self) -> Self:
        _connect(self._ray)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._ray.shutdown()

    def map_distinct(
        self,
        function: Callable[[Lane, Key], Ran],
        keys: Iterable[Key],
        *,
        name: Callable[[Key], bytes],
        then: Callable[[Ran], Value],
    ) -> Iterator[Value]:
        """The results in the order of the keys.

        What is under way when no more results are wanted comes to its end in the cluster: Ray 2.60 can abort
        this process when a shard that is just done is cancelled.
        """
        shards: Shards[Key] = Shards(self._give_out(partial(call_both, function, then)))
        remaining = iter(keys)
        waiting: deque[bytes] = deque()
        with Done() as done:
            while True:
                self._read(remaining, waiting, shards, done, name)
                if not waiting:
                    return
                if waiting[0] in done:
                    yield done[waiting.popleft()]
                else:
                    self._await(shards, done)

    def _give_out(self, function: Callable[[Lane, Key], Value]) -> Callable[[Sequence[Key]], Any]:
        """What gives a shard to the cluster, and says by which reference its results are found."""
        ray = self._ray
        remote = ray.remote(num_cpus=1, max_retries=TRIES, retry_exceptions=False)(call_all)
        kept = ray.put(function)
        return lambda keys: remote.remote(kept, list(keys), OURS)

    def _read(
        self,
        remaining: Iterator[Key],
        waiting: deque[bytes],
        shards: Shards[Key],
        done: Done,
        name: Callable[[Key], bytes],
    ) -> None:
        """Read so many keys that the cluster has work, and no more than this process should hold."""
        most = self._workers or AHEAD * self._cores()
        while len(shards.running) < most and len(waiting) < MOST_AHEAD:
            read = False
            for key in islice(remaining, min(shards.size(most), MOST_AHEAD - len(waiting))):
                read = True
                named = name(key)
                waiting.append(named)
                if named not in done and named not in shards.names:
                    shards.add(named, key)
            shards.send()
            if not read:
                return

    def _cores(self) -> int:
        return max(1, int(self._ray.cluster_resources().get("CPU", 0)))

    def _await(self, shards: Shards[Key], done: Done) -> None:
        """Wait until some shard is done, and keep its results."""
        ready, _ = self._ray.wait(list(shards.running), num_returns=1, timeout=PATIENCE)
        if not ready and not self._ray.cluster_resources().get("CPU"):
            raise EngineError("the Ray cluster has no core left; start another node, and go on")
        for reference in ready:
            told = _fetched(self._ray, reference)
            if told.complaint is not None:
                raise EngineError(told.complaint)
            self._look_at_walls(told)
            for named, value in zip(shards.running.pop(reference), told.values, strict=True):
                shards.names.discard(named)
                done[named] = value

    def _look_at_walls(self, told: Told) -> None:
        if told.has_seccomp:
            return
        if self._required:
            raise EngineError(f"{told.machine}: {NO_SECCOMP}")
        if not self._warned:
            LOG.warning("%s: %s", told.machine, NO_SECCOMP)
            self._warned = True


@dataclass
class Shards(Generic[Key]):
    """Keys that were given out or are about to be.

    Args:
        give: gives a shard out.
        running: the names of the keys of each shard that was, by its reference.
        names: of all keys whose results are not there.
        given: how many keys were given out so far.
    """

    give: Callable[[Sequence[Key]], Any]
    running: dict[Any, list[bytes]] = field(default_factory=dict)
    names: set[bytes] = field(default_factory=set)
    given: int = 0
    _next: list[tuple[bytes, Key]] = field(default_factory=list)

    def size(self, most: int) -> int:
        """How many keys to put into a shard: few at first, so that small jobs are spread over all cores."""
        return min(LARGEST, 1 + self.given // (2 * most))

    def add(self, name: bytes, key: Key) -> None:
        """Have a key be part of the next shard."""
        self._next.append((name, key))
        self.names.add(name)

    def send(self) -> None:
        """Give the next shard out, if anything is in it."""
        if self._next:
            self.running[self.give([key for _, key in self._next])] = [name for name, _ in self._next]
            self.given += len(self._next)
            self._next = []


# --- at the other end


@dataclass(frozen=True)
class Told:
    """What comes back of a shard.

    Args:
        values: the results.
        has_seccomp: whether no wall is missing there.
        machine: its name.
        complaint: why there are no results; None where there are.
    """

    values: tuple[Any, ...] = ()
    has_seccomp: bool = True
    machine: str = ""
    complaint: str | None = None


OURS = __version__, ".".join(platform.python_version_tuple()[:2])


def call_all(function: Callable[[Lane, Any], Any], keys: Sequence[Any], theirs: tuple[str, str]) -> Told:
    """Call a function with each key, in a process of Ray's, whose lane stays for the next shard.

    Args:
        function: what to call.
        keys: what to call it with.
        theirs: the versions of codebotler and Python of who asks: another one might judge otherwise.
    """
    machine = platform.node()
    if theirs != OURS:
        versions = [f"codebotler {version} with Python {python}" for version, python in (OURS, theirs)]
        return Told(machine=machine, complaint=f"{machine} has {versions[0]}, and not {versions[1]}")
    try:
        lane = own_lane()
        values = tuple(function(lane, key) for key in keys)
    except EngineError as error:
        return Told(machine=machine, complaint=f"{machine}: {error}")
    return Told(values, lane.has_seccomp, machine)


def call_both(
    function: Callable[[Lane, Key], Ran], then: Callable[[Ran], Value], lane: Lane, key: Key
) -> Value:
    """What comes of a key after both functions."""
    return then(function(lane, key))


@cache
def own_lane() -> Lane:
    """The lane of this process; it ends with it."""
    return Lane()


# --- Ray


def _imported() -> Any:  # noqa: ANN401 - the extra has no types here
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # else it calls home
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # its warning about accelerators
    if is_here_only():
        if "ray" in sys.modules and os.environ.get(LOOPBACK_ONLY) != "0":
            raise BadInput(f"Ray would let other machines in: set {LOOPBACK_ONLY}=0 before it is imported")
        os.environ.setdefault(LOOPBACK_ONLY, "0")
    try:
        import ray  # noqa: PLC0415 - an extra, which starts slowly
    except ImportError:
        raise BadInput("the engine ray needs Ray; pip install 'codebotler[ray]'") from None
    return ray


LOOPBACK_ONLY = "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"
"""Set to 0 before Ray is imported, it has a cluster of one machine listen there only, and looks for one
there. Else Ray takes this machine's address in the network for 127.0.0.1, and waits for ever."""


def _connect(ray: Any) -> None:  # noqa: ANN401 - a module without types
    quiet = {"logging_level": logging.ERROR, "log_to_driver": False}
    address = named_address()
    try:
        if address != LOCAL:
            ray.init(address="auto", **quiet)
            return
    except ConnectionError:
        if address:  # it answered before
            raise outside(address) from None
    try:
        ray.init(address="local", include_dashboard=False, **quiet)
    except OSError as error:  # such as a folder in RAY_TMPDIR whose name is too long for sockets
        raise BadInput(f"Ray cannot be started here: {error}") from None


def _fetched(ray: Any, reference: Any) -> Told:  # noqa: ANN401 - a module without types
    try:
        told: Told = ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    except ray.exceptions.RayError as error:
        raise EngineError(f"Ray lost a shard for good: {str(error).splitlines()[0]}") from None
    return told
