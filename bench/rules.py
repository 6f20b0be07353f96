"""Measures whether house rules stop every action that breaks them, and no others, and what they cost.

The rules in rules.yaml are of eight kinds. The programs are those that models wrote (if CODEBOTLER_CORPUS
names the corpus), the recorded and the reference programs, and about MUTANTS=2000 mutants of these (only
with the corpus). They run in all worlds of their tasks without rules, with each rule that concerns them (a
mutant with every fourth of these rules), and with all rules at once. Violations are found by applying
`holds` to each prefix of the run without rules. Further worlds, with the same rooms and their contents in
`plus`, help to find out whether a program breaks a rule at all. PART=10 takes every tenth program.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from itertools import chain, count, repeat
from pathlib import Path

from check import Source, real
from codebotler.checking.check import check_together
from codebotler.checking.house_rules.file import read_rules
from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.sampled import CheckSettings
from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Event, Option, Outcome, Trace
from codebotler.core.world import Person, Room, World
from codebotler.rtl import EventPattern, Formula, Inconclusive, Last, Not, holds, parse
from codebotler.rtl.formulas import And, Or, Test
from codebotler.rtl.semantics import is_match
from codebotler.simulator.engine import digest
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worker import NewRobot, Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.matching import meant_by
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot
from roboeval.evaluation.judging.judge import judge
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.mutation.mutants import mutants, originals, sample_mutants
from roboeval.mutation.operator import Context
from roboeval.suites.load import Suite, Task, load_suite
from roboeval.suites.solutions import solutions

WORKERS = int(os.environ.get("WORKERS", "2"))
PART = int(os.environ.get("PART", "1"))
MUTANTS = int(os.environ.get("MUTANTS", "2000"))
SOME_OF = 4
AT_ONCE = 8  # number of programs that are measured together
MOST_REMEMBERED = 3_000
ALL = "all at once"  # the kind for all rules together
REJECTED, LOST = 0.97, 0.01
MICROSECONDS = 50.0
"""The targets: of the programs that break a rule, at least REJECTED are rejected before they run, and at most
LOST of the others. Ten rules cost less than MICROSECONDS per skill call."""


# --- programs


@cache
def programs() -> list[Source]:
    """Return all distinct programs."""
    suite = load_suite()
    found = real(suite)
    found += [(c.task, c.program) for c in recorded_completions("recorded:hasty", suite)]
    found += [(name, one.program) for name, task in suite.tasks.items() for one in solutions(task)]
    return list(dict.fromkeys(found))[::PART]


@cache
def all_mutants() -> list[Source]:
    """Return the mutants that are not among the other programs."""
    if not os.environ.get("CODEBOTLER_CORPUS"):
        return []
    suite = load_suite()
    written = set(programs())
    made = chain.from_iterable(make_mutants(suite, name) for name in suite.tasks)
    return [source for source in dict.fromkeys(made) if source not in written][::PART]


def make_mutants(suite: Suite, name: str) -> list[Source]:
    """Return mutants of the correct programs of a task."""
    task = suite.tasks[name]
    context = Context.of([scenario.world for scenario in task.scenarios], task.prompts)
    some = sample_mutants(mutants(originals(task), context), MUTANTS // len(suite.tasks), 1)
    return [(name, mutant.program) for mutant in some]


# --- rules


@dataclass(frozen=True)
class House:
    """House rules that are in force together.

    Args:
        kind: what the rules are about.
        rules: a single rule, or all rules.
    """

    kind: str
    rules: tuple[Rule, ...]

    @property
    def name(self) -> str:
        """Return the name of the rule, or ALL for several."""
        return self.rules[0].name if len(self.rules) == 1 else ALL

    def concerns(self, events: Iterable[Event]) -> bool:
        """Return whether the kind and text of any event match an event that a rule is about."""
        about = [element for rule in self.rules for element in patterns_of(rule.formula)]
        all_meant = set(chain.from_iterable(map(expand_drive, events)))
        return any(is_match(element, event, 0) for event in all_meant for element in about)


def houses() -> list[House]:
    """Return each rule of the file on its own, and then all rules together."""
    rules = read_rules(Path(__file__).with_name("rules.yaml"))
    return [*(House(rule.name.split("-")[0], (rule,)) for rule in rules), House(ALL, rules)]


def patterns_of(formula: Formula) -> list[EventPattern]:
    """Return patterns for the events that a rule restricts, wherever they happen and however they end."""
    tests = list(tests_of(formula))
    last = [test for test in tests if isinstance(test, Last)] or tests
    return [
        replace(test.element, options=None, place=None, answer=None, found=None, holding=None, to=None)
        for test in last
    ]


def tests_of(formula: Formula) -> Iterator[Test]:
    """Yield the tests in a formula."""
    match formula:
        case And(parts) | Or(parts):
            yield from chain.from_iterable(map(tests_of, parts))
        case Not(part):
            yield from tests_of(part)
        case _:
            yield formula


# --- the true verdicts


def further_worlds(task: Task, plus: Suite) -> list[World]:
    """Return worlds with the rooms of a task and their contents in `plus`. Skip worlds that lack a room."""
    rooms = rooms_of(task.scenarios[0].world)
    drawn = [{room.name: room for room in one.world.rooms} for one in plus.tasks[task.name].scenarios]
    start = task.scenarios[0].world.robot
    return [World(tuple(there[name] for name in rooms), start) for there in drawn if set(rooms) <= set(there)]


def rooms_of(world: World) -> list[str]:
    """Return the names of the rooms of a world."""
    return [room.name for room in world.rooms]


def judged_traces(outcomes: Sequence[Outcome], worlds: Sequence[World]) -> list[Trace]:
    """Return the trace of a program in each world, in the form that rules judge."""
    return [judged_trace(one.trace, rooms_of(world)) for one, world in zip(outcomes, worlds, strict=True)]


def judged_trace(trace: Trace, rooms: Sequence[str]) -> Trace:
    """Return a trace in the form that rules judge, in which drives name all rooms that they may mean."""
    return tuple(complete_drive(event, rooms) if event.kind == "goto" else event for event in trace)


def complete_drive(event: Event, rooms: Sequence[str]) -> Event:
    """Return a drive with the room that it reached as its text, and all rooms that it may mean in `to`."""
    rooms = meant_by(event.text, rooms) or [event.text]
    return replace(event, text=rooms[0], to="\n".join(rooms))


def expand_drive(event: Event) -> list[Event]:
    """Return a copy of a drive for each room that it may mean, or any other event unchanged."""
    names = (event.to or "").split("\n") if event.kind == "goto" else [event.text]
    return [replace(event, text=name) for name in names]


def find_break(rule: Rule, trace: Trace) -> int | None:
    """Return the index of the first event that breaks a rule. An event that cannot be judged breaks it."""
    each = ([(*trace[:at], event) for event in expand_drive(trace[at])] for at in range(len(trace)))
    return next((at for at, ends in enumerate(each) if not all(is_kept(rule, end) for end in ends)), None)


def is_kept(rule: Rule, trace: Trace) -> bool:
    """Return whether a rule holds for a whole trace, even if it does not hold for a prefix."""
    try:
        return holds(rule.formula, trace)
    except Inconclusive:
        return False


def is_foreseeable(rule: Rule, trace: Trace, at: int) -> bool:
    """Return whether an event breaks a rule whatever its result is."""
    event = trace[at]
    if event.kind == "goto":
        return True
    results: Iterable[Event] = [event]
    if event.kind == "check":
        results = [replace(event, found=True), replace(event, found=False)]
    elif event.options:
        results = [replace(event, answer=option.text) for option in event.options]
    return not any(is_kept(rule, (*trace[:at], result)) for result in results)


@dataclass
class Truth:
    """The behaviour of a program without rules.

    Args:
        outcomes: its outcome in each world of its task.
        traces: its traces in these worlds, in the form that rules judge.
        further: its traces in further worlds that the task may have.
        passed: whether it is right in all worlds of its task.
    """

    outcomes: Sequence[Outcome]
    traces: Sequence[Trace]
    further: Sequence[Trace]
    passed: bool


@dataclass
class GuardedRun:
    """A run with rules.

    Args:
        outcome: the outcome of the run.
        trace: its trace, in the form that rules judge.
        refused: the event that the rules prevented, if any.
    """

    outcome: Outcome
    trace: Trace
    refused: Event | None

    @property
    def is_stopped(self) -> bool:
        """Return whether a rule ended the run."""
        return self.outcome.error is not None and self.outcome.error.kind == VIOLATION


class WatchedGuard(RuleGuard):
    """A guard that records which event it has refused."""

    refused: Event | None = None

    def judge(self, *attempts: Event, is_drive: bool = False) -> None:
        """Judge an attempt, and record it if it is refused."""
        try:
            super().judge(*attempts, is_drive=is_drive)
        except RuleViolationError:
            self.refused = attempts[0]
            raise


# --- the effect of rules on one program


@dataclass
class Effect:
    """The effect of rules on one program.

    Args:
        source: the program.
        house: the name of the rules.
        broken: the number of worlds in which the program breaks the rules.
        breaks: whether it breaks them in any world, including further ones.
        foreseeable: the number of worlds in which the violation is certain before the event that causes it.
        executed: the number of worlds in which a foreseeable violation is executed despite the rules.
        unseen: the number of worlds in which an unforeseeable violation does not end the run.
        altered: the number of worlds in which the rules prevent an event that breaks none of them.
        failing: the number of worlds in which they prevent an event that would have failed anyway.
        passed: whether the program is right without the rules, and with them.
        rejected: whether the check rejects the program.
        reason: the facts of the world in which a rule makes the check reject it, in words, if any.
        is_true: whether `holds` agrees with the rejection in the sampled world.
    """

    source: Source
    house: str
    broken: int = 0
    breaks: bool = False
    foreseeable: int = 0
    executed: int = 0
    unseen: int = 0
    altered: int = 0
    failing: int = 0
    passed: tuple[bool, bool] = (False, False)
    rejected: bool = False
    reason: str | None = None
    is_true: bool = True


class Measuring:
    """Measures programs in one process."""

    def __init__(self) -> None:
        self.suite, self.houses, self.worker = load_suite(), houses(), Worker()
        plus = load_suite("plus")
        self.numbers = {house.name: number for number, house in enumerate(self.houses)}
        self.further = {name: further_worlds(task, plus) for name, task in self.suite.tasks.items()}
        self.find_break = lru_cache(MOST_REMEMBERED)(self._find_break)  # Many programs have the same traces.

    def effects(self, sources: Sequence[Source], mutants: frozenset[Source]) -> list[Effect]:
        """Return the effect of each house on each program that it concerns."""
        truths = [self.truth(source) for source in sources]
        found: list[Effect] = []
        for source, truth in zip(sources, truths, strict=True):
            events = set(chain.from_iterable([*truth.traces, *truth.further]))
            concerned = [one for one in self.houses if one.concerns(events) and one.kind != ALL]
            if source in mutants:
                concerned = concerned[digest(*source)[0] % SOME_OF :: SOME_OF]
            found += self.run_guarded(source, truth, [*concerned, self.houses[-1]])
        for house in self.houses:
            self.check([effect for effect in found if effect.house == house.name], house)
        return found

    def _find_break(self, number: int, _: tuple[object, ...], trace: Trace) -> int | None:
        house = self.houses[number]
        return find_break(house.rules[0], trace) if house.concerns(trace) else None

    def first_break(self, house: House, trace: Trace) -> tuple[int, Rule] | None:
        """Return the index of the first event that breaks a rule, and the rule."""
        key = tuple((event.place, event.holding, event.to) for event in trace)  # `==` ignores these fields
        numbers = (self.numbers[rule.name] for rule in house.rules)
        each = ((self.find_break(n, key, trace), self.houses[n].rules[0]) for n in numbers)
        return min(((at, rule) for at, rule in each if at is not None), key=lambda one: one[0], default=None)

    def robots(self, worlds: Sequence[World]) -> list[partial[SimulatedRobot]]:
        """Return a function for each world that creates its robot."""
        return [partial(SimulatedRobot, world, self.suite.settings) for world in worlds]

    def worlds(self, task: str) -> list[World]:
        """Return the worlds of a task."""
        return [scenario.world for scenario in self.suite.tasks[task].scenarios]

    def passed(self, task: str, outcomes: Sequence[Outcome]) -> bool:
        """Return whether a program is right in all worlds of its task."""
        return all(
            judge(*one).satisfied for one in zip(outcomes, self.suite.tasks[task].scenarios, strict=True)
        )

    def truth(self, source: Source) -> Truth:
        """Run a program without rules."""
        task, program = source
        worlds = [*self.worlds(task), *self.further[task]]
        (outcomes,) = self.worker.run_all([(program, self.robots(worlds))])
        traces = judged_traces(outcomes, worlds)
        own = len(self.worlds(task))
        return Truth(outcomes[:own], traces[:own], traces[own:], self.passed(task, outcomes[:own]))

    def run_guarded(self, source: Source, truth: Truth, concerned: Sequence[House]) -> list[Effect]:
        """Run a program with rules, in all worlds of its task."""
        task, program = source
        makers = self.robots(self.worlds(task))
        guards: dict[tuple[int, int], WatchedGuard] = {}

        def new_robot(number: int, world: int) -> SimulatedRobot:
            guards[number, world] = WatchedGuard(concerned[number].rules)  # Repeated runs replace it.
            return makers[world](guard=guards[number, world])

        runs: list[NewRobot] = [
            partial(new_robot, number, world)
            for number in range(len(concerned))
            for world in range(len(makers))
        ]
        outcomes = self.worker.run_all([(program, runs)])[0]
        found = []
        for number, house in enumerate(concerned):
            ended = outcomes[number * len(makers) : (number + 1) * len(makers)]
            effect = Effect(source, house.name, passed=(truth.passed, self.passed(task, ended)))
            for world, trace in enumerate(judged_traces(ended, self.worlds(task))):
                run = GuardedRun(ended[world], trace, guards[number, world].refused)
                self.compare(effect, house, truth, world, run)
            further = (self.first_break(house, trace) for trace in truth.further)
            effect.breaks = effect.broken > 0 or any(at is not None for at in further)
            found.append(effect)
        return found

    def compare(self, effect: Effect, house: House, truth: Truth, world: int, run: GuardedRun) -> None:
        """Compare the runs in a world without and with rules, and update the effect."""
        free, end = truth.traces[world], len(run.trace)
        without, despite = self.first_break(house, free), self.first_break(house, run.trace)
        if without is not None:
            at, rule = without
            effect.broken += 1
            effect.foreseeable += is_foreseeable(rule, free, at)
        if despite is not None:
            at, rule = despite
            if is_foreseeable(rule, run.trace, at):
                effect.executed += 1
            elif not run.is_stopped or at != end - 1:
                effect.unseen += 1
        if not run.is_stopped:
            effect.altered += run.outcome != truth.outcomes[world]
            return
        # A refused event would be the next one. A violation that could not be foreseen is the last event.
        stopped_at = end - 1 if run.refused is None else end
        if run.trace == free[:end] and without is not None and without[0] == stopped_at:
            return
        rooms = rooms_of(self.worlds(effect.source[0])[world])
        follows = truth.outcomes[world].trace[end : end + 1]
        if run.trace == free[:end] and run.refused is not None and would_fail(run.refused, follows, rooms):
            effect.failing += 1
        else:
            effect.altered += 1

    # --- the check before a run

    def check(self, effects: Sequence[Effect], house: House) -> None:
        """Check programs in sampled worlds with rules, and update the effects."""
        plans = [RoomMap.of(self.worlds(effect.source[0])[0]) for effect in effects]
        works = [(effect.source[1], plan) for effect, plan in zip(effects, plans, strict=True)]
        settings = CheckSettings(house_rules=house.rules)
        for effect, plan, found in zip(
            effects, plans, check_together(self.worker, works, settings), strict=True
        ):
            effect.rejected = bool(found.problems)
            blamed = [problem for problem in found.problems if problem.kind == VIOLATION]
            if blamed:
                sample = next(one for one in found.samples if one.number in blamed[0].samples)
                effect.reason = " and ".join(sample.drawn) or "always"
                effect.is_true = self.is_true(effect, house, plan, sample, found)

    def is_true(
        self, effect: Effect, house: House, plan: RoomMap, sample: Sample, found: CheckResult
    ) -> bool:
        """Return whether a program breaks the rules in a sampled world if nothing prevents it."""
        sampler = FactSampler(found.seed, sample.number, forced=sample.draws)
        outcome = self.worker.run(effect.source[1], partial(SampledRobot, plan, sampler))
        return self.first_break(house, judged_trace(outcome.trace, plan.rooms)) is not None


def would_fail(attempt: Event, follows: Trace, rooms: Sequence[str]) -> bool:
    """Return whether a refused event would have failed, judging by what follows in the run without rules."""
    if attempt.kind == "goto":
        return len(meant_by(attempt.text, rooms)) != 1
    if not follows or (follows[0].kind, follows[0].text) != (attempt.kind, attempt.text):
        return True
    return attempt.kind == "ask" and follows[0].answer is None


@cache
def measuring() -> Measuring:
    """Return the only instance of this process."""
    return Measuring()


def measure(sources: Sequence[Source], mutants: frozenset[Source]) -> list[Effect]:
    """Measure programs in this process."""
    return measuring().effects(sources, mutants)


def all_effects(sources: Sequence[Source], mutants: frozenset[Source]) -> Iterator[Effect]:
    """Measure programs in several processes, and yield their effects."""
    shares = [sources[at : at + AT_ONCE] for at in range(0, len(sources), AT_ONCE)]
    start = time.perf_counter()
    with ProcessPoolExecutor(WORKERS) as processes:
        for number, effects in enumerate(processes.map(measure, shares, repeat(mutants)), 1):
            yield from effects
            if number % 20 == 0:
                spent = time.perf_counter() - start
                print(f"{number} of {len(shares)} shares, {spent:.0f} s", file=sys.stderr)


# --- the cost of a skill call

SIZES = 0, 1, 10, 100
ROUNDS, RUNS = 9, 5


def cost(rules: Sequence[Rule], world: World, number: Iterator[int]) -> tuple[float, float]:
    """Return the microseconds of processor time for a skill call with rules, and for creating a guard."""
    making = spent = 0.0
    calls = 0
    for _ in range(RUNS):
        start = time.process_time()
        guard = RuleGuard(rules) if rules else None
        making += time.process_time() - start
        robot = SimulatedRobot(world, guard=guard)
        errand = errand_of(next(number))
        start = time.process_time()
        for skill, arguments in errand:
            robot.perform(skill, arguments)
        spent += time.process_time() - start
        calls += len(errand)
    return 1e6 * spent / calls, 1e6 * making / RUNS


def errand_of(number: int) -> list[tuple[str, list[str | tuple[Option, ...]]]]:
    """Return the skill calls of an errand, with texts that depend on its number."""
    calls: list[tuple[str, list[str | tuple[Option, ...]]]] = []
    for room in ("bob's office", "charlie's office", "david's office"):
        calls += [
            ("go_to", [room]),
            ("is_in_room", ["person"]),
            ("ask", ["person", f"Shall I bring you cup {number}?", (Option("yes"), Option("no"))]),
            ("get_current_location", []),
            ("say", [f"I am back with cup {number} in a minute."]),
            ("go_to", ["pantry"]),
            ("is_in_room", ["cup"]),
            ("pick", ["cup"]),
            ("go_to", ["hall"]),
            ("place", ["cup"]),
            ("say", [f"Cup {number} is for {room}!"]),
        ]
    return calls


def costs() -> dict[int, tuple[float, float]]:
    """Return the microseconds per skill call and per run by the number of rules. The sizes take turns."""
    person = Person("somebody", ("yes",))
    owners = ("bob", "charlie", "david")
    offices = tuple(Room(f"{owner}'s office", people=(person,)) for owner in owners)
    world = World((*offices, Room("pantry", ("cup",) * len(owners)), Room("hall")), "hall")
    kept = [rule for rule in houses()[-1].rules if lets_pass(rule, world)]
    rules = [
        Rule(f"{rule.name}-{again}", rule.says, parse(str(rule.formula)))  # Each copy has separate regexes.
        for again in range(max(SIZES))
        for rule in kept
    ]
    number = count()
    rounds = [{size: cost(rules[:size], world, number) for size in SIZES} for _ in range(ROUNDS)]
    return {
        size: (
            statistics.median(each[size][0] - (each[0][0] if size else 0.0) for each in rounds),
            statistics.median(each[size][1] for each in rounds),
        )
        for size in SIZES
    }


def lets_pass(rule: Rule, world: World) -> bool:
    """Return whether a rule allows the errand."""
    robot = SimulatedRobot(world, guard=RuleGuard([rule]))
    try:
        for skill, arguments in errand_of(0):
            robot.perform(skill, arguments)
    except RuleViolationError:
        return False
    return True


# --- printing


def share(some: Sequence[bool]) -> str:
    """Format the number of true values, the number of all, and the percentage."""
    percent = 100 * sum(some) / len(some) if some else 0.0
    return f"{sum(some):5} of {len(some):5} {percent:6.2f} %"


def row(name: str, effects: Sequence[Effect]) -> str:
    """Format the effects of rules of a kind as a row."""
    broken = [effect for effect in effects if effect.breaks]
    kept = [effect for effect in effects if not effect.breaks]
    sums = [
        len(effects),
        len(broken),
        *(sum(getattr(one, each) for one in effects) for each in ("broken", "foreseeable", "executed")),
        *(sum(getattr(one, each) for one in effects) for each in ("unseen", "altered", "failing")),
    ]
    done = [[sum(one.passed[after] for one in some) for after in (0, 1)] for some in (kept, broken)]
    ways = "".join(f"{f'{before} > {after}':>15}" for before, after in done)
    return f"{name:12}" + "".join(f"{number:8}" for number in sums) + ways


HEAD = (
    f"{'kind':12}{'programs':>8}{'break':>8}{'runs':>8}{'certain':>8}{'done':>8}{'unseen':>8}"
    f"{'altered':>8}{'failing':>8}{'right, keep':>15}{'right, break':>15}"
)
LEGEND = """
programs: concerned by a rule, counted for each rule; break: those that break it in any world
runs: without rules, runs in the worlds of the task that break the rule
certain: runs in which the violation was certain before the event that causes it
done: certain violations despite the rules; unseen: other violations that do not end the run
altered: runs in which an event that breaks nothing was prevented; failing: an event that would have failed
right: correct programs without > with rules, among those that keep the rule and those that break it
"""


def report(effects: Sequence[Effect], kinds: dict[str, str]) -> list[tuple[str, bool]]:
    """Print the effects of rules. Return each target, and whether it is met."""
    by_kind: defaultdict[str, list[Effect]] = defaultdict(list)
    for effect in effects:
        by_kind[kinds[effect.house]].append(effect)
    together, single = by_kind.pop(ALL), [effect for effect in effects if effect.house != ALL]
    groups = {**by_kind, "total": single, ALL: together}
    print(HEAD)
    for kind, some in groups.items():
        print(row(kind, some))
    print(LEGEND)
    print(f"{'kind':12}{'break it: rejected before':>28}{'by a rule':>28}{'break none: by a rule':>28}")
    for kind, some in groups.items():
        broken, kept = [one for one in some if one.breaks], [one for one in some if not one.breaks]
        shares = (
            [one.rejected for one in broken],
            *([one.reason is not None for one in s] for s in (broken, kept)),
        )
        print(f"{kind:12}" + "".join(f"{share(each):>28}" for each in shares))
    report_rules(single)
    missed = [one for one in single if one.breaks and not one.rejected]
    blamed = [one for one in single if not one.breaks and one.reason is not None]
    report_examples("programs that break a rule and are not rejected", missed)
    report_examples("programs that break no rule and are rejected", blamed)
    caught = [not one.executed and not one.unseen for one in missed if one.broken]
    print(f"  missed by the check but caught by the guard in worlds of their task: {share(caught)}")
    true = [one.is_true for one in effects if one.reason is not None]
    print(f"  rejected by a rule that is broken in that sampled world: {share(true)}")
    right = [one for one in effects if not one.broken]
    rejected = statistics.fmean(one.rejected for one in single if one.breaks)
    lost = statistics.fmean(one.reason is not None for one in single if not one.breaks)
    return [
        ("certain violations with rules: 0", not any(one.executed for one in effects)),
        ("other violations end the run at once", not any(one.unseen for one in effects)),
        ("runs altered that would have broken no rule: 0", not any(one.altered for one in effects)),
        (
            "programs that keep the rules are right as before",
            all(a == b for a, b in (e.passed for e in right)),
        ),
        (
            f"rejected before running, of those that break a rule: {rejected:.2%}, at least {REJECTED:.0%}",
            rejected >= REJECTED,
        ),
        (f"rejected by a rule, of those that keep it: {lost:.2%}, at most {LOST:.0%}", lost <= LOST),
        ("missed by the check but caught by the guard: all", all(caught)),
    ]


def report_rules(effects: Sequence[Effect]) -> None:
    """Print how many of the programs that a rule concerns break it."""
    print("\nprograms that break a rule, of those that it concerns")
    for name in dict.fromkeys(house.name for house in houses()[:-1]):
        broken = [one.breaks for one in effects if one.house == name]
        print(f"  {name:32}{share(broken)}")


def report_examples(what: str, some: Sequence[Effect], most: int = 12) -> None:
    """Print programs by rule and task, with the most frequent reason for their rejection."""
    groups: defaultdict[tuple[str, str], list[Effect]] = defaultdict(list)
    for one in some:
        groups[one.house, one.source[0]].append(one)
    print(f"\n{what}: {len(some)}")
    for (rule, task), same in sorted(groups.items(), key=lambda item: -len(item[1]))[:most]:
        reason = Counter(one.reason for one in same).most_common(1)[0][0]
        print(f"  {len(same):4} {rule}, {task}{'' if reason is None else f': where {reason}'}")


def report_costs() -> list[tuple[str, bool]]:
    """Print the cost of a skill call. Return each target, and whether it is met."""
    found = costs()
    print("\nrules   microseconds per skill call     microseconds per guard of a run")
    for size, (call, making) in found.items():
        print(f"{size:5}   {f'{call:.1f}' if not size else f'+{call:.1f}':>12}   {making:28.0f}")
    return [
        (
            f"10 rules: {found[10][0]:.1f}, less than {MICROSECONDS:.0f} microseconds per call",
            found[10][0] < MICROSECONDS,
        )
    ]


def main() -> int:
    """Print all parts. Return 1 if a target is missed."""
    suite = load_suite()
    written, made = programs(), all_mutants()
    sources = sorted([*written, *made], key=lambda source: digest(*source))  # Shares become similar.
    kinds = {house.name: house.kind for house in houses()}
    start = time.perf_counter()
    effects = list(all_effects(sources, frozenset(made)))
    worlds = sum(len(suite.tasks[task].scenarios) for task, _ in sources)
    spent = time.perf_counter() - start
    these = f"{len(written)} programs and {len(made)} mutants in {worlds} worlds"
    print(f"{these}, {len(kinds) - 1} rules, {spent:.0f} s\n")
    aims = [*report(effects, kinds), *report_costs()]
    print()
    for aim, is_reached in aims:
        print(f"{'ok    ' if is_reached else 'MISSED'}  {aim}")
    hold = all(is_reached for _, is_reached in aims)
    print("\nall targets met" if hold else "\ntargets MISSED")
    return 0 if hold else 1


if __name__ == "__main__":
    sys.exit(main())
