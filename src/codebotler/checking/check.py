"""The check of a program before a robot moves: its text, then runs in sampled worlds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from typing import Protocol

from codebotler.checking.problems import Check, Sample
from codebotler.checking.rooms import room_map_for, widened
from codebotler.checking.sampled import (
    SAMPLES,
    CheckSettings,
    SampledRuns,
    failures,
    first_samplers,
    run_samples,
    sampled_runs,
)
from codebotler.checking.static import read_program
from codebotler.core.errors import expect_list
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.pool import SHARED_POOL, WorkerPool, shared_pool
from codebotler.simulator.sampled_robot import AS_WRITTEN, RoomMap
from codebotler.simulator.worker import Meanwhile, Worker

WORLDS_AT_ONCE = 16  # worlds that a worker is given
WIDENINGS = 3  # times that the rooms to which a program drives are added to those in its text


def check(
    program: str,
    *,
    rooms: Sequence[str] | None = None,
    start: str | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
    strict: bool = False,
    skills: SkillTable = SKILLS,
    workers: int | None = None,
    pool: WorkerPool | None = None,
    room_map: RoomMap | None = None,
    house_rules: Sequence[Rule] = (),
) -> Check:
    """Find the problems of a program, by its text and by runs in sampled worlds.

    Args:
        program: its source, which need not even parse.
        rooms: the names of the rooms, in order, as a world file has them; by default those in the program.
        start: the room in which the robot starts, one of `rooms` where there are any; by default `start_loc`
            if that is a room, or else the first one.
        samples: how many worlds to sample, 1 to 10,000.
        seed: of the worlds: the same ones on every machine.
        strict: whether to randomize also facts that the program takes for granted.
        skills: the skills that the program may call.
        workers: how many runs go on at the same time, in a pool that only this check uses.
        pool: runs the programs; without it and `workers`, the pool of this process is used and kept.
        room_map: the rooms and the start, in place of those two, where more is known of them.
        house_rules: the rules that a program must keep in every world.

    Raises:
        UserError: the name of a room is no regular expression, the robot starts in none of the rooms, or the
            number of samples is out of range.
        EngineError: no isolated process could be started.
    """
    expect_list(rooms, "the rooms")
    settings = CheckSettings(samples, seed, strict, AS_WRITTEN, skills, tuple(house_rules))
    if room_map is None and (rooms, start) != (None, None):
        room_map = room_map_for(program, rooms, start, skills=skills)
    with _opened(pool, workers) as opened:
        if samples > WORLDS_AT_ONCE and not opened.is_here:
            known = room_map or room_map_for(program, skills=skills)
            run = _PoolRunner(opened, program, settings)
            return _checked(program, known, settings, run, WORLDS_AT_ONCE * opened.workers)
        return opened.call(lambda: check_on(opened.here(), program, room_map, settings))


@contextmanager
def _opened(pool: WorkerPool | None, workers: int | None) -> Iterator[WorkerPool]:
    """A given pool, a new one with so many workers, or that of this process, which an interrupt ends."""
    if pool is not None:
        yield pool
    elif workers is not None:
        with WorkerPool(workers) as opened:
            yield opened
    else:
        try:
            yield shared_pool()
        except KeyboardInterrupt:  # or the program would run on, and hold up the end of this process
            SHARED_POOL.end()
            raise


def check_on(
    worker: Worker,
    program: str,
    room_map: RoomMap | None = None,
    settings: CheckSettings | None = None,
) -> Check:
    """Check one program on one worker, which belongs to the calling thread, for checks at the same time."""
    how = settings or CheckSettings()
    worker.begin_to_prepare(program, how.skills, how.simulation)
    run = partial(run_samples, worker, program, settings=how)
    with worker.one_child():
        return _checked(program, room_map or room_map_for(program, skills=how.skills), how, run)


def checks_on(
    worker: Worker, programs: Sequence[tuple[str, RoomMap]], settings: CheckSettings
) -> list[Check]:
    """Check several programs of one caller on one worker; their first runs may share a process."""
    samplers = first_samplers(settings)[:WORLDS_AT_ONCE]
    first = [SampledRuns(program, room_map, samplers, settings) for program, room_map in programs]
    known: list[dict[int, Outcome]] = [{} for _ in programs]
    for (number, run), outcome in worker.run_tame([runs.job for runs in first]).items():
        known[number][run] = outcome
    found = []
    for runs, outcomes in zip(first, known, strict=True):
        with worker.one_child():
            run_more = _WorkerRunner(worker, runs, outcomes)
            found.append(_checked(runs.program, runs.room_map, settings, run_more))
    return found


class SampleRunner(Protocol):
    """Runs a program in several worlds."""

    def __call__(
        self, room_map: RoomMap, samplers: Sequence[FactSampler], /, *, meanwhile: Meanwhile
    ) -> list[Sample]:
        """Run it, and call `meanwhile` once nothing is left but to wait."""
        ...


@dataclass(frozen=True)
class _PoolRunner:
    """Runs a program on all workers of a pool."""

    pool: WorkerPool
    program: str
    settings: CheckSettings

    def __call__(
        self, room_map: RoomMap, samplers: Sequence[FactSampler], /, *, meanwhile: Meanwhile
    ) -> list[Sample]:
        shares = [samplers[start :: self.pool.workers] for start in range(self.pool.workers)]
        futures = [self.pool.submit(self._run_share, room_map, each) for each in shares if each]
        meanwhile()
        return [sample for future in futures for sample in future.result()]

    def _run_share(self, room_map: RoomMap, samplers: Sequence[FactSampler]) -> list[Sample]:
        return run_samples(self.pool.here(), self.program, room_map, samplers, self.settings)


@dataclass(frozen=True)
class _WorkerRunner:
    """Runs a program on one worker, of which the outcomes of some first runs are known."""

    worker: Worker
    first: SampledRuns
    outcomes: Mapping[int, Outcome]

    def __call__(
        self, room_map: RoomMap, samplers: Sequence[FactSampler], /, *, meanwhile: Meanwhile
    ) -> list[Sample]:
        first = self.first
        if room_map == first.room_map and samplers == first.samplers:
            return first.samples_on(self.worker, self.outcomes)
        return run_samples(
            self.worker, first.program, room_map, samplers, first.settings, meanwhile=meanwhile
        )


def _checked(
    program: str, room_map: RoomMap, settings: CheckSettings, run: SampleRunner, width: int = WORLDS_AT_ONCE
) -> Check:
    read = cache(partial(read_program, program, room_map, settings.skills))
    ran = sampled_runs(partial(run, meanwhile=read), room_map, settings, width)
    problems = list(read().problems)
    if not read().compiles:
        return Check(tuple(problems), (), room_map, settings.seed, settings.strict)
    for _ in range(WIDENINGS if room_map.guessed else 0):
        wider = widened(room_map, ran)
        if wider == room_map:
            break
        room_map, ran = wider, sampled_runs(partial(run, meanwhile=read), wider, settings, width)
    blamed = {problem.line for problem in problems}
    problems += [problem for problem in failures(ran, room_map) if problem.line not in blamed]
    problems.sort(key=lambda problem: problem.line or 0)
    return Check(tuple(problems), tuple(ran), room_map, settings.seed, settings.strict)
