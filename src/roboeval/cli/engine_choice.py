"""The engine that a command runs programs with."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

from roboeval.cli.output import fail

if TYPE_CHECKING:
    from roboeval.evaluation.engines import OpenEngine

WORKERS_OF_A_PROCESS = 2  # workers that one process keeps busy


PROGRAMS_FOR_PROCESSES = 5_000  # programs for which it is worth while to start processes


@contextmanager
def engine_named(name: str, workers: int | None, **isolation: bool) -> Iterator[Callable[[int], OpenEngine]]:
    """The engine with this name for so many programs, isolated as `WorkerPool` says.

    A worker starts beside what follows.
    """
    if name == "local":
        from codebotler.simulator.pool import WorkerPool, cores
        from roboeval.evaluation.engines import Local

        workers = workers or cores()
        with closing(WorkerPool(workers, **isolation)) as pool:

            def local(programs: int) -> OpenEngine:
                if programs < PROGRAMS_FOR_PROCESSES or min(workers, cores()) <= WORKERS_OF_A_PROCESS:
                    return Local(pool)
                from roboeval.evaluation.processes import Processes

                pool.close()  # it has warned if need be
                return Processes(workers, **isolation)

            yield local
        return
    if name != "ray":
        fail(f'there is no engine "{name}"; use local or ray')
    from roboeval.evaluation.ray import RayCluster

    cluster = RayCluster(workers, **isolation)  # refused before anything is written
    yield lambda _: cluster
