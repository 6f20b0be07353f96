"""Runs right programs and their mutants in the worlds of a task: which mutants do the checks let through?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from codebotler.simulator.engine import Lanes, digest
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rules import Rules
from codebotler.trace import Outcome, Status
from codebotler.world import World
from roboeval.evaluation.failures import Verdict
from roboeval.evaluation.judge import judge
from roboeval.mutation.mutants import Mutant, Original
from roboeval.suites.load import Scenario

Run: TypeAlias = Callable[[str, World], Outcome]
CRASHED = frozenset({Status.PYTHON_ERROR, Status.KILLED})


class Fate(StrEnum):
    """What became of a mutant."""

    KILLED = "killed"
    SURVIVED = "survived"
    STILL_RIGHT = "still right"
    SAME = "same traces"
    CRASHES = "crashes everywhere"


CHANGED = (Fate.KILLED, Fate.SURVIVED, Fate.STILL_RIGHT)
"""The fates of mutants that do something else than their original, and do something at all."""


@dataclass(frozen=True)
class End:
    """What became of a mutant, and where.

    Args:
        fate: what became of it.
        world: what the world is about in which it was killed.
        why: the check that failed there, or the error; for one that is still right the reason.
    """

    fate: Fate
    world: str | None = None
    why: str | None = None


@dataclass(frozen=True)
class Baseline:
    """How an original did in the worlds.

    Args:
        original: the program.
        outcomes: one a world.
        fault: the world in which it is wrong, and why; None for one that is right.
    """

    original: Original
    outcomes: tuple[Outcome, ...]
    fault: End | None


def baselines(
    programs: Sequence[Original], scenarios: Sequence[Scenario], rules: Rules, lanes: Lanes
) -> Iterator[Baseline]:
    """How originals do in the worlds, in their order.

    Args:
        programs: originals.
        scenarios: worlds with what they require.
        rules: how worlds are simulated.
        lanes: in which programs are run.

    Raises:
        EngineError: no isolated process can be started.
    """
    run = _runner(rules, lanes)

    def outcomes(program: str) -> tuple[Outcome, ...]:
        return tuple(run(program, scenario.world) for scenario in scenarios)

    sources = (original.program for original in programs)
    found = lanes.map_distinct(outcomes, sources, name=digest)
    for original, ends in zip(programs, found, strict=True):
        verdicts = [judge(end, scenario) for end, scenario in zip(ends, scenarios, strict=True)]
        wrong = next((verdict for verdict in verdicts if not verdict.satisfied), None)
        yield Baseline(original, ends, None if wrong is None else _killed(wrong))


def ends(
    mutants: Iterable[Mutant],
    right: Iterable[Baseline],
    scenarios: Sequence[Scenario],
    rules: Rules,
    lanes: Lanes,
) -> Iterator[End]:
    """What became of mutants, in their order.

    Args:
        mutants: of originals that are right.
        right: how these did in the same worlds.
        scenarios: worlds with what they require.
        rules: how worlds are simulated.
        lanes: in which programs are run.

    Raises:
        EngineError: no isolated process can be started.
    """
    run = _runner(rules, lanes)
    before = {baseline.original: baseline.outcomes for baseline in right}

    def end(mutant: Mutant) -> End:
        return end_of(mutant.program, before[mutant.original], scenarios, run)

    yield from lanes.map_distinct(end, mutants, name=lambda mutant: digest(mutant.program))


def end_of(program: str, before: Sequence[Outcome], scenarios: Sequence[Scenario], run: Run) -> End:
    """What becomes of one mutant; no world is tried after the one that kills it.

    One that crashes is tried further: in each world, and no check is needed to find it wrong.

    Args:
        program: of the mutant.
        before: how its original did, world by world.
        scenarios: the worlds.
        run: runs a program in a world.
    """
    crashes: list[Verdict] = []
    changed = False
    for outcome, scenario in zip(before, scenarios, strict=True):
        verdict = judge(run(program, scenario.world), scenario)
        if verdict.outcome.status in CRASHED:
            crashes.append(verdict)
        elif not verdict.satisfied:
            return _killed(verdict)
        changed = changed or not _alike(outcome, verdict.outcome)
    if crashes:
        killed = _killed(crashes[0])
        return End(Fate.CRASHES, killed.world, killed.why) if len(crashes) == len(scenarios) else killed
    return End(Fate.SURVIVED if changed else Fate.SAME)


def _killed(verdict: Verdict) -> End:
    error = verdict.outcome.error
    why = verdict.failed[0].text if verdict.failed else "" if error is None else error.kind
    return End(Fate.KILLED, verdict.world, why)


def _alike(one: Outcome, other: Outcome) -> bool:
    kinds = [None if end.error is None else end.error.kind for end in (one, other)]
    return one.status == other.status and kinds[0] == kinds[1] and one.trace == other.trace


def _runner(rules: Rules, lanes: Lanes) -> Run:
    return lambda program, world: lanes.here().run(program, lambda: SimulatedRobot(world, rules))
