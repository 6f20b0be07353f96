"""Explore the worlds that a program can tell apart, with one run for each combination of facts."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from codebotler.checking.problems import Sample
from codebotler.checking.sampled import CheckSettings, SampledRuns
from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.trace import Event, Status
from codebotler.simulator.guard.contract import TELLING_SKILLS, RequestedCall
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import Draw, FactSampler
from codebotler.simulator.worlds.robot import Argument
from codebotler.simulator.worlds.room_map import RoomMap

MAX_RUNS, MAX_LONE_RUNS, MAX_CALLS = 2_000, 100, 40_000
"""The budget for each kind of world: all runs, those that need a process of their own, and skill calls."""

RUNS_AT_ONCE = 32
MAX_FAILURES = 30  # runs in which the robot fails once
CATCHES_ERRORS = re.compile(r"\b(?:except|suppress|finally|with|yield)\b")


@dataclass(frozen=True)
class Exploration:
    """The result of running a program in the worlds that it can tell apart.

    Args:
        cases: the number of these worlds that were explored.
        calls: the different skill calls in all of them.
        most_calls: the highest number of calls of each skill in a run; empty if a run is endless.
        violations: the first world in which a rule is broken, by the name of the rule.
        is_complete: whether the program can do nothing else in other worlds with the same rooms.
        is_steady: whether this also holds if facts change during a run, or if skills fail.
    """

    cases: int
    calls: frozenset[RequestedCall]
    most_calls: Mapping[str, int]
    violations: Mapping[str, FactSampler]
    is_complete: bool
    is_steady: bool


class ExploringGuard(RuleGuard):
    """A guard that allows everything, and records the calls of a program and the names of broken rules.

    Args:
        rules: the house rules.
        room_map: the rooms.
        fails_at: the number, from 0, of the call that fails; None if no call fails.
    """

    def __init__(self, rules: Sequence[Rule], room_map: RoomMap, fails_at: int | None = None) -> None:
        super().__init__(rules, room_map)
        self.may_refuse = fails_at is not None
        self.fails_at = fails_at
        self.calls: list[RequestedCall] = []
        self._asked: set[RequestedCall] = set()
        self.asks_again = False  # whether a call asks for a fact that is known, but may have changed
        self.violations: set[str] = set()  # names of rules

    def judge_call(self, row: Skill, arguments: Sequence[Argument], goals: Sequence[str], place: str) -> None:
        """Record the next call. Raise RobotError if this is the call that should fail."""
        call = RequestedCall.of(row, arguments, goals, place)
        if row.returns.base is not None and row.name not in TELLING_SKILLS:
            self.asks_again |= call in self._asked
            self._asked.add(call)
        self.calls.append(call)
        if len(self.calls) - 1 == self.fails_at:
            raise RobotError("SkillFailed", f"the skill {row.name} failed")

    def judge(self, *attempts: Event, is_drive: bool = False) -> None:
        """Record the rules that a possible next event (a drive if `is_drive`) would break. Raise no error."""
        self._keep(self.find_violations(attempts, is_drive=is_drive))

    def judge_result(self, event: Event) -> None:
        """Add an event to the history, and record the rules that its result broke."""
        self._keep(self.add_event(event))

    def find_first_unkept(self) -> None:
        """Record all rules that would be broken if the mission ended now. Always return None."""
        self._keep(self.find_unkept())

    def _keep(self, found: Iterable[RuleViolationError]) -> None:
        self.violations |= {broken.rule.name for broken in found}


def explore(worker: Worker, program: str, room_map: RoomMap, settings: CheckSettings) -> Exploration:
    """Run a program in all worlds that it can tell apart, or in as many of them as the budget allows.

    If the program assumes facts, explore two kinds of worlds: those where these facts hold, as in a check,
    and those where each may be false. If it catches errors, also run it once per call, letting the call fail.
    """
    calls: set[RequestedCall] = set()
    most: Counter[str] = Counter()
    violations: dict[str, FactSampler] = {}
    cases, is_complete, is_endless, is_steady = 0, True, False, True
    for strict in (False, True):
        tree = _Tree(worker, program, room_map, replace(settings, strict=strict))
        for sample, guard in tree.runs():
            calls.update(guard.calls)
            most |= Counter(call.skill for call in guard.calls)
            is_endless |= sample.outcome.status is Status.TIMEOUT
            is_steady &= not guard.asks_again
            for name in guard.violations:
                violations.setdefault(name, FactSampler(settings.seed, strict=strict, forced=sample.draws))
            cases += 1
        is_complete = not tree.waiting
        if not tree.has_assumed or not is_complete:
            break
    for guard in _failing_runs(worker, program, room_map, settings):
        is_steady &= calls.issuperset(guard.calls) and guard.violations <= violations.keys()
        calls.update(guard.calls)
    refused = (rule for rule in settings.house_rules if rule.refuse and rule.name in violations)
    if any(refused) or any(_is_open(settings.skills[call.skill]) for call in calls):
        is_complete = False  # a program may do something else after a refusal, or after another result
    most_calls = {} if is_endless else most
    return Exploration(cases, frozenset(calls), most_calls, violations, is_complete, is_steady)


class _Tree:
    """The runs of a program, as a tree that branches at each fact."""

    def __init__(self, worker: Worker, program: str, room_map: RoomMap, settings: CheckSettings) -> None:
        self._worker, self._program, self._room_map, self._settings = worker, program, room_map, settings
        self.waiting: list[tuple[Draw, ...]] = [()]  # the facts with which the branches still to run begin
        self._runs_left, self._lone_runs_left, self._calls_left = MAX_RUNS, MAX_LONE_RUNS, MAX_CALLS
        self.has_assumed = False  # whether a run took facts for granted

    def runs(self) -> Iterator[tuple[Sample, ExploringGuard]]:
        """Run the program in one world after another, up to a limit. Yield each run with its guard."""
        with self._worker.one_child():
            while self.waiting and min(self._runs_left, self._lone_runs_left, self._calls_left) > 0:
                count = min(RUNS_AT_ONCE, self._runs_left)
                some, self.waiting = self.waiting[-count:], self.waiting[:-count]
                yield from self._run_some(some)

    def _run_some(self, some: Sequence[tuple[Draw, ...]]) -> Iterator[tuple[Sample, ExploringGuard]]:
        seed, strict = self._settings.seed, self._settings.strict
        samplers = [FactSampler(seed, strict=strict, forced=forced) for forced in some]
        runs = _ExploringRuns(self._program, self._room_map, samplers, self._settings)
        known = {run: outcome for (_, run), outcome in self._worker.run_tame([runs.job]).items()}
        self._runs_left -= len(some)
        self._lone_runs_left -= len(some) - len(known)
        samples = runs.samples_on(self._worker, known)
        for number, (forced, sample) in enumerate(zip(some, samples, strict=True)):
            robot = runs.robots[number]
            assert isinstance(robot.guard, ExploringGuard), "made for these runs"
            self.has_assumed |= robot.has_assumed
            self._calls_left -= len(robot.guard.calls)
            self.waiting += _branches(forced, sample.draws)
            yield sample, robot.guard


class _ExploringRuns(SampledRuns):
    fails_at: int | None = None

    def new_guard(self) -> ExploringGuard:
        """Return a guard that records the calls and the broken rules of one run."""
        return ExploringGuard(self.settings.house_rules, self.room_map, self.fails_at)


def _failing_runs(
    worker: Worker, program: str, room_map: RoomMap, settings: CheckSettings
) -> Iterator[ExploringGuard]:
    """Run a program that catches errors once for each of its calls, in which the robot then fails."""
    runs = _ExploringRuns(program, room_map, [FactSampler(settings.seed)], settings)
    runs.fails_at = 0
    while CATCHES_ERRORS.search(program) and runs.fails_at < MAX_FAILURES:
        runs.samples_on(worker, {})
        guard = runs.robots[0].guard
        assert isinstance(guard, ExploringGuard), "made for these runs"
        yield guard
        if len(guard.calls) <= runs.fails_at:  # there is no such call
            return
        runs.fails_at += 1


def _branches(forced: Sequence[Draw], draws: Sequence[Draw]) -> Iterator[tuple[Draw, ...]]:
    """Yield the facts of the worlds that differ from those of a run in one fact that it met freely."""
    met = {(draw.method, draw.arguments) for draw in forced}
    for number, draw in enumerate(draws):
        if (draw.method, draw.arguments) not in met:
            met.add((draw.method, draw.arguments))
            yield from ((*draws[:number], other) for other in draw.alternatives)


def _is_open(row: Skill) -> bool:
    """Return whether a skill may return other values than those that were tried."""
    is_closed = not row.returns.is_list and (row.returns.base in {None, "bool"} or row.returns.choices)
    return SKILLS.get(row.name) is not row and not is_closed
