"""Checks a program before a robot moves: by its text, and in imagined worlds."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import lru_cache

from codebotler.checking.problems import Check, Problem, Sample, failures, no_room
from codebotler.checking.reachability import reach
from codebotler.checking.room_names import MOST_ROOMS, fixed_drives, lists_rooms, named_rooms
from codebotler.core.arguments import expect_skills, expect_text, expect_texts, expect_whole
from codebotler.core.errors import UserError
from codebotler.core.program import Problem as Flaw
from codebotler.core.program import Program, parsed
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.trace import Outcome, Status
from codebotler.simulator.engine import digest
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.robot import Behaviour
from codebotler.simulator.rules import Rules
from codebotler.simulator.sampled_robot import AS_WRITTEN, RoomMap, SampledRobot
from codebotler.simulator.worker import Worker

__all__ = [
    "MORE",
    "SAMPLES",
    "Check",
    "CheckSettings",
    "Problem",
    "Runner",
    "Sample",
    "check",
    "check_on",
    "imagined",
]

SAMPLES = 5
MOST_SAMPLES = 10_000
"""Of one check, which holds all of its runs."""

MORE = 20
"""Worlds that are drawn in addition where the program waits in vain in all that were drawn before."""

START = "start_loc"
"""Where the robot starts if nobody says otherwise; models know it by this name from the paper."""

GUESSES = 3
"""How often what a program drives to while it runs is added to the rooms, and it is run again."""

SOME_ROOMS = ("room 1", "room 2")
"""For a program that drives wherever it is told to, and names no room itself."""


@dataclass(frozen=True)
class CheckSettings:
    """How programs are checked.

    Args:
        samples: how many worlds to imagine, 1 to 10,000.
        seed: from which they are drawn: the same ones on every machine.
        strict: whether to draw also what the program takes for granted.
        rules: how a run is simulated.
        skills: what the program may call.
        behaviours: what each skill does; those of the eight skills by default.

    Raises:
        UserError: a number is none, or out of its range.
    """

    samples: int = SAMPLES
    seed: int = 0
    strict: bool = False
    rules: Rules = AS_WRITTEN
    skills: SkillTable = SKILLS
    behaviours: Mapping[str, Behaviour] | None = None

    def __post_init__(self) -> None:
        expect_whole(self.samples, "the number of samples", least=1, most=MOST_SAMPLES)
        expect_whole(self.seed, "the seed")


def check(
    program: str,
    *,
    rooms: Sequence[str] | None = None,
    start: str | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
    strict: bool = False,
    skills: SkillTable = SKILLS,
    behaviours: Mapping[str, Behaviour] | None = None,
    workers: int | None = None,
    pool: WorkerPool | None = None,
    plan: RoomMap | None = None,
) -> Check:
    """Say what is wrong with a program, as far as its text and some imagined worlds tell.

    Args:
        program: its source, which need not even parse.
        rooms: the names of the rooms, in order, as a world file writes them; without them they are taken from
            the program.
        start: the room in which the robot starts, one of `rooms` where there are any; without it `start_loc`
            if that is a room, or the first one.
        samples: how many worlds to imagine, 1 to 10,000.
        seed: from which they are drawn: the same ones on every machine.
        strict: whether to draw also what the program takes for granted.
        skills: what the program may call.
        behaviours: what each skill does; those of the eight skills by default.
        workers: how many runs go on at the same time; one by default, which is enough for one program.
        pool: what runs programs, for who checks many; without it, it is started and ended. What runs on a
            worker itself calls `check_on`.
        plan: the rooms and the start, in the place of those two, for who knows more of them.

    Raises:
        UserError: the name of a room is no regular expression, the robot starts in none of the rooms, or an
            argument is not of its kind or range.
        EngineError: no isolated process could be started.
    """
    expect_text(program, "the program")
    expect_texts(rooms or (), "the rooms")
    if start is not None:
        expect_text(start, "the start")
    expect_skills(skills)
    settings = CheckSettings(samples, seed, strict, AS_WRITTEN, skills, behaviours)
    plan = plan or _plan(program, rooms, start, skills)
    with nullcontext(pool) if pool else WorkerPool(1 if workers is None else workers) as open_pool:

        def run(plan: RoomMap, lots: Iterable[FactSampler]) -> Iterator[Sample]:
            return open_pool.map_distinct(
                lambda lot: imagined(open_pool.here(), program, plan, lot, settings),
                lots,
                name=lambda lot: digest(str(lot)),
            )

        return _checked(program, plan, settings, Runner(run, open_pool.workers))


def check_on(
    worker: Worker,
    program: str,
    plan: RoomMap | None = None,
    settings: CheckSettings | None = None,
    known: dict[RoomMap, list[Sample]] | None = None,
) -> Check:
    """The same on one worker, one run after the other, for who checks many programs at the same time.

    Args:
        worker: the calling thread's own.
        program: its source, which need not even parse.
        plan: the rooms; without it they are taken from the program.
        settings: how to check it.
        known: runs of the same program under the same rules, by other checks; those of this one are added.

    Raises:
        EngineError: a process was lost twice, or the worker was stopped.
    """
    how = settings or CheckSettings()

    def run(plan: RoomMap, lots: Iterable[FactSampler]) -> Iterator[Sample]:
        return (imagined(worker, program, plan, lot, how) for lot in lots)

    rooms = plan or _plan(program, None, None, how.skills)
    return _checked(program, rooms, how, Runner(run, known={} if known is None else known))


# --- running


@dataclass
class Runner:
    """Runs a program in worlds, those that are alike to it once.

    Args:
        run: runs it in each of some worlds.
        width: in how many at the same time.
        known: what came of it, by what was certain of the worlds.
    """

    run: Callable[[RoomMap, Iterable[FactSampler]], Iterator[Sample]]
    width: int = 1
    known: dict[RoomMap, list[Sample]] = field(default_factory=dict)

    def runs(self, plan: RoomMap, lots: Sequence[FactSampler]) -> list[Sample]:
        """The runs in some worlds, in their order."""
        known = self.known.setdefault(plan, [])
        found = []
        for start in range(0, len(lots), self.width):
            these = lots[start : start + self.width]
            known += self.run(plan, [lot for lot in these if not any(one.is_as_in(lot) for one in known)])
            for lot in these:
                same = next(one for one in known if one.is_as_in(lot))
                found.append(replace(same, number=lot.sample))
        return found


def imagined(
    worker: Worker, program: str, plan: RoomMap, lot: FactSampler, settings: CheckSettings
) -> Sample:
    """Run a program in one imagined world.

    Args:
        worker: the calling thread's own.
        program: its source, which need not even parse.
        plan: the rooms.
        lot: how the world is drawn.
        settings: how to check it.
    """
    robots: list[SampledRobot] = []

    def new_robot() -> SampledRobot:
        robots.append(SampledRobot(plan, lot, settings.rules, settings.skills, settings.behaviours))
        return robots[-1]

    outcome = worker.run(program, new_robot)
    robot = robots[-1]
    return Sample(lot.sample, outcome, tuple(robot.facts), tuple(robot.draws), _is_in_vain(outcome, robot))


def _is_in_vain(outcome: Outcome, robot: SampledRobot) -> bool:
    if outcome.status is Status.ROBOT_ERROR and outcome.error is not None:
        return any(excuse.startswith(outcome.error.message) for excuse in robot.excuses)
    return outcome.status is Status.TIMEOUT


def _checked(program: str, plan: RoomMap, settings: CheckSettings, runner: Runner) -> Check:
    flaws = _flaws(program, plan, settings.skills)
    if len(flaws) == 1 and isinstance(parsed(program, compiled=True), Flaw):
        return Check(flaws, (), plan, settings.seed, settings.strict)
    ran = _samples(plan, settings, runner)
    for _ in range(GUESSES if plan.guessed else 0):
        wider = _widened(plan, ran)
        if wider == plan:
            break
        plan, ran = wider, _samples(wider, settings, runner)
    blamed = {flaw.line for flaw in flaws}
    shown = [problem for problem in failures(ran, plan) if problem.line not in blamed]
    problems = sorted([*flaws, *shown], key=lambda problem: problem.line or 0)
    return Check(tuple(problems), tuple(ran), plan, settings.seed, settings.strict)


def _samples(plan: RoomMap, settings: CheckSettings, runner: Runner) -> list[Sample]:
    """The runs in so many worlds, and in more where the program waits or searches in vain in all of them."""
    first = FactSampler(settings.seed, 0, settings.strict)
    ran = runner.runs(plan, [replace(first, sample=number) for number in range(settings.samples)])
    for more in range(MORE):
        if not all(sample.in_vain and sample.draws for sample in ran) or all(
            one.only_computed for one in ran
        ):
            break
        # Who waits in many places needs luck to see the end of it; a search, that not all is full of things.
        ran += runner.runs(plan, [replace(first, sample=len(ran), lucky=more % 2 == 1)])
    return ran


# --- rooms


def _plan(program: str, rooms: Sequence[str] | None, start: str | None, skills: SkillTable) -> RoomMap:
    if rooms is not None:
        for room in rooms:
            _expect_regex(room)
        names = tuple(dict.fromkeys(rooms)) or (start or START,)
        start = start or (START if START in names else names[0])
        if start not in names:
            raise UserError(f'the robot starts in "{start}", but the rooms are: {", ".join(names)}')
        return RoomMap(names, start)
    start = start or START
    named = [room for room in named_rooms(program, skills) if room != start]
    if len(named) < len(SOME_ROOMS) and lists_rooms(program):
        named += [room for room in SOME_ROOMS if room not in named]
    return RoomMap((*named, start), start, guessed=True)


def _expect_regex(room: str) -> None:
    try:
        re.compile(room)
    except (re.error, RecursionError, OverflowError) as error:
        raise UserError(f'the room "{room}" is no valid regular expression: {error}') from None


def _widened(plan: RoomMap, ran: Iterable[Sample]) -> RoomMap:
    """The rooms, and those that the program drove to although its text does not name them."""
    requests = (event.text for sample in ran for event in sample.outcome.trace if event.kind == "goto")
    driven = (plan.room(request) for request in requests)
    found = dict.fromkeys([*plan.rooms, *(room for room in driven if room is not None)])
    rooms = [room for room in found if room != plan.start][:MOST_ROOMS]
    return replace(plan, rooms=(*rooms, plan.start))


# --- what is wrong


def unforgiven(flaws: Iterable[Flaw], program: str) -> Iterator[Flaw]:
    """Those that do harm: their line is run, and nothing catches them."""
    return (flaw for flaw in flaws if not reach(program).forgives(flaw.line, flaw.kind))


HARMLESS = "AskInvalidOptions"
"""Options that are no texts: a robot offers them as texts all the same, and only RTL has nothing to judge."""


@lru_cache(maxsize=16)  # who checks with many seeds does so program by program
def _flaws(program: str, plan: RoomMap, skills: SkillTable) -> tuple[Problem, ...]:
    """What the text shows, one problem a line."""
    flaws = [flaw for flaw in Program(program).problems(skills) if flaw.kind != HARMLESS]
    if not plan.guessed:
        flaws += [
            Flaw(line, "GoToInvalidLocation", no_room(request, plan))
            for line, request in fixed_drives(program, skills)
            if plan.room(request) is None
        ]
    by_line: dict[int | None, list[Flaw]] = {}
    for flaw in flaws if isinstance(parsed(program), Flaw) else unforgiven(flaws, program):
        by_line.setdefault(flaw.line, []).append(flaw)
    return tuple(
        Problem(same[0].kind, "; ".join(dict.fromkeys(flaw.message for flaw in same)), line)
        for line, same in by_line.items()
    )
