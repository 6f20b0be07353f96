"""Chooses the engine that runs programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from roboeval.evaluation.engines.engine import OpenEngine

MAX_WORKERS_OF_PROCESS = 2  # the most workers that one process can keep busy
MIN_PROGRAMS_FOR_PROCESSES = 5_000  # with fewer programs, starting processes costs more than it saves


@contextmanager
def engine_named(
    name: Literal["local", "ray"], workers: int | None, **isolation: bool
) -> Iterator[Callable[[int], OpenEngine]]:
    """Yield a function that takes the number of programs to run and returns the engine for them.

    By default, `workers` depends on the number of cores. `isolation` holds options of `WorkerPool`.
    """
    if name == "local":
        from codebotler.simulator.pool import WorkerPool, cores
        from roboeval.evaluation.engines.engine import Local

        workers = workers or cores()
        with closing(WorkerPool(workers, **isolation)) as pool:

            def local(programs: int) -> OpenEngine:
                if programs < MIN_PROGRAMS_FOR_PROCESSES or min(workers, cores()) <= MAX_WORKERS_OF_PROCESS:
                    return Local(pool)
                from roboeval.evaluation.engines.processes import Processes

                pool.close()  # the pool has already warned about missing isolation
                return nullcontext(Processes(workers, **isolation))

            yield local
        return
    from roboeval.evaluation.engines.ray import RayCluster

    cluster = RayCluster(workers, **isolation)  # may fail, so create it before anything is written
    yield lambda _: cluster
