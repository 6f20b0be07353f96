"""What do house rules do: do they stop all that breaks them, and nothing else, and at what cost?

The rules are those of rules.yaml, of eight kinds. The programs are those that models wrote (where
CODEBOTLER_CORPUS names the corpus), the recorded and the reference programs, and MUTANTS of these, about
2,000 by default. They run in all worlds of their tasks without rules, with each rule that concerns them (a
mutant with every fourth of these), and with all rules at once. Without the corpus, mutants are left out. What
breaks a rule is found by `holds`, on each prefix of the run without rules. Further worlds help to tell if a
program breaks one at all: the same rooms, with what is in them in `plus`. PART=10 takes every tenth program.
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
from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.rules import read_rules
from codebotler.checking.sampled import CheckSettings
from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Event, Option, Outcome, Trace
from codebotler.core.world import Person, Room, World
from codebotler.rtl import EventPattern, Formula, Inconclusive, Last, Not, holds, parse
from codebotler.rtl.formulas import And, Or, Test
from codebotler.rtl.semantics import is_match
from codebotler.simulator.engine import digest
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.house_rule import Rule, RuleViolationError
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rule_guard import RuleGuard
from codebotler.simulator.sampled_robot import RoomMap, SampledRobot
from codebotler.simulator.settings import finds, resolve_room
from codebotler.simulator.worker import NewRobot, Worker
from roboeval.evaluation.judge import judge
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.mutation.mutants import mutants, originals, sample_mutants
from roboeval.mutation.operator import Context
from roboeval.suites.load import Suite, Task, load_suite
from roboeval.suites.solutions import solutions

WORKERS = int(os.environ.get("WORKERS", "2"))
PART = int(os.environ.get("PART", "1"))
MUTANTS = int(os.environ.get("MUTANTS", "2000"))
SOME_OF = 4
AT_ONCE = 8  # programs that are measured together
MOST_REMEMBERED = 3_000
ALL = "all at once"  # the kind of all rules together
REJECTED, LOST = 0.97, 0.01
MICROSECONDS = 50.0
"""What is aimed at: the least share of programs that break a rule, and the largest of those that break none,
to be rejected before they run; the most that ten rules may cost for each skill call."""


# --- programs


@cache
def programs() -> list[Source]:
    """All distinct programs."""
    suite = load_suite()
    found = real(suite)
    found += [(c.task, c.program) for c in recorded_completions("recorded:hasty", suite)]
    found += [(name, one.program) for name, task in suite.tasks.items() for one in solutions(task)]
    return list(dict.fromkeys(found))[::PART]


@cache
def all_mutants() -> list[Source]:
    """The mutants that are no other programs."""
    if not os.environ.get("CODEBOTLER_CORPUS"):
        return []
    suite = load_suite()
    written = set(programs())
    made = chain.from_iterable(mutated(suite, name) for name in suite.tasks)
    return [source for source in dict.fromkeys(made) if source not in written][::PART]


def mutated(suite: Suite, name: str) -> list[Source]:
    """Mutants of the right programs of a task."""
    task = suite.tasks[name]
    context = Context.of([scenario.world for scenario in task.scenarios], task.prompts)
    some = sample_mutants(mutants(originals(task), context), MUTANTS // len(suite.tasks), 1)
    return [(name, mutant.program) for mutant in some]


# --- rules


@dataclass(frozen=True)
class House:
    """Rules that are in force together.

    Args:
        kind: what they are about.
        rules: the rules, one but for all at once.
    """

    kind: str
    rules: tuple[Rule, ...]

    @property
    def name(self) -> str:
        """The name of its rule."""
        return self.rules[0].name if len(self.rules) == 1 else ALL

    def concerns(self, events: Iterable[Event]) -> bool:
        """Whether an event is of a kind, and has a text, of which a rule speaks."""
        about = [element for rule in self.rules for element in speaks_of(rule.formula)]
        all_meant = set(chain.from_iterable(map(meant, events)))
        return any(is_match(element, event, 0) for event in all_meant for element in about)


def houses() -> list[House]:
    """Each rule of the file, and all of them together."""
    rules = read_rules(Path(__file__).with_name("rules.yaml"))
    return [*(House(rule.name.split("-")[0], (rule,)) for rule in rules), House(ALL, rules)]


def speaks_of(formula: Formula) -> list[EventPattern]:
    """The events that a rule forbids or ties to a condition, wherever they happen and however they end."""
    tests = list(tests_of(formula))
    last = [test for test in tests if isinstance(test, Last)] or tests
    return [
        replace(test.element, options=None, place=None, answer=None, found=None, holding=None, to=None)
        for test in last
    ]


def tests_of(formula: Formula) -> Iterator[Test]:
    """The tests of a formula."""
    match formula:
        case And(parts) | Or(parts):
            yield from chain.from_iterable(map(tests_of, parts))
        case Not(part):
            yield from tests_of(part)
        case _:
            yield formula


# --- what is true


def further_worlds(task: Task, plus: Suite) -> list[World]:
    """The rooms of a task with what is in them in the suite `plus`; none if it has other rooms there."""
    rooms = rooms_of(task.scenarios[0].world)
    drawn = [{room.name: room for room in one.world.rooms} for one in plus.tasks[task.name].scenarios]
    start = task.scenarios[0].world.robot
    return [World(tuple(there[name] for name in rooms), start) for there in drawn if set(rooms) <= set(there)]


def rooms_of(world: World) -> list[str]:
    """The names of its rooms."""
    return [room.name for room in world.rooms]


def all_seen(outcomes: Sequence[Outcome], worlds: Sequence[World]) -> list[Trace]:
    """What a program does in each world, as rules are about it."""
    return [seen(one.trace, rooms_of(world)) for one, world in zip(outcomes, worlds, strict=True)]


def seen(trace: Trace, rooms: Sequence[str]) -> Trace:
    """A trace as rules are about it: a drive has the room that it reached, and knows which it may mean."""
    return tuple(driven(event, rooms) if event.kind == "goto" else event for event in trace)


def driven(event: Event, rooms: Sequence[str]) -> Event:
    """A drive to the room that it reached; all that its words may mean stand in a field of questions."""
    reached = resolve_room(rooms, event.text) or event.text
    wanted = event.text.strip().lower()
    named = [room for room in rooms if room.lower() == wanted]
    may_be = named or [room for room in rooms if finds(event.text, room, "label-in-request")]
    return replace(event, text=reached, to="\n".join(dict.fromkeys([reached, *may_be])))


def meant(event: Event) -> list[Event]:
    """An event once for each room that it may mean, if it is a drive."""
    names = (event.to or "").split("\n") if event.kind == "goto" else [event.text]
    return [replace(event, text=name) for name in names]


def breaking(rule: Rule, trace: Trace) -> int | None:
    """The position of the first event that breaks a rule, in some room; one that cannot be judged does."""
    each = ([(*trace[:at], event) for event in meant(trace[at])] for at in range(len(trace)))
    return next((at for at, ends in enumerate(each) if not all(is_kept(rule, end) for end in ends)), None)


def is_kept(rule: Rule, trace: Trace) -> bool:
    """Whether a rule is kept by a trace, whatever came before its end."""
    try:
        return holds(rule.formula, trace)
    except Inconclusive:
        return False


def is_foreseeable(rule: Rule, trace: Trace, at: int) -> bool:
    """Whether an event breaks a rule however it turns out."""
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
    """What a program does without rules.

    Args:
        outcomes: how it ends in each world of its task.
        traces: what it does there, as rules are about it.
        further: what it does in further worlds that its task may have.
        passed: whether it is right in all of its task.
    """

    outcomes: Sequence[Outcome]
    traces: Sequence[Trace]
    further: Sequence[Trace]
    passed: bool


@dataclass
class GuardedRun:
    """A run with rules.

    Args:
        outcome: how it ended.
        trace: what the robot did, as rules are about it.
        refused: what the robot was kept from, if anything.
    """

    outcome: Outcome
    trace: Trace
    refused: Event | None

    @property
    def is_stopped(self) -> bool:
        """Whether a rule ended it."""
        return self.outcome.error is not None and self.outcome.error.kind == VIOLATION


class WatchedGuard(RuleGuard):
    """A guard that keeps what it has refused."""

    refused: Event | None = None

    def judge(self, *attempts: Event) -> None:
        """Judge an attempt, as always."""
        try:
            super().judge(*attempts)
        except RuleViolationError:
            self.refused = attempts[0]
            raise


# --- what rules do to one program


@dataclass
class Effect:
    """What rules do to one program.

    Args:
        source: the program.
        house: the name of the rules.
        broken: in how many worlds it breaks them.
        breaks: whether it breaks them in some world, a further one or not.
        foreseeable: in how many of these that is certain before the event that does so.
        executed: in how many worlds a foreseeable violation is executed in spite of the rules.
        unseen: in how many worlds an unforeseeable one does not end the run.
        altered: in how many worlds it is kept from something that would have broken nothing.
        failing: in how many worlds it is kept from something that would have failed.
        passed: whether it is right without the rules, and with them.
        rejected: whether the check rejects it.
        reason: why, if a rule is to blame: the worlds, in words.
        is_true: whether `holds` agrees in the sampled world.
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
    """Measures programs, in a process of its own."""

    def __init__(self) -> None:
        self.suite, self.houses, self.worker = load_suite(), houses(), Worker()
        plus = load_suite("plus")
        self.numbers = {house.name: number for number, house in enumerate(self.houses)}
        self.further = {name: further_worlds(task, plus) for name, task in self.suite.tasks.items()}
        self.breaking = lru_cache(MOST_REMEMBERED)(self._breaking)  # many programs do the same

    def effects(self, sources: Sequence[Source], mutants: frozenset[Source]) -> list[Effect]:
        """What each house does to each program that it concerns."""
        truths = [self.truth(source) for source in sources]
        found: list[Effect] = []
        for source, truth in zip(sources, truths, strict=True):
            events = set(chain.from_iterable([*truth.traces, *truth.further]))
            concerned = [one for one in self.houses if one.concerns(events) and one.kind != ALL]
            if source in mutants:
                concerned = concerned[digest(*source)[0] % SOME_OF :: SOME_OF]
            found += self.guarded(source, truth, [*concerned, self.houses[-1]])
        for house in self.houses:
            self.check([effect for effect in found if effect.house == house.name], house)
        return found

    def _breaking(self, number: int, _: tuple[object, ...], trace: Trace) -> int | None:
        house = self.houses[number]
        return breaking(house.rules[0], trace) if house.concerns(trace) else None

    def first_break(self, house: House, trace: Trace) -> tuple[int, Rule] | None:
        """The first event that breaks a rule, and the rule."""
        key = tuple((event.place, event.holding, event.to) for event in trace)  # which `==` leaves out
        numbers = (self.numbers[rule.name] for rule in house.rules)
        each = ((self.breaking(n, key, trace), self.houses[n].rules[0]) for n in numbers)
        return min(((at, rule) for at, rule in each if at is not None), key=lambda one: one[0], default=None)

    def robots(self, worlds: Sequence[World]) -> list[partial[SimulatedRobot]]:
        """What makes the robots of some worlds."""
        return [partial(SimulatedRobot, world, self.suite.settings) for world in worlds]

    def worlds(self, task: str) -> list[World]:
        """The worlds of a task."""
        return [scenario.world for scenario in self.suite.tasks[task].scenarios]

    def passed(self, task: str, outcomes: Sequence[Outcome]) -> bool:
        """Whether a program is right in all worlds."""
        return all(
            judge(*one).satisfied for one in zip(outcomes, self.suite.tasks[task].scenarios, strict=True)
        )

    def truth(self, source: Source) -> Truth:
        """What a program does without rules."""
        task, program = source
        worlds = [*self.worlds(task), *self.further[task]]
        (outcomes,) = self.worker.run_all([(program, self.robots(worlds))])
        traces = all_seen(outcomes, worlds)
        own = len(self.worlds(task))
        return Truth(outcomes[:own], traces[:own], traces[own:], self.passed(task, outcomes[:own]))

    def guarded(self, source: Source, truth: Truth, concerned: Sequence[House]) -> list[Effect]:
        """What a program does with rules, in all worlds of its task."""
        task, program = source
        makers = self.robots(self.worlds(task))
        guards: dict[tuple[int, int], WatchedGuard] = {}

        def new_robot(number: int, world: int) -> SimulatedRobot:
            guards[number, world] = WatchedGuard(concerned[number].rules)  # the latest: a run may be repeated
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
            for world, trace in enumerate(all_seen(ended, self.worlds(task))):
                run = GuardedRun(ended[world], trace, guards[number, world].refused)
                self.compare(effect, house, truth, world, run)
            further = (self.first_break(house, trace) for trace in truth.further)
            effect.breaks = effect.broken > 0 or any(at is not None for at in further)
            found.append(effect)
        return found

    def compare(self, effect: Effect, house: House, truth: Truth, world: int, run: GuardedRun) -> None:
        """Compare the runs in a world without and with rules."""
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
        # The event that was refused would be the next one; what could not be foreseen is the last one.
        stopped_at = end - 1 if run.refused is None else end
        if run.trace == free[:end] and without is not None and without[0] == stopped_at:
            return
        rooms = rooms_of(self.worlds(effect.source[0])[world])
        follows = truth.outcomes[world].trace[end : end + 1]
        if run.trace == free[:end] and run.refused is not None and would_fail(run.refused, follows, rooms):
            effect.failing += 1
        else:
            effect.altered += 1

    # --- the check before

    def check(self, effects: Sequence[Effect], house: House) -> None:
        """Check programs by rules, in sampled worlds."""
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
        """Whether a program breaks the rules in a sampled world, if nothing keeps it from that."""
        sampler = FactSampler(found.seed, sample.number, forced=sample.draws)
        outcome = self.worker.run(effect.source[1], partial(SampledRobot, plan, sampler))
        return self.first_break(house, seen(outcome.trace, plan.rooms)) is not None


def would_fail(attempt: Event, follows: Trace, rooms: Sequence[str]) -> bool:
    """Whether what was refused would have failed, by what follows where nothing is refused."""
    if attempt.kind == "goto":
        return resolve_room(rooms, attempt.text) is None
    if not follows or (follows[0].kind, follows[0].text) != (attempt.kind, attempt.text):
        return True
    return attempt.kind == "ask" and follows[0].answer is None


@cache
def measuring() -> Measuring:
    """What measures in this process."""
    return Measuring()


def measured(sources: Sequence[Source], mutants: frozenset[Source]) -> list[Effect]:
    """Measure programs in this process."""
    return measuring().effects(sources, mutants)


def all_effects(sources: Sequence[Source], mutants: frozenset[Source]) -> Iterator[Effect]:
    """What rules do to programs, which several processes measure."""
    shares = [sources[at : at + AT_ONCE] for at in range(0, len(sources), AT_ONCE)]
    start = time.perf_counter()
    with ProcessPoolExecutor(WORKERS) as processes:
        for number, effects in enumerate(processes.map(measured, shares, repeat(mutants)), 1):
            yield from effects
            if number % 20 == 0:
                spent = time.perf_counter() - start
                print(f"{number} of {len(shares)} shares, {spent:.0f} s", file=sys.stderr)


# --- what a skill call costs

SIZES = 0, 1, 10, 100
ROUNDS, RUNS = 9, 5


def cost(rules: Sequence[Rule], world: World, number: Iterator[int]) -> tuple[float, float]:
    """Microseconds of the processor for a skill call with rules, and for making the guard of a run."""
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
    """The skill calls of an errand; what is said is new each time."""
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
    """Microseconds for each skill call and for each run, by the number of rules; they take turns."""
    person = Person("somebody", ("yes",))
    owners = ("bob", "charlie", "david")
    offices = tuple(Room(f"{owner}'s office", people=(person,)) for owner in owners)
    world = World((*offices, Room("pantry", ("cup",) * len(owners)), Room("hall")), "hall")
    kept = [rule for rule in houses()[-1].rules if lets_pass(rule, world)]
    rules = [
        Rule(f"{rule.name}-{again}", rule.says, parse(str(rule.formula)))  # with regexes of its own
        for again in range(max(SIZES))
        for rule in kept
    ]
    number = count()
    told = [{size: cost(rules[:size], world, number) for size in SIZES} for _ in range(ROUNDS)]
    return {
        size: (
            statistics.median(each[size][0] - (each[0][0] if size else 0.0) for each in told),
            statistics.median(each[size][1] for each in told),
        )
        for size in SIZES
    }


def lets_pass(rule: Rule, world: World) -> bool:
    """Whether a rule allows the errand."""
    robot = SimulatedRobot(world, guard=RuleGuard([rule]))
    try:
        for skill, arguments in errand_of(0):
            robot.perform(skill, arguments)
    except RuleViolationError:
        return False
    return True


# --- printing


def share(some: Sequence[bool]) -> str:
    """How many, of how many, in percent."""
    percent = 100 * sum(some) / len(some) if some else 0.0
    return f"{sum(some):5} of {len(some):5} {percent:6.2f} %"


def row(name: str, effects: Sequence[Effect]) -> str:
    """What rules of a kind do."""
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
programs: that a rule concerns, once for each rule; break: those that break it in some world, or a further one
runs: that break a rule in the worlds of their task, where nothing stops them
certain: of which the event that does so was certain to
done: certain violations in spite of rules; unseen: others that do not end the run
altered: runs kept from what would have broken nothing; failing: kept from what would have failed
right: programs that do their task, without > with rules, of those that keep the rule and those that break it
"""


def report(effects: Sequence[Effect], kinds: dict[str, str]) -> list[tuple[str, bool]]:
    """Print what rules do; each aim, and whether it is reached."""
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
        said = (
            [one.rejected for one in broken],
            *([one.reason is not None for one in s] for s in (broken, kept)),
        )
        print(f"{kind:12}" + "".join(f"{share(each):>28}" for each in said))
    report_rules(single)
    missed = [one for one in single if one.breaks and not one.rejected]
    blamed = [one for one in single if not one.breaks and one.reason is not None]
    report_examples("break a rule, and are not rejected", missed)
    report_examples("break none, and are rejected", blamed)
    caught = [not one.executed and not one.unseen for one in missed if one.broken]
    print(f"  missed by the check, and caught by the guard in worlds of their task: {share(caught)}")
    true = [one.is_true for one in effects if one.reason is not None]
    print(f"  rejected by a rule, and broken in that sampled world: {share(true)}")
    right = [one for one in effects if not one.broken]
    rejected = statistics.fmean(one.rejected for one in single if one.breaks)
    lost = statistics.fmean(one.reason is not None for one in single if not one.breaks)
    return [
        ("certain violations with rules: 0", not any(one.executed for one in effects)),
        ("others end the run at once", not any(one.unseen for one in effects)),
        ("runs altered that would have broken nothing: 0", not any(one.altered for one in effects)),
        (
            "tasks of those that keep the rules done as before",
            all(a == b for a, b in (e.passed for e in right)),
        ),
        (
            f"rejected before, of those that break: {rejected:.2%}, at least {REJECTED:.0%}",
            rejected >= REJECTED,
        ),
        (f"rejected by a rule, of those that keep: {lost:.2%}, at most {LOST:.0%}", lost <= LOST),
        ("missed by the check, caught by the guard: all", all(caught)),
    ]


def report_rules(effects: Sequence[Effect]) -> None:
    """Print how many of the programs that a rule concerns break it."""
    print("\nrules, and the programs that break them, of those that they concern")
    for name in dict.fromkeys(house.name for house in houses()[:-1]):
        broken = [one.breaks for one in effects if one.house == name]
        print(f"  {name:32}{share(broken)}")


def report_examples(what: str, some: Sequence[Effect], most: int = 12) -> None:
    """Print of which rules and tasks programs are, and why the first of each were rejected."""
    groups: defaultdict[tuple[str, str], list[Effect]] = defaultdict(list)
    for one in some:
        groups[one.house, one.source[0]].append(one)
    print(f"\n{what}: {len(some)}")
    for (rule, task), same in sorted(groups.items(), key=lambda item: -len(item[1]))[:most]:
        reason = Counter(one.reason for one in same).most_common(1)[0][0]
        print(f"  {len(same):4} {rule}, {task}{'' if reason is None else f': where {reason}'}")


def report_costs() -> list[tuple[str, bool]]:
    """Print what a skill call costs; each aim, and whether it is reached."""
    found = costs()
    print("\nrules   a skill call, microseconds      the guard of a run, microseconds")
    for size, (call, making) in found.items():
        print(f"{size:5}   {f'{call:.1f}' if not size else f'+{call:.1f}':>12}   {making:28.0f}")
    return [
        (
            f"10 rules: {found[10][0]:.1f}, less than {MICROSECONDS:.0f} microseconds a call",
            found[10][0] < MICROSECONDS,
        )
    ]


def main() -> int:
    """Print all parts; 1 if what is aimed at is missed."""
    suite = load_suite()
    written, made = programs(), all_mutants()
    sources = sorted([*written, *made], key=lambda source: digest(*source))  # so that shares are alike
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
    print("\nas aimed at" if hold else "\nNOT as aimed at")
    return 0 if hold else 1


if __name__ == "__main__":
    sys.exit(main())
