"""Runs programs in worlds and judges their traces. No other module decides whether a program is right."""

from __future__ import annotations

import json
import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Generic, NamedTuple, TypeVar

from codebotler.core.errors import UserError
from codebotler.core.trace import Outcome, Status, Trace
from codebotler.core.world import World
from codebotler.rtl import Inconclusive, holds
from codebotler.rtl.semantics import compared_fields
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from roboeval.evaluation.engines.engine import Local, OpenEngine, Work
from roboeval.evaluation.judging.failures import Verdict
from roboeval.evaluation.judging.serialization import add_reply_fault, judgements_for, row_line
from roboeval.evaluation.judging.time_limit import TimeLimitExceeded, time_limit
from roboeval.evaluation.runs.completions import Completion, MissionEnd, find_key_fault, name_of
from roboeval.evaluation.runs.endings import apply_ending
from roboeval.evaluation.runs.rows import Row
from roboeval.suites.load import Requirement, Scenario, Suite

_log = logging.getLogger("roboeval.evaluation.judging.judge")

BUDGET = 60  # seconds of processor time for judging one program in all its worlds


def judge(outcome: Outcome, scenario: Scenario) -> Verdict:
    """Judge a run in a world by the requirements of all prompts.

    A run that ends in an error fails, whatever it did before. A run that reaches a limit also fails, unless
    programs may wait forever in that world. In that case, the requirements decide.
    """
    if not may_satisfy(outcome, scenario):
        return Verdict(scenario.world.about, outcome, (), satisfied=False)
    failed = tuple(r for r, met in zip(scenario.require, are_met(outcome, scenario), strict=True) if not met)
    return Verdict(scenario.world.about, outcome, failed, satisfied=not failed)


def may_satisfy(outcome: Outcome, scenario: Scenario) -> bool:
    """Return whether a run can pass: it finished, or timed out in a world where programs may wait forever."""
    waited = outcome.status is Status.TIMEOUT and scenario.world.may_wait_forever
    return waited or outcome.status is Status.FINISHED


def are_met(outcome: Outcome, scenario: Scenario) -> tuple[bool, ...]:
    """Return for each requirement of a world, in order, whether the trace of a run satisfies it."""

    def check() -> tuple[bool, ...]:
        return tuple([is_met(one, outcome.trace) for one in scenario.require])

    formulas = [id(one.formula) for one in scenario.require]
    return REQUIREMENT_CACHE.of((compared_fields(outcome.trace), *formulas), scenario, [outcome], check)


def is_met(requirement: Requirement, trace: Trace) -> bool:
    """Return whether a trace satisfies a requirement. One that cannot be decided counts as not satisfied."""
    try:
        return holds(requirement.formula, trace)
    except Inconclusive:
        return False


def evaluate(
    completions: Iterable[Completion],
    suite: Suite,
    *,
    ablated: bool = False,
    workers: int = 1,
    require_isolation: bool = False,
    engine: OpenEngine | None = None,
) -> Iterator[Row]:
    """Judge completions and yield a row for each, in input order. Equal programs of a task run once.

    A completion that takes more than 60 seconds of processor time to judge gets no row, and a warning is
    logged. This limit applies only in the main thread.

    Args:
        completions: completions for tasks of the suite; an iterator is consumed lazily.
        suite: the tasks and simulation settings.
        ablated: whether to require only common sense; then every task needs an ablation.
        workers: the number of programs to run in parallel.
        require_isolation: whether to raise an error, rather than warn, if programs are not fully isolated.
        engine: the engine that runs programs; by default a pool of workers on this machine.

    Raises:
        UserError: there are no workers, or a completion does not belong to the suite.
        EngineError: no isolated process can be started.
    """
    chosen = engine or Local(workers, require_isolation=require_isolation)
    found = judgements(completions, suite, ablated=ablated, engine=chosen)
    return (json.loads(row_line(completion, one)) for completion, one in found if one is not None)


def judgements(
    completions: Iterable[Completion], suite: Suite, *, ablated: bool, engine: OpenEngine
) -> Iterator[tuple[Completion, bytes | None]]:
    """Yield each completion with its judgement as JSON, or None and a warning if judging takes too long."""
    waiting: deque[Completion] = deque()

    def works() -> Iterator[Work]:
        for completion in completions:
            _expect_judgeable(completion, suite, ablated=ablated)
            waiting.append(completion)
            mission = completion.mission
            where = () if mission is None else (str(mission.world), mission.ending)
            yield completion.task, completion.program, *where

    with engine as opened:
        running = partial(run_in_worlds, suite, ablated=ablated)
        judging = partial(judge_outcomes, suite, ablated=ablated)
        for by_prompt in opened.map_distinct(running, works(), judging):
            completion = waiting.popleft()
            if by_prompt is None:
                _log.warning(
                    "%s was not judged, because that takes more than %g seconds of processor time; "
                    "`roboeval tasks --lint` finds slow regexes",
                    name_of(completion.key),
                    BUDGET,
                )
                yield completion, None
            else:
                yield completion, add_reply_fault(completion, by_prompt[completion.prompt])


def _expect_judgeable(completion: object, suite: Suite, *, ablated: bool) -> None:
    if not isinstance(completion, Completion):  # for example a row of a file
        kind = type(completion).__name__
        what = "make it a Completion(task=..., prompt=..., index=..., program=...)"
        raise UserError(f"a completion has the type {kind}; {what}")
    if (problem := find_key_fault(completion.key, suite)) is not None:
        raise UserError(problem)
    if ablated and suite.tasks[completion.task].ablation is None:
        raise UserError(f'the task "{completion.task}" has no ablation; select other tasks')
    worlds = suite.tasks[completion.task].judged_in(ablated=ablated)
    if completion.mission is not None and (ablated or completion.mission.world >= len(worlds)):
        unknown = f"took place in world {completion.mission.world}, which the task does not have"
        what = "cannot be judged in an ablation" if ablated else unknown
        raise UserError(f"the agent's mission {name_of(completion.key)} {what}; leave the mission out")


class Ran(NamedTuple):
    """The outcomes of a program, one for each world in which it is judged."""

    task: str
    mission: MissionEnd | None  # of an agent; None for a program, which is judged in all worlds
    outcomes: Sequence[Outcome]


def _scenarios(suite: Suite, task: str, mission: MissionEnd | None, *, ablated: bool) -> tuple[Scenario, ...]:
    """Return the worlds in which a program is judged, with their requirements."""
    scenarios = suite.tasks[task].judged_in(ablated=ablated)
    return scenarios if mission is None else scenarios[mission.world :][:1]


def run_in_worlds(suite: Suite, worker: Worker, works: Sequence[Work], *, ablated: bool) -> list[Ran]:
    """Run each program in the worlds in which it is judged, and return the outcomes of each.

    These are all worlds of its task (or its ablation, if `ablated`), and only one for an agent's mission.
    """
    planned = [
        (task, program, MissionEnd(int(end[0]), end[1]) if end else None) for task, program, *end in works
    ]
    scenarios_of = partial(_scenarios, suite, ablated=ablated)
    jobs = [
        (program, [partial(robot_in, one.world, suite) for one in scenarios_of(task, end)])
        for task, program, end in planned
    ]
    return [
        Ran(task, end, outcomes if end is None else [apply_ending(one, end.ending) for one in outcomes])
        for (task, _, end), outcomes in zip(planned, worker.run_all(jobs), strict=True)
    ]


def robot_in(world: World, suite: Suite) -> SimulatedRobot:
    """Return a simulated robot in a world, with the simulation settings and house rules of a suite."""
    return SimulatedRobot(world, suite.settings, suite.skills, guard=guard_of(suite))


def guard_of(suite: Suite, contracts: Sequence[Contract] = ()) -> RuleGuard | None:
    """Return a guard that stops calls that break house rules or contracts, or None if there are no rules."""
    if suite.house is None and not contracts:
        return None
    return RuleGuard(suite.house_rules, contracts=contracts)


def run_in(worker: Worker, program: str, scenarios: Iterable[Scenario], suite: Suite) -> list[Outcome]:
    """Run a program in the world of each scenario, and return the outcomes in that order."""
    robots = [partial(robot_in, scenario.world, suite) for scenario in scenarios]
    return worker.run_all([(program, robots)])[0]


def judge_outcomes(suite: Suite, ran: Ran, *, ablated: bool) -> tuple[bytes, ...] | None:
    """Return the judgement on a program for each prompt, as JSON, or None if judging takes too long."""
    outcomes, scenarios = ran.outcomes, _scenarios(suite, ran.task, ran.mission, ablated=ablated)

    def compute() -> tuple[bytes, ...]:
        with time_limit(BUDGET):
            verdicts = [judge(outcome, one) for outcome, one in zip(outcomes, scenarios, strict=True)]
            return judgements_for(verdicts, len(suite.tasks[ran.task].prompts))

    try:
        key = (*map(id, outcomes), *map(id, scenarios))
        return JUDGEMENT_CACHE.of(key, (tuple(outcomes), scenarios), outcomes, compute)
    except TimeLimitExceeded:
        return None


# --- caches


MAX_RESULTS, MAX_RESULT_EVENTS = 2_048, 128  # limits on entries, and on all events in an entry's runs

CachedResult = TypeVar("CachedResult")


class ResultCache(Generic[CachedResult]):
    """Caches results computed from runs, because many programs behave identically in the same worlds."""

    def __init__(self) -> None:
        # Keys contain object ids, which must not be reused, so entries keep the objects alive.
        self._known: dict[tuple[object, ...], tuple[CachedResult, object]] = {}

    def of(
        self,
        key: tuple[object, ...],
        keep_alive: object,
        runs: Iterable[Outcome],
        compute: Callable[[], CachedResult],
    ) -> CachedResult:
        """Return the cached result for `key`, or compute it. Results of long `runs` are not cached.

        `keep_alive` holds the objects whose ids `key` contains, so that no other objects can get these ids.
        """
        known = self._known.get(key)  # another thread may clear the cache at any moment
        if known is not None:
            return known[0]
        value = compute()
        if len(self._known) >= MAX_RESULTS:
            self._known.clear()
        if sum(len(outcome.trace) for outcome in runs) <= MAX_RESULT_EVENTS:
            self._known[key] = value, keep_alive
        return value


REQUIREMENT_CACHE: ResultCache[tuple[bool, ...]] = ResultCache()
JUDGEMENT_CACHE: ResultCache[tuple[bytes, ...]] = ResultCache()
