"""Check a program before a robot moves: its source, its contract, and its runs in sampled worlds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from codebotler.checking.contracts.of_program import derive_contract
from codebotler.checking.contracts.text import contract_rows
from codebotler.checking.exploration import CATCHES_ERRORS, explore
from codebotler.checking.problems import CheckResult, Problem, RuleProof, RuleVerdict, Sample
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
from codebotler.checking.source.static import read_program, read_rooms
from codebotler.checking.source.written_arguments import read_arguments
from codebotler.core.errors import UserError, expect_list
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.labels import check_label
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.pool import SHARED_POOL, WorkerPool, shared_pool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import AS_WRITTEN

DEFAULT_START = "start_loc"  # the name in the paper's prompt
PLACEHOLDER_ROOMS = ("room 1", "room 2")  # for a program that visits all rooms but names none


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
    is_wanted: Callable[[], bool] = lambda: True,
) -> CheckResult:
    """Find the problems of a program by static analysis and by runs in sampled worlds.

    Args:
        program: its source, which may even contain syntax errors.
        rooms: the names of the rooms, in order, as in a world file; by default those in the program.
        start: the robot's first room, one of `rooms` if given; by default `start_loc` or else the first room.
        samples: how many worlds to sample, from 1 to 10,000.
        seed: the random seed, which gives the same worlds on all machines.
        strict: whether to randomize even facts that the program assumes, such as that a person is there.
        skills: the skills that the program may call.
        pool: runs the program on one of its workers; by default the pool of this process.
        room_map: a map that replaces `rooms` and `start` if more is known about the rooms.
        house_rules: the rules that the program must keep in every world.
        explores: whether to find the contract and a proof for each rule, by running the program in all
            worlds that it can tell apart, within a limit.
        is_wanted: returns False to end the check; called before each run, on another thread.

    Raises:
        UnwantedCheckError: the check is no longer wanted.
        UserError: a room's name is not a regular expression, the start is not a room, or the number of
            samples is out of range.
        EngineError: no isolated process could be started.
    """
    expect_list(rooms, "the rooms")
    settings = CheckSettings(samples, seed, strict, AS_WRITTEN, skills, tuple(house_rules), is_wanted)
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
    """Check a program on a worker that no other thread uses, reusing its earlier runs in `known`."""
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
    """Check several programs, each with its own rooms. This is faster than checking one after another."""
    samplers = first_samplers(settings)[:WORLDS_AT_ONCE]
    runs = [SampledRuns(program, room_map, samplers, settings) for program, room_map in programs]
    return [
        check_on(worker, one.program, one.room_map, settings, first)
        for one, first in zip(runs, run_together(worker, runs), strict=True)
    ]


# --- the rooms


def room_map_for(
    program: str, rooms: Sequence[str] | None = None, start: str | None = None, *, skills: SkillTable = SKILLS
) -> RoomMap:
    """Return a map of the given rooms and start, or guess them from the program's source.

    Args:
        program: its source.
        rooms: the names of the rooms, in order; None if they are unknown.
        start: the room where the robot starts; by default `start_loc` if it is a room, else the first room.
        skills: the skills that the program may call.

    Raises:
        UserError: a room's name is not a regular expression, or the start is not a room.
    """
    if rooms is not None:
        for room in rooms:
            try:
                check_label(room)
            except ValueError as error:
                raise UserError(f'the name of a room is "{room}", but {error}') from None
        names = tuple(dict.fromkeys(rooms)) or (start or DEFAULT_START,)
        start = start or (DEFAULT_START if DEFAULT_START in names else names[0])
        if start not in names:
            raise UserError(f'the robot starts in "{start}", but the rooms are: {", ".join(names)}')
        return RoomMap(names, start)
    start = start or DEFAULT_START
    rooms_in_text, lists_all = read_rooms(program, skills)
    named = [room for room in rooms_in_text if room != start]
    if len(named) < len(PLACEHOLDER_ROOMS) and lists_all:
        named += [room for room in PLACEHOLDER_ROOMS if room not in named]
    return RoomMap((*named, start), start, guessed=True)


# --- contracts and proofs


def extend_check(worker: Worker, program: str, found: CheckResult, settings: CheckSettings) -> CheckResult:
    """Explore a program's worlds, and return its check with a contract, rule proofs and further problems.

    Args:
        worker: a worker that no other thread uses.
        program: the program.
        found: the result of its check, returned unchanged if it has no samples.
        settings: the settings of the check.
    """
    if not found.samples:
        return found
    explored = explore(worker, program, found.room_map, settings)
    written = read_arguments(program, settings.skills)
    is_complete = explored.is_complete and explored.is_steady and not written.reads_clock
    samples, problems, proofs = list(found.samples), list(found.problems), []
    ends_if_a_skill_fails = not CATCHES_ERRORS.search(program)
    called = (settings.skills[name] for name in {call.skill for call in explored.calls} - {*SKILLS})
    hidden = {
        getattr(row.recording, "kind", "") for row in called if not row.is_idle
    }  # events of such skills
    for rule in settings.house_rules:
        # Rules do not see what else a custom skill does.
        hides = bool(hidden) and not {one.kind for one in elements(rule.formula)} <= hidden
        sampler = explored.violations.get(rule.name)
        number = next((one.samples[0] for one in found.problems if one.rule == rule.name), None)
        if sampler is not None and number is None:
            how = replace(settings, house_rules=(rule,), strict=sampler.strict)
            number = len(samples)
            runs = SampledRuns(program, found.room_map, [sampler], how)
            samples.append(replace(runs.samples_on(worker, {})[0], number=number, is_chosen=True))
            problems += group_failures(samples[number:], found.room_map)
        is_proven = is_complete and not hides
        verdict: RuleVerdict = "possible" if number is not None else "never" if is_proven else "unknown"
        proofs.append(RuleProof(rule.name, verdict, explored.cases, number, ends_if_a_skill_fails))
    if any(not problem.rule for problem in problems):  # a robot may get further than these runs
        explored = replace(explored, is_complete=False)
    contract = derive_contract(explored, written, found.room_map, settings.skills)
    problems.sort(key=lambda problem: problem.line or 0)
    return replace(
        found, problems=tuple(problems), samples=tuple(samples), proofs=tuple(proofs), contract=contract
    )


def with_contract_problems(found: CheckResult, allowed: Contract, skills: SkillTable) -> CheckResult:
    """Return a check with a further problem for each skill that may do more than the contract allows."""
    if found.contract is None:
        return found
    new = [" ".join(filter(None, row)) for row in contract_rows(found.contract.excess_over(allowed), skills)]
    messages = [f"the program may {what}, which the contract does not allow" for what in new]
    problems = (Problem("OutsideContract", message) for message in messages)
    return replace(found, problems=(*found.problems, *problems))
