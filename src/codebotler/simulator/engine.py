"""Runs each distinct pair of a program and a world once, in isolation, and returns the outcomes in order."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby
from operator import itemgetter

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome
from codebotler.core.world import World
from codebotler.simulator.pool import WorkerPool, cores
from codebotler.simulator.settings import PAPER_SETTINGS, SimulationSettings
from codebotler.simulator.worlds.robot import SimulatedRobot


def run(
    pairs: Iterable[tuple[str, World]],
    *,
    workers: int | None = None,
    settings: SimulationSettings = PAPER_SETTINGS,
    skills: SkillTable = SKILLS,
    require_isolation: bool = False,
) -> Iterator[Outcome]:
    """Run each program in its world, and yield the outcomes in order. Equal pairs run only once.

    `workers` is the number of runs at the same time (by default one per core). If `require_isolation` is
    true, raise EngineError where the kernel does not support seccomp; otherwise, warn.
    """
    with WorkerPool(workers or cores(), require_isolation=require_isolation) as pool:

        def run_pairs(pairs: Sequence[tuple[str, World]]) -> list[Outcome]:
            jobs = [
                (source, [partial(SimulatedRobot, world, settings, skills) for _, world in same])
                for source, same in groupby(pairs, key=itemgetter(0))
            ]
            return [outcome for outcomes in pool.here().run_all(jobs) for outcome in outcomes]

        worlds: dict[World, int] = {}

        def name(pair: tuple[str, World]) -> bytes:
            source, world = pair
            return digest(source, str(worlds.setdefault(world, len(worlds))))

        yield from pool.map_distinct(run_pairs, pairs, name=name)


def digest(*texts: str) -> bytes:
    """Return the SHA-256 hash of several texts. The texts "ab", "c" and "a", "bc" have different hashes."""
    hashed = hashlib.sha256()
    for text in texts:
        data = text.encode(errors="surrogatepass")
        hashed.update(len(data).to_bytes(8, "big") + data)
    return hashed.digest()
