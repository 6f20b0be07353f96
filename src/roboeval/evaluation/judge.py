"""The authority on right and wrong: runs completions in the worlds of their tasks and judges the traces."""

from __future__ import annotations

import json
import logging
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from functools import partial

from codebotler.core.errors import UserError
from codebotler.core.trace import Outcome, Status, Trace
from codebotler.core.world import World
from codebotler.rtl import Inconclusive, holds
from codebotler.rtl.semantics import visible
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rule_guard import RuleGuard
from codebotler.simulator.worker import Worker
from roboeval.evaluation.engines import Local, OpenEngine
from roboeval.evaluation.failures import Verdict
from roboeval.evaluation.result_cache import ResultCache
from roboeval.evaluation.runs.completions import Completion, name_of, unknown
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.serialization import judgements_for, row_line, with_reply
from roboeval.evaluation.time_limit import TimeLimitExceeded, time_limit
from roboeval.suites.load import Requirement, Scenario, Suite

LOG = logging.getLogger("roboeval.evaluation.judge")

BUDGET = 60  # seconds of processor time that judging one program may take, in all its worlds


REQUIREMENT_CACHE: ResultCache[tuple[bool, ...]] = ResultCache()
JUDGEMENT_CACHE: ResultCache[tuple[bytes, ...]] = ResultCache()


def judge(outcome: Outcome, scenario: Scenario) -> Verdict:
    """Judge how a run ended in a world, by all that any prompt asks for.

    A run that ended in an error is unsatisfied whatever it did; one that reached a limit is judged by the
    requirements only in a world that may wait for ever.
    """
    if not may_satisfy(outcome, scenario):
        return Verdict(scenario.world.about, outcome, (), satisfied=False)
    failed = tuple(r for r, met in zip(scenario.require, are_met(outcome, scenario), strict=True) if not met)
    return Verdict(scenario.world.about, outcome, failed, satisfied=not failed)


def may_satisfy(outcome: Outcome, scenario: Scenario) -> bool:
    """Whether the requirements decide: the run ended by itself, or waits where that is allowed."""
    waited = outcome.status is Status.TIMEOUT and scenario.world.may_wait_forever
    return waited or outcome.status is Status.FINISHED


def are_met(outcome: Outcome, scenario: Scenario) -> tuple[bool, ...]:
    """Whether the trace of a run satisfies each requirement."""

    def found() -> tuple[bool, ...]:
        return tuple([is_met(one, outcome.trace) for one in scenario.require])

    formulas = [id(one.formula) for one in scenario.require]
    return REQUIREMENT_CACHE.of((visible(outcome.trace), *formulas), scenario, [outcome], found)


def is_met(requirement: Requirement, trace: Trace) -> bool:
    """Whether a trace satisfies a requirement; one that cannot be judged is not satisfied."""
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
    """Judge completions, yielding one row each in their order; equal programs of a task run once.

    One whose judging takes more than 60 seconds of processor time has no row, and a warning is logged; this
    limit holds only where rows are asked for in the main thread.

    Args:
        completions: whose tasks the suite knows; read as they are needed.
        suite: tasks and rules.
        ablated: whether to require common sense only; then all tasks have an ablation.
        workers: how many programs are run at the same time.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.
        engine: where programs are run; by default in a pool of so many workers on this machine, started and
            ended for it.

    Raises:
        UserError: there are no workers; or, when it is read, a completion is none or not of the suite.
        EngineError: no isolated process can be started.
    """
    chosen = engine or Local(workers, require_isolation=require_isolation)
    found = judgements(completions, suite, ablated=ablated, engine=chosen)
    return (json.loads(row_line(completion, one)) for completion, one in found if one is not None)


def judgements(
    completions: Iterable[Completion], suite: Suite, *, ablated: bool, engine: OpenEngine
) -> Iterator[tuple[Completion, bytes | None]]:
    """Each completion, in order, with its judgement as JSON; None, and a warning, if it takes too long."""
    waiting: deque[Completion] = deque()

    def works() -> Iterator[tuple[str, str]]:
        for completion in completions:
            _expect_judgeable(completion, suite, ablated=ablated)
            waiting.append(completion)
            yield completion.task, completion.program

    with engine as opened:
        running = partial(run_in_worlds, suite, ablated=ablated)
        judging = partial(judged, suite, ablated=ablated)
        for by_prompt in opened.map_distinct(running, works(), judging):
            completion = waiting.popleft()
            if by_prompt is None:
                LOG.warning(
                    "%s is not judged: that took more than %g seconds of processor time; "
                    "`roboeval tasks --lint` finds slow regexes",
                    name_of(completion.key),
                    BUDGET,
                )
                yield completion, None
            else:
                yield completion, with_reply(completion, by_prompt[completion.prompt])


def _expect_judgeable(completion: object, suite: Suite, *, ablated: bool) -> None:
    if not isinstance(completion, Completion):  # such as a row of a file
        kind = type(completion).__name__
        what = "make it a Completion(task=..., prompt=..., index=..., program=...)"
        raise UserError(f"a completion is of the type {kind}; {what}")
    if (problem := unknown(completion.key, suite)) is not None:
        raise UserError(problem)
    if ablated and suite.tasks[completion.task].ablation is None:
        raise UserError(f'the task "{completion.task}" has no ablation')


def run_in_worlds(
    suite: Suite, worker: Worker, works: Sequence[tuple[str, str]], *, ablated: bool
) -> list[tuple[str, Sequence[Outcome]]]:
    """Run programs, each in the worlds of its task; return for each the task and how each run ended."""
    jobs = [
        (program, [partial(robot_in, one.world, suite) for one in scenarios])
        for task, program in works
        for scenarios in [suite.tasks[task].judged_in(ablated=ablated)]
    ]
    return [(task, outcomes) for (task, _), outcomes in zip(works, worker.run_all(jobs), strict=True)]


def robot_in(world: World, suite: Suite) -> SimulatedRobot:
    """A robot in a world, by the rules of a suite and of its house."""
    guard = None if suite.house is None else RuleGuard(suite.house.rules)
    return SimulatedRobot(world, suite.settings, suite.skills, guard=guard)


def judged(suite: Suite, ran: tuple[str, Sequence[Outcome]], *, ablated: bool) -> tuple[bytes, ...] | None:
    """The judgements on a program that ran in all worlds of a task, as JSON; None if judging takes too long.

    There is one for each prompt; until then it does not matter for which of them a program was written.
    """
    name, outcomes = ran
    task = suite.tasks[name]
    scenarios = task.judged_in(ablated=ablated)

    def found() -> tuple[bytes, ...]:
        with time_limit(BUDGET):
            verdicts = [judge(outcome, one) for outcome, one in zip(outcomes, scenarios, strict=True)]
            return judgements_for(verdicts, len(task.prompts))

    try:
        key = (*map(id, outcomes), *map(id, scenarios))
        return JUDGEMENT_CACHE.of(key, (tuple(outcomes), scenarios), outcomes, found)
    except TimeLimitExceeded:
        return None
