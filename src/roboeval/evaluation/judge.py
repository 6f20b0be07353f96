"""The authority on right and wrong: runs completions in the worlds of their tasks and judges the traces."""

from __future__ import annotations

import contextlib
import json
import logging
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from types import FrameType
from typing import Any, Generic, TypeVar

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.files import to_line
from codebotler.core.skills.files import files_of
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Outcome, Status, Trace, outcome_data
from codebotler.core.world import World
from codebotler.rtl import Inconclusive, holds
from codebotler.rtl.semantics import visible
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rule_guard import RuleGuard
from codebotler.simulator.rules import PAPER
from codebotler.simulator.worker import Worker
from roboeval.evaluation.engines import PYTHON_VERSION, Local, OpenEngine
from roboeval.evaluation.failures import NO_PROGRAM, Verdict, failure
from roboeval.evaluation.runs.completions import Completion, name_of, unknown
from roboeval.evaluation.runs.rows import Row, bounded
from roboeval.evaluation.runs.traces import circumstances
from roboeval.suites.load import Requirement, Scenario, Suite

LOG = logging.getLogger("roboeval.evaluation.judge")
Value = TypeVar("Value")

FAILED = b'{"passed": false, '  # as `judgement` writes it
BUDGET = 60  # seconds of processor time that judging one program may take, in all its worlds
MOST_REMEMBERED, LONGEST_REMEMBERED = 2_048, 128  # results, and events of all runs of one


class ResultCache(Generic[Value]):
    """Results for runs: many programs do the same in the same world, and in worlds that are alike."""

    def __init__(self) -> None:
        # With the value, what has the ids that its key may hold, so that nothing else gets these ids.
        self._known: dict[tuple[object, ...], tuple[Value, object]] = {}

    def of(
        self, key: tuple[object, ...], has_ids: object, runs: Iterable[Outcome], found: Callable[[], Value]
    ) -> Value:
        """The result for runs, found if none is known by a key."""
        known = self._known.get(key)  # another thread may clear it at any moment
        if known is not None:
            return known[0]
        value = found()
        if len(self._known) >= MOST_REMEMBERED:
            self._known.clear()
        if sum(len(outcome.trace) for outcome in runs) <= LONGEST_REMEMBERED:
            self._known[key] = value, has_ids
        return value


MET: ResultCache[tuple[bool, ...]] = ResultCache()
JUDGED: ResultCache[tuple[bytes, ...]] = ResultCache()


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
    return MET.of((visible(outcome.trace), *formulas), scenario, [outcome], found)


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
    told = judgements(completions, suite, ablated=ablated, engine=chosen)
    return (json.loads(row_line(completion, one)) for completion, one in told if one is not None)


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
        for told in opened.map_distinct(running, works(), judging):
            completion = waiting.popleft()
            if told is None:
                LOG.warning(
                    "%s is not judged: that took more than %g seconds of processor time; "
                    "`roboeval tasks --lint` finds slow regexes",
                    name_of(completion.key),
                    BUDGET,
                )
            yield completion, None if told is None else _of_reply(completion, told[completion.prompt])


def _of_reply(completion: Completion, told: bytes) -> bytes:
    """The judgement on a program, given as JSON, with what is wrong with its reply if that held no program.

    Text that is no program ends in some error, and half a program fails some check: neither is the cause.
    """
    if not told.startswith(FAILED) or (kind := completion.no_program) is None:
        return told
    judgement = json.loads(told)
    cause = {"class": NO_PROGRAM, "kind": kind, "world": judgement["failure"]["world"], "check": None}
    return to_line({**judgement, "failure": cause}).removesuffix(b"\n")


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
    return SimulatedRobot(world, suite.rules, suite.skills, guard=guard)


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
        return JUDGED.of(key, (tuple(outcomes), scenarios), outcomes, found)
    except TimeLimitExceeded:
        return None


def row_line(completion: Completion, told: bytes) -> bytes:
    """The row of an evaluation for a completion whose judgement is given as JSON, as a line."""
    of_whom = {
        "task": completion.task,
        "prompt": completion.prompt,
        "index": completion.index,
        "program_sha256": completion.program_sha256,
    }
    return b"%b, %b\n" % (to_line(of_whom).removesuffix(b"}\n"), told.removeprefix(b"{"))


def judgements_for(verdicts: list[Verdict], prompts: int) -> tuple[bytes, ...]:
    """The judgements on a program as one written for each prompt; where they are alike, the same object."""
    told: list[tuple[list[Verdict], bytes]] = []
    chosen = []
    for prompt in range(prompts):
        asked = [verdict.on(prompt) for verdict in verdicts]
        known = next((data for others, data in told if others == asked), None)
        if known is None:
            known = judgement(asked)
            told.append((asked, known))
        chosen.append(known)
    return tuple(chosen)


def judgement(verdicts: list[Verdict]) -> bytes:
    """The judgement on a program, as JSON that fits into a row."""
    why = failure(verdicts)
    return bounded(
        {
            "passed": why is None,
            "failure": why,
            "verdicts": [verdict_data(verdict) for verdict in verdicts],
        }
    )


def verdict_data(verdict: Verdict) -> dict[str, Any]:
    """A verdict as a row writes it."""
    outcome = outcome_data(verdict.outcome)
    return {
        "world": verdict.world,
        "satisfied": verdict.satisfied,
        **{name: value for name, value in outcome.items() if name != "trace"},
        "failed_checks": [requirement.text for requirement in verdict.failed],
        "trace": outcome["trace"],
        **circumstances(verdict.outcome.trace),
    }


WORDS = ("words_for_people", "words_for_yes", "words_for_no")  # rules that are left out where empty


def head(suite: Suite) -> dict[str, Any]:
    """The content of KEY.json: by what the rows are judged."""
    rules = suite.rules
    return {
        "suite": suite.name,
        "version": suite.version,
        "digest": suite.digest,
        **({} if suite.worlds is None else {"worlds": suite.worlds, "seed": suite.seed}),
        "rules": {
            "literals": rules.literals,
            "matching": rules.matching,
            "people": rules.people,
            **{name: list(words) for name in WORDS if (words := getattr(rules, name))},
            **({"events": rules.events} if rules.events != PAPER.events else {}),
            "limits": {name: getattr(rules.limits, name) for name in ("seconds", "calls", "ticks")},
            "skill_seconds": 0,
            "clock_starts": rules.clock_starts.isoformat(),
        },
        **(
            {}
            if (house := suite.house) is None
            else {"house_rules": {house.name or suite.name: house.digest}}
        ),
        **({} if suite.skills is SKILLS else {"skills": files_of(suite.skills)}),
        "codebotler": __version__,
        "python": PYTHON_VERSION,
    }


# --- how long judging may take


LOOKS = 100  # times that the clock is looked at within a limit; then other threads have their turn, too


class TimeLimitExceeded(Exception):  # noqa: N818 - no mistake of the caller
    """The limit was reached."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Limit the processor time of the block, in seconds of this thread, if it is the main one."""
    if threading.current_thread() is not threading.main_thread():  # which alone can be interrupted
        yield
        return
    end = time.thread_time() + seconds

    def look(_signal: int, _frame: FrameType | None) -> None:
        if time.thread_time() > end:
            raise TimeLimitExceeded
        time.sleep(0)  # a search lets no other thread run

    before = signal.signal(signal.SIGVTALRM, look)
    try:
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, seconds / LOOKS, seconds / LOOKS)
            yield
        finally:
            signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
    finally:  # also where the limit is reached just when the work is done
        signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
