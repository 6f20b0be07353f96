"""Checks a program before a robot moves: by its text, and in imagined worlds."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from codebotler.badinput import BadInput
from codebotler.drives import MOST_ROOMS, fixed_drives, lists_rooms, named_rooms
from codebotler.program import Problem as Flaw
from codebotler.program import Program, listed, parsed
from codebotler.simulator.engine import Lanes, digest
from codebotler.simulator.imagined import AS_WRITTEN, Draw, Fact, ImaginedRobot, Lot, Plan, brief
from codebotler.simulator.lane import Lane
from codebotler.simulator.robot import Behaviour
from codebotler.simulator.rules import Rules
from codebotler.skills import SKILLS, SkillTable
from codebotler.trace import Outcome, Status
from codebotler.tracefile import outcome_data

SAMPLES = 5
MORE = 20
"""Worlds that are drawn in addition where the program waits in vain in all that were drawn before."""

START = "start_loc"
"""Where the robot starts if nobody says otherwise; models know it by this name from the paper."""

MOST_FACTS = 4
GUESSES = 3
"""How often what a program drives to while it runs is added to the rooms, and it is run again."""

SOME_ROOMS = ("room 1", "room 2")
"""For a program that drives wherever it is told to, and names no room itself."""


@dataclass(frozen=True)
class Problem:
    """Something for which a program is rejected.

    Args:
        kind: of the failure, such as `GoToInvalidLocation` or `NameError`.
        message: what is wrong, in a plain sentence.
        line: where, counted from 1; None where no line is to blame.
        where: what is special about the worlds in which it arises, in words; empty where it always does.
        samples: the numbers of these worlds; none where the text of the program alone shows it.
    """

    kind: str
    message: str
    line: int | None = None
    where: str = ""
    samples: tuple[int, ...] = ()

    @property
    def sentence(self) -> str:
        """All of it, as one says it to a person or to a model."""
        line = "" if self.line is None else f"line {self.line}: "
        where = f", where {self.where}" if self.where else ""
        return f"{line}{self.kind}: {self.message}{where}"


@dataclass(frozen=True)
class Sample:
    """One run in an imagined world.

    Args:
        number: of the world, from 0.
        outcome: how the run ended.
        facts: what was settled about the world while it ran, in that order.
        draws: of the lots by which that was settled, in order.
        in_vain: whether the robot waited or searched in vain, so that the end says little of the program.
    """

    number: int
    outcome: Outcome
    facts: tuple[Fact, ...] = ()
    draws: tuple[Draw, ...] = ()
    in_vain: bool = False

    def is_as_in(self, lot: Lot) -> bool:
        """Whether the same run in another world would meet the same facts, and so be the same."""
        return all(draw.is_drawn_by(lot) for draw in self.draws)

    @property
    def lots(self) -> tuple[str, ...]:
        """What chance settled, in words."""
        return tuple(dict.fromkeys(fact.sentence for fact in self.facts if fact.by_lot))

    @property
    def world(self) -> str:
        """The world, in words."""
        return listed(list(dict.fromkeys(fact.sentence for fact in self.facts)))


@dataclass(frozen=True)
class Check:
    """What a check found.

    Args:
        problems: by line; the program is rejected if there is one.
        samples: the runs; none of a program that does not parse.
        plan: the rooms that the worlds have in common.
        seed: from which the worlds were drawn.
        strict: whether all facts were drawn.
    """

    problems: tuple[Problem, ...]
    samples: tuple[Sample, ...]
    plan: Plan
    seed: int = 0
    strict: bool = False

    @property
    def rooms(self) -> tuple[str, ...]:
        """The rooms, in the order in which the robot knew them."""
        return self.plan.rooms

    @property
    def rooms_are_guessed(self) -> bool:
        """Whether the rooms were taken from the program itself."""
        return self.plan.guessed

    def data(self, skills: SkillTable = SKILLS) -> dict[str, Any]:
        """All of it as plain data; equal checks give equal data.

        Args:
            skills: those with which it was checked.
        """
        return {
            "accepted": not self.problems,
            "problems": [
                {
                    **{name: getattr(problem, name) for name in ("kind", "message", "line", "where")},
                    "samples": list(problem.samples),
                    "sentence": problem.sentence,
                }
                for problem in self.problems
            ],
            "rooms": list(self.rooms),
            "start": self.plan.start,
            "rooms_are_guessed": self.rooms_are_guessed,
            "seed": self.seed,
            "strict": self.strict,
            "samples": [
                {
                    "sample": sample.number,
                    "world": [{"fact": f.sentence, "drawn": f.by_lot} for f in sample.facts],
                    "in_vain": sample.in_vain,
                    **outcome_data(sample.outcome, skills),
                }
                for sample in self.samples
            ],
        }


@dataclass(frozen=True)
class Settings:
    """How programs are checked.

    Args:
        samples: how many worlds to imagine, from 1.
        seed: from which they are drawn: the same ones on every machine.
        strict: whether to draw also what the program takes for granted.
        rules: how a run is simulated.
        skills: what the program may call.
        behaviours: what each skill does; those of the eight skills by default.
    """

    samples: int = SAMPLES
    seed: int = 0
    strict: bool = False
    rules: Rules = AS_WRITTEN
    skills: SkillTable = SKILLS
    behaviours: Mapping[str, Behaviour] | None = None


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
    lanes: Lanes | None = None,
) -> Check:
    """Say what is wrong with a program, as far as its text and some imagined worlds tell.

    Args:
        program: its source, which need not even parse.
        rooms: the names of the rooms, in order, as a world file writes them; without them they are taken from
            the program.
        start: the room in which the robot starts; without it `start_loc` if that is a room, or the first one.
        samples: how many worlds to imagine, from 1.
        seed: from which they are drawn: the same ones on every machine.
        strict: whether to draw also what the program takes for granted.
        skills: what the program may call.
        behaviours: what each skill does; those of the eight skills by default.
        workers: how many runs go on at the same time; one by default, which is enough for one program.
        lanes: what runs programs, for who checks many; without it, it is started and ended. What runs on a
            lane itself calls `check_on`.

    Raises:
        BadInput: the name of a room is no regular expression.
        EngineError: no isolated process could be started.
    """
    settings = Settings(samples, seed, strict, AS_WRITTEN, skills, behaviours)
    plan = _plan(program, rooms, start, skills)
    with nullcontext(lanes) if lanes else Lanes(workers or 1) as open_lanes:

        def run(plan: Plan, lots: Iterable[Lot]) -> Iterator[Sample]:
            return open_lanes.map_distinct(
                lambda lot: imagined(open_lanes.here(), program, plan, lot, settings),
                lots,
                name=lambda lot: digest(str(lot)),
            )

        return _checked(program, plan, settings, Runner(run, open_lanes.workers))


def check_on(
    lane: Lane,
    program: str,
    plan: Plan | None = None,
    settings: Settings | None = None,
    known: dict[Plan, list[Sample]] | None = None,
) -> Check:
    """The same on one lane, one run after the other, for who checks many programs at the same time.

    Args:
        lane: the calling thread's own.
        program: its source, which need not even parse.
        plan: the rooms; without it they are taken from the program.
        settings: how to check it.
        known: runs of the same program under the same rules, by other checks; those of this one are added.

    Raises:
        EngineError: a process was lost twice, or the lane was stopped.
    """
    how = settings or Settings()

    def run(plan: Plan, lots: Iterable[Lot]) -> Iterator[Sample]:
        return (imagined(lane, program, plan, lot, how) for lot in lots)

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

    run: Callable[[Plan, Iterable[Lot]], Iterator[Sample]]
    width: int = 1
    known: dict[Plan, list[Sample]] = field(default_factory=dict)

    def runs(self, plan: Plan, lots: Sequence[Lot]) -> list[Sample]:
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


def imagined(lane: Lane, program: str, plan: Plan, lot: Lot, settings: Settings) -> Sample:
    """Run a program in one imagined world.

    Args:
        lane: the calling thread's own.
        program: its source, which need not even parse.
        plan: the rooms.
        lot: how the world is drawn.
        settings: how to check it.
    """
    robots: list[ImaginedRobot] = []

    def new_robot() -> ImaginedRobot:
        robots.append(ImaginedRobot(plan, lot, settings.rules, settings.skills, settings.behaviours))
        return robots[-1]

    outcome = lane.run(program, new_robot)
    robot = robots[-1]
    return Sample(lot.sample, outcome, tuple(robot.facts), tuple(robot.draws), _is_in_vain(outcome, robot))


def _is_in_vain(outcome: Outcome, robot: ImaginedRobot) -> bool:
    if outcome.status is Status.ROBOT_ERROR and outcome.error is not None:
        return any(excuse.startswith(outcome.error.message) for excuse in robot.excuses)
    return outcome.status is Status.TIMEOUT


def _checked(program: str, plan: Plan, settings: Settings, runner: Runner) -> Check:
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
    failures = [problem for problem in _failures(ran, plan) if problem.line not in blamed]
    problems = sorted([*flaws, *failures], key=lambda problem: problem.line or 0)
    return Check(tuple(problems), tuple(ran), plan, settings.seed, settings.strict)


def _samples(plan: Plan, settings: Settings, runner: Runner) -> list[Sample]:
    """The runs in so many worlds, and in more where the program waits or searches in vain in all of them."""
    first = Lot(settings.seed, 0, settings.strict)
    ran = runner.runs(plan, [replace(first, sample=number) for number in range(settings.samples)])
    for more in range(MORE):
        if not all(sample.in_vain and sample.draws for sample in ran):
            break
        # Who waits in many places needs luck to see the end of it; a search, that not all is full of things.
        ran += runner.runs(plan, [replace(first, sample=len(ran), lucky=more % 2 == 1)])
    return ran


# --- rooms


def _plan(program: str, rooms: Sequence[str] | None, start: str | None, skills: SkillTable) -> Plan:
    if rooms is not None:
        for room in rooms:
            _expect_regex(room)
        names = tuple(dict.fromkeys(rooms)) or (start or START,)
        start = start or (START if START in names else names[0])
        return Plan(names if start in names else (*names, start), start)
    start = start or START
    named = [room for room in named_rooms(program, skills) if room != start]
    if len(named) < len(SOME_ROOMS) and lists_rooms(program):
        named += [room for room in SOME_ROOMS if room not in named]
    return Plan((*named, start), start, guessed=True)


def _expect_regex(room: str) -> None:
    try:
        re.compile(room)
    except (re.error, RecursionError, OverflowError) as error:
        raise BadInput(f'the room "{room}" is no valid regular expression: {error}') from None


def _widened(plan: Plan, ran: Iterable[Sample]) -> Plan:
    """The rooms, and those that the program drove to although its text does not name them."""
    requests = (event.text for sample in ran for event in sample.outcome.trace if event.kind == "goto")
    driven = (plan.room(request) for request in requests)
    found = dict.fromkeys([*plan.rooms, *(room for room in driven if room is not None)])
    rooms = [room for room in found if room != plan.start][:MOST_ROOMS]
    return replace(plan, rooms=(*rooms, plan.start))


# --- what is wrong


@lru_cache(maxsize=16)  # who checks with many seeds does so program by program
def _flaws(program: str, plan: Plan, skills: SkillTable) -> tuple[Problem, ...]:
    """What the text shows, one problem a line."""
    flaws = list(Program(program).problems(skills))
    if not plan.guessed:
        flaws += [
            Flaw(line, "GoToInvalidLocation", _no_room(request, plan))
            for line, request in fixed_drives(program, skills)
            if plan.room(request) is None
        ]
    by_line: dict[int | None, list[Flaw]] = {}
    for flaw in flaws:
        by_line.setdefault(flaw.line, []).append(flaw)
    return tuple(
        Problem(same[0].kind, "; ".join(dict.fromkeys(flaw.message for flaw in same)), line)
        for line, same in by_line.items()
    )


def _no_room(request: str, plan: Plan) -> str:
    name = brief(request)
    closest = difflib.get_close_matches(name.lower(), plan.rooms, n=1)
    hint = f'; the closest is "{closest[0]}"' if closest else ""
    return f'there is no room "{name}"{hint}'


def _failures(ran: Sequence[Sample], plan: Plan) -> Iterator[Problem]:
    """What the runs show: one problem for the runs that ended at the same line in the same way."""
    in_vain = all(sample.in_vain for sample in ran)
    groups: dict[tuple[int | None, str], list[Sample]] = {}
    for sample in ran:
        outcome = sample.outcome
        if outcome.error is not None and (in_vain or not sample.in_vain):
            line = None if outcome.status is Status.TIMEOUT else outcome.line  # any of those where it waits
            groups.setdefault((line, outcome.error.kind), []).append(sample)
    for (_, kind), same in groups.items():
        numbers = tuple(sample.number for sample in same)
        yield Problem(kind, _message(same, ran, plan), same[0].outcome.line, _where(same, ran), numbers)


def _message(same: Sequence[Sample], ran: Sequence[Sample], plan: Plan) -> str:
    """What the first of some runs says at its end."""
    first = same[0].outcome
    assert first.error is not None
    if first.status is Status.TIMEOUT:
        all_or_some = "each" if len(same) == len(ran) else str(len(same))
        often = f"in {all_or_some} of {len(ran)} imagined worlds " if same[0].draws else ""
        return f"the program never ends: {often}it reached a limit, {first.error.message}"
    if first.error.kind == "GoToInvalidLocation" and first.trace and first.trace[-1].kind == "goto":
        return _no_room(first.trace[-1].text, plan)
    return first.error.message


def _where(same: Sequence[Sample], ran: Sequence[Sample]) -> str:
    """What some runs have in common that the others have not."""
    others = [sample for sample in ran if sample not in same]
    shared = [fact for fact in same[0].lots if all(fact in sample.lots for sample in same)]
    telling = [fact for fact in shared if not others or not all(fact in other.lots for other in others)]
    facts = telling or list(same[0].lots if others else ())
    left = len(facts) - MOST_FACTS
    return listed([*([f"{left} more such facts hold"] if left > 0 else []), *facts[-MOST_FACTS:]])
