"""Check a program before a robot moves: analyse its source, then run it in sampled worlds."""

from __future__ import annotations

from collections.abc import Sequence

from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.proof import extend_check
from codebotler.checking.rooms import room_map_for
from codebotler.checking.sampled import (
    DEFAULT_SAMPLES,
    WORLDS_AT_ONCE,
    CheckSettings,
    SampledRuns,
    first_samplers,
    group_failures,
    run_in_sampled_worlds,
    run_together,
)
from codebotler.checking.source.static import read_program
from codebotler.core.errors import expect_list
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.pool import SHARED_POOL, WorkerPool, shared_pool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import AS_WRITTEN


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
    known: Sequence[Sample] = (),
) -> CheckResult:
    """Check one program on a worker that no other thread uses. `known` are its runs so far, if any."""
    how = settings or CheckSettings()
    room_map = room_map or room_map_for(program, skills=how.skills)
    with worker.one_child():
        compiles, flaws = read_program(program, room_map, how.skills)
        ran = run_in_sampled_worlds(worker, program, room_map, how, known) if compiles else []
    blamed = {problem.line for problem in flaws}
    failures = (problem for problem in group_failures(ran, room_map) if problem.line not in blamed)
    problems = sorted((*flaws, *failures), key=lambda problem: problem.line or 0)
    return CheckResult(tuple(problems), tuple(ran), room_map, how.seed, how.strict)


def check_together(
    worker: Worker, programs: Sequence[tuple[str, RoomMap]], settings: CheckSettings
) -> list[CheckResult]:
    """Check several programs on one worker, where their first runs may share a process."""
    samplers = first_samplers(settings)[:WORLDS_AT_ONCE]
    runs = [SampledRuns(program, room_map, samplers, settings) for program, room_map in programs]
    return [
        check_on(worker, one.program, one.room_map, settings, first)
        for one, first in zip(runs, run_together(worker, runs), strict=True)
    ]
