"""Check a program before a robot moves: analyse its source, then run it in sampled worlds."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.proof import extend_check
from codebotler.checking.rooms import add_visited_rooms, room_map_for
from codebotler.checking.sampled import (
    DEFAULT_SAMPLES,
    WORLDS_AT_ONCE,
    CheckSettings,
    RunInWorlds,
    SampledRuns,
    first_samplers,
    group_failures,
    run_in_sampled_worlds,
    run_samples,
    run_together,
)
from codebotler.checking.static import read_program
from codebotler.core.errors import expect_list
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.pool import SHARED_POOL, WorkerPool, shared_pool
from codebotler.simulator.room_map import RoomMap
from codebotler.simulator.sampled_robot import AS_WRITTEN
from codebotler.simulator.worker import Worker

MAX_WIDENINGS = 3  # rounds that add rooms which the program visits but its source does not name


def check(
    program: str,
    *,
    rooms: Sequence[str] | None = None,
    start: str | None = None,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
    strict: bool = False,
    skills: SkillTable = SKILLS,
    pool: WorkerPool | None = None,
    room_map: RoomMap | None = None,
    house_rules: Sequence[Rule] = (),
    explores: bool = False,
) -> CheckResult:
    """Find the problems of a program by static analysis and by runs in sampled worlds.

    Args:
        program: its source, which may even contain syntax errors.
        rooms: the names of the rooms, in order, as in a world file; by default those in the program.
        start: the robot's first room, one of `rooms` if given; by default `start_loc` or else the first room.
        samples: how many worlds to sample, from 1 to 10,000.
        seed: the random seed, which gives the same worlds on all machines.
        strict: whether to randomize even facts that the program takes for granted.
        skills: the skills that the program may call.
        pool: the pool one of whose workers runs the program; by default the pool of this process.
        room_map: a map that replaces `rooms` and `start` if more is known about the rooms.
        house_rules: the rules that the program must keep in every world.
        explores: whether to explore all worlds that the program can tell apart, up to a budget, for its
            contract and for a proof of each rule.

    Raises:
        UserError: a room's name is not a regular expression, the start is not a room, or the number of
            samples is out of range.
        EngineError: no isolated process could be started.
    """
    expect_list(rooms, "the rooms")
    settings = CheckSettings(samples, seed, strict, AS_WRITTEN, skills, tuple(house_rules))
    if room_map is None and (rooms, start) != (None, None):
        room_map = room_map_for(program, rooms, start, skills=skills)
    opened = pool or shared_pool()

    def check_here() -> CheckResult:
        found = check_on(opened.here(), program, room_map, settings)
        return extend_check(opened.here(), program, found, settings) if explores else found

    try:
        return opened.call(check_here)
    except KeyboardInterrupt:  # else the program would continue and delay the exit of this process
        if pool is None:
            SHARED_POOL.end()
        raise


def check_on(
    worker: Worker,
    program: str,
    room_map: RoomMap | None = None,
    settings: CheckSettings | None = None,
) -> CheckResult:
    """Check one program on a worker that no other thread uses."""
    how = settings or CheckSettings()
    room_map = room_map or room_map_for(program, skills=how.skills)
    with worker.one_child():
        return _run_check(program, room_map, how, partial(run_samples, worker, program, settings=how))


def check_together(
    worker: Worker, programs: Sequence[tuple[str, RoomMap]], settings: CheckSettings
) -> list[CheckResult]:
    """Check several programs on one worker, where their first runs may share a process."""
    samplers = first_samplers(settings)[:WORLDS_AT_ONCE]
    runs = [SampledRuns(program, room_map, samplers, settings) for program, room_map in programs]
    found = []
    for one, first in zip(runs, run_together(worker, runs), strict=True):
        with worker.one_child():
            found.append(_run_check(one.program, one.room_map, settings, _runner_after(worker, one, first)))
    return found


def _runner_after(worker: Worker, runs: SampledRuns, first: list[Sample]) -> RunInWorlds:
    """Return a function that runs a program on a worker and reuses its first runs."""

    def run(room_map: RoomMap, samplers: Sequence[FactSampler]) -> list[Sample]:
        if room_map == runs.room_map and samplers == runs.samplers:
            return first
        return run_samples(worker, runs.program, room_map, samplers, runs.settings)

    return run


def _run_check(program: str, room_map: RoomMap, settings: CheckSettings, run: RunInWorlds) -> CheckResult:
    compiles, flaws = read_program(program, room_map, settings.skills)
    if not compiles:
        return CheckResult(flaws, (), room_map, settings.seed, settings.strict)
    ran = run_in_sampled_worlds(run, room_map, settings)
    for _ in range(MAX_WIDENINGS if room_map.guessed else 0):
        wider = add_visited_rooms(room_map, ran)
        if wider == room_map:
            break
        room_map, ran = wider, run_in_sampled_worlds(run, wider, settings)
    blamed = {problem.line for problem in flaws}
    failures = (problem for problem in group_failures(ran, room_map) if problem.line not in blamed)
    problems = sorted((*flaws, *failures), key=lambda problem: problem.line or 0)
    return CheckResult(tuple(problems), tuple(ran), room_map, settings.seed, settings.strict)
