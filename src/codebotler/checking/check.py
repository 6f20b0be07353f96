"""The check of a program before a robot moves: its text, then runs in sampled worlds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from typing import Protocol

from codebotler.checking.problems import Check, Sample
from codebotler.checking.room_names import MOST_ROOMS
from codebotler.checking.sampled import (
    SAMPLES,
    CheckSettings,
    SampledRuns,
    failures,
    first_samplers,
    run_samples,
    sampled_runs,
)
from codebotler.checking.static import read_program, read_rooms
from codebotler.core.errors import UserError, expect_list
from codebotler.core.labels import check_label
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.pool import SHARED, WorkerPool, shared_pool
from codebotler.simulator.sampled_robot import AS_WRITTEN, RoomMap
from codebotler.simulator.worker import Meanwhile, Worker

START = "start_loc"  # models know it by this name from the paper
AT_ONCE = 16  # worlds that a worker is given
GUESSES = 3  # times that the rooms to which a program drives are added to those in its text
SOME_ROOMS = ("room 1", "room 2")  # for a program that drives to all rooms and names none


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
    """Find what is wrong with a program, by its text and by runs in sampled worlds.

    Args:
        program: its source, which need not even parse.
        rooms: the names of the rooms, in order, as a world file has them; by default those in the program.
        start: the room in which the robot starts, one of `rooms` where there are any; by default `start_loc`
            if that is a room, or else the first one.
        samples: how many worlds to sample, 1 to 10,000.
        seed: of the worlds: the same ones on every machine.
        strict: whether to draw also what the program takes for granted.
        skills: what the program may call.
        workers: how many runs go on at the same time, in a pool that is started for this check alone.
        pool: what runs the programs; without it and `workers`, the pool of this process, which stays.
        room_map: the rooms and the start, in place of those two, where more is known of them.
        house_rules: what a program must keep to in every world.

    Raises:
        UserError: the name of a room is no regular expression, the robot starts in none of the rooms, or the
            number of samples is out of range.
        EngineError: no isolated process could be started.
    """
    expect_list(rooms, "the rooms")
    settings = CheckSettings(samples, seed, strict, AS_WRITTEN, skills, tuple(house_rules))
    if room_map is None and (rooms, start) != (None, None):
        room_map = _room_map(program, rooms, start, skills)
    with _opened(pool, workers) as opened:

        def share(room_map: RoomMap, samplers: Sequence[FactSampler]) -> list[Sample]:
            return run_samples(opened.here(), program, room_map, samplers, settings)

        def run(room_map: RoomMap, samplers: Sequence[FactSampler], *, meanwhile: Meanwhile) -> list[Sample]:
            shares = [samplers[start :: opened.workers] for start in range(opened.workers)]
            futures = [opened.submit(share, room_map, each) for each in shares if each]
            meanwhile()
            return [sample for future in futures for sample in future.result()]

        if samples > AT_ONCE and not opened.is_here:
            known = room_map or _room_map(program, None, None, skills)
            return _checked(program, known, settings, run, AT_ONCE * opened.workers)
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
            SHARED.end()
            raise


def check_on(
    worker: Worker,
    program: str,
    room_map: RoomMap | None = None,
    settings: CheckSettings | None = None,
) -> Check:
    """The same check on one worker, the calling thread's own, for checking many programs at the same time."""
    how = settings or CheckSettings()

    def run(rooms: RoomMap, samplers: Sequence[FactSampler], *, meanwhile: Meanwhile) -> list[Sample]:
        return run_samples(worker, program, rooms, samplers, how, meanwhile=meanwhile)

    worker.begin_to_prepare(program, how.skills, how.rules)
    with worker.one_child():
        return _checked(program, room_map or _room_map(program, None, None, how.skills), how, run)


def checks_on(
    worker: Worker, programs: Sequence[tuple[str, RoomMap]], settings: CheckSettings
) -> list[Check]:
    """The same checks of several programs of one caller, whose first runs may share a process."""
    samplers = first_samplers(settings)[:AT_ONCE]
    first = [SampledRuns(program, room_map, samplers, settings) for program, room_map in programs]
    known: list[dict[int, Outcome]] = [{} for _ in programs]
    for (number, run), outcome in worker.run_tame([runs.job for runs in first]).items():
        known[number][run] = outcome

    def checked(number: int) -> Check:
        program, room_map = programs[number]

        def run(rooms: RoomMap, wanted: Sequence[FactSampler], *, meanwhile: Meanwhile) -> list[Sample]:
            if rooms == room_map and wanted == samplers:
                return first[number].samples(worker, known[number])
            return run_samples(worker, program, rooms, wanted, settings, meanwhile=meanwhile)

        with worker.one_child():
            return _checked(program, room_map, settings, run)

    return list(map(checked, range(len(programs))))


def _checked(
    program: str, room_map: RoomMap, settings: CheckSettings, run: SampleRunner, width: int = AT_ONCE
) -> Check:
    read = cache(partial(read_program, program, room_map, settings.skills))
    ran = sampled_runs(partial(run, meanwhile=read), room_map, settings, width)
    problems = list(read().problems)
    if not read().compiles:
        return Check(tuple(problems), (), room_map, settings.seed, settings.strict)
    for _ in range(GUESSES if room_map.guessed else 0):
        wider = _widened(room_map, ran)
        if wider == room_map:
            break
        room_map, ran = wider, sampled_runs(partial(run, meanwhile=read), wider, settings, width)
    blamed = {problem.line for problem in problems}
    problems += [problem for problem in failures(ran, room_map) if problem.line not in blamed]
    problems.sort(key=lambda problem: problem.line or 0)
    return Check(tuple(problems), tuple(ran), room_map, settings.seed, settings.strict)


class SampleRunner(Protocol):
    """What runs a program in several worlds."""

    def __call__(
        self, room_map: RoomMap, samplers: Sequence[FactSampler], /, *, meanwhile: Meanwhile
    ) -> list[Sample]:
        """Run it, and call `meanwhile` once that is only waited for."""
        ...


# --- rooms


def _room_map(program: str, rooms: Sequence[str] | None, start: str | None, skills: SkillTable) -> RoomMap:
    if rooms is not None:
        for room in rooms:
            try:
                check_label(room)
            except ValueError as error:
                raise UserError(f'the room is "{room}", but {error}') from None
        names = tuple(dict.fromkeys(rooms)) or (start or START,)
        start = start or (START if START in names else names[0])
        if start not in names:
            raise UserError(f'the robot starts in "{start}", but the rooms are: {", ".join(names)}')
        return RoomMap(names, start)
    start = start or START
    rooms_in_text, lists_all = read_rooms(program, skills)
    named = [room for room in rooms_in_text if room != start]
    if len(named) < len(SOME_ROOMS) and lists_all:
        named += [room for room in SOME_ROOMS if room not in named]
    return RoomMap((*named, start), start, guessed=True)


def _widened(room_map: RoomMap, ran: Iterable[Sample]) -> RoomMap:
    """The rooms, and those that the program drove to although its text does not name them."""
    requests = (event.text for sample in ran for event in sample.outcome.trace if event.kind == "goto")
    driven = (room_map.room(request) for request in requests)
    found = dict.fromkeys([*room_map.rooms, *(room for room in driven if room is not None)])
    rooms = [room for room in found if room != room_map.start][:MOST_ROOMS]
    return replace(room_map, rooms=(*rooms, room_map.start))
