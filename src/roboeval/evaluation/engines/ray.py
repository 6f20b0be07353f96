"""Runs programs on a Ray cluster, in shards that Ray retries if a machine is lost."""

from __future__ import annotations

import logging
import os
import platform
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from codebotler import __version__
from codebotler.core.errors import UserError, installed
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import NO_SECCOMP, DistinctKeys, ResultFile
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.engines.engine import (
    PYTHON_VERSION,
    RawResult,
    RunPrograms,
    Work,
    WorkResult,
    own_worker,
)

_log = logging.getLogger("roboeval.ray")
VERSIONS = f"codebotler {__version__} with Python {PYTHON_VERSION}"

SHARDS_PER_CORE = 2  # submit more shards than cores, so that no core waits for this process
RETRIES = 20  # attempts to rerun a shard whose machine was lost
RAY_POLL_SECONDS = 10  # time between checks that the cluster still has cores
RAY_CONNECT_SECONDS = 5


class RayCluster:
    """Runs programs on the Ray cluster at RAY_ADDRESS, or by default on the cluster of this machine.

    Without a cluster, or if RAY_ADDRESS is "local", it starts a cluster that only this machine can reach,
    and stops that cluster at the end. `workers` is the number of shards (batches of programs) at a time, by
    default two per core. Raises UserError if Ray is not installed or no cluster answers at the address.
    """

    def __init__(self, workers: int | None = None, **isolation: bool) -> None:
        self._workers, self._isolation = workers, isolation
        self._warned = False
        self._address = os.environ.get("RAY_ADDRESS") or "auto"
        current = Path(os.environ.get("RAY_TMPDIR", "/tmp"), "ray", "ray_current_cluster")  # noqa: S108 - the path that Ray uses
        starts = self._address == "local" or (self._address == "auto" and not current.exists())
        if starts:
            os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # listen on loopback only
        else:
            os.environ.setdefault("RAY_gcs_server_port_wait_time_s", "1")  # try once, for half a minute
        if self._address not in {"auto", "local"}:
            self._expect_listener()
        self._ray = _import_ray()

    def __enter__(self) -> Self:
        try:
            self._ray.init(include_dashboard=False, logging_level=logging.ERROR, log_to_driver=False)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise self._no_cluster(str(error.__cause__ or error).splitlines()[-1]) from None
        return self

    def __exit__(self, *_: object) -> None:
        self._ray.shutdown()

    def map_distinct(
        self, function: RunPrograms[RawResult], works: Iterable[Work], then: Callable[[RawResult], WorkResult]
    ) -> Iterator[WorkResult]:
        """Run each distinct program once, and yield `then(result)` for every work, as in `Engine`."""
        # Never cancel shards: Ray 2.60 can abort this process if a cancelled shard has just ended.
        remote = self._ray.remote(num_cpus=1, max_retries=RETRIES, retry_exceptions=False)(run_shard)
        functions = self._ray.put((function, then))
        distinct = DistinctKeys(works, lambda work: digest(*work))
        waiting = distinct.waiting
        shards: dict[Any, list[bytes]] = {}
        most = self._max_shards()
        with ResultFile() as done:
            while True:
                while len(shards) < most and (batch := distinct.batch(most)):
                    shard = remote.remote(functions, list(batch.values()), VERSIONS, self._isolation)
                    shards[shard] = list(batch)
                if not waiting:
                    return
                if waiting[0] in distinct.failed:
                    raise distinct.failed[waiting[0]]
                if waiting[0] in done:
                    yield done[waiting.popleft()]
                    continue
                for shard, values in self._wait_for_some(shards):
                    for name, value in zip(shards.pop(shard), values, strict=True):
                        done[name] = value
                most = self._max_shards()

    def _max_shards(self) -> int:
        return self._workers or SHARDS_PER_CORE * max(1, self._cores())

    def _cores(self) -> int:
        return int(self._ray.cluster_resources().get("CPU", 0))

    def _wait_for_some(self, shards: Iterable[Any]) -> Iterator[tuple[Any, list[Any]]]:
        ended, _ = self._ray.wait(list(shards), timeout=RAY_POLL_SECONDS)
        if not ended and not self._cores():
            raise EngineError("the Ray cluster has no cores left; add a node and try again")
        for shard in ended:
            try:
                values, warning = self._ray.get(shard)
            except self._ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except self._ray.exceptions.RayError as error:
                raise EngineError(f"Ray could not run some programs: {str(error).splitlines()[0]}") from None
            if warning and not self._warned:
                _log.warning(warning)
                self._warned = True
            yield shard, values

    def _expect_listener(self) -> None:
        # Without this check, Ray would try to connect for half a minute.
        host, _, port = self._address.rpartition(":")
        try:
            socket.create_connection((host.strip("[]"), int(port)), RAY_CONNECT_SECONDS).close()
        except (OSError, ValueError, OverflowError) as error:
            raise self._no_cluster(str(error)) from None

    def _no_cluster(self, why: str) -> UserError:
        return UserError(
            f"RAY_ADDRESS: no Ray cluster answers at {self._address} ({why}); start its head with "
            "`ray start --head`, or set RAY_ADDRESS=local to use this machine"
        )


def run_shard(
    functions: tuple[RunPrograms[RawResult], Callable[[RawResult], WorkResult]],
    works: Sequence[Work],
    versions: str,  # a machine with other versions might judge differently
    isolation: Mapping[str, bool],
) -> tuple[list[WorkResult], str | None]:
    """Run programs in a Ray process. Return results and any warning. Raise EngineError if versions differ."""
    machine = platform.node()
    if versions != VERSIONS:
        raise EngineError(f"{machine} has {VERSIONS}; install {versions} there")
    function, then = functions
    try:
        worker = own_worker(**isolation)
        values = [then(ran) for ran in function(worker, works)]
    except EngineError as error:
        raise EngineError(f"{machine}: {error}") from None
    return values, None if worker.has_seccomp else f"{machine}: {NO_SECCOMP}"


def _import_ray() -> Any:  # noqa: ANN401 - optional, so its types may be missing
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # otherwise Ray sends usage statistics
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # suppress a warning about accelerators
    with installed():
        import ray  # noqa: PLC0415 - an optional dependency that is slow to import
    return ray
