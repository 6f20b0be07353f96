"""Runs correct programs and their mutants in the worlds of a task."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeAlias

from codebotler.core.trace import Outcome, Status
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.judging.failures import Verdict
from roboeval.evaluation.judging.judge import judge, run_in
from roboeval.mutation.mutants import Mutant, Original, mutants, originals, sample_mutants
from roboeval.mutation.operator import Context
from roboeval.mutation.score import MutantResult, MutantStatus, MutationScore, TriedMutant
from roboeval.suites.load import Scenario, Suite, Task
from roboeval.suites.solutions import equivalent_mutants

DEFAULT_MUTANT_WORLDS = 200  # number of sampled worlds by default
WORLDS_PER_BATCH = 16  # after a batch, killed mutants skip the remaining worlds
CRASH_STATUSES = frozenset({Status.PYTHON_ERROR, Status.KILLED})

ProgressBar: TypeAlias = Callable[[Iterable[Any], str, int], Iterator[Any]]  # takes items, label and count


def mutation_score(
    task: Task,
    suite: Suite,
    pool: WorkerPool,
    *,
    further: Iterable[Original] = (),
    worlds: int | None = None,
    most: int = 400,
    seed: int = 1,
    progress: ProgressBar = lambda items, *_: iter(items),
) -> MutationScore:
    """Compute the mutation score of a task from mutants of its right solutions and of further programs.

    A program is right if it satisfies at least one prompt. A mutant is killed if it fails any prompt that its
    original satisfies. Up to `most` mutants run in `worlds` sampled worlds (by default 200), or in the worlds
    of a suite that samples none. Raise UserError if `worlds` is given but the suite samples none.
    """
    scenarios = mutation_worlds(suite, task, worlds, seed)

    def run(program: str) -> Iterator[Outcome]:
        for start in range(0, len(scenarios), WORLDS_PER_BATCH):
            some = scenarios[start : start + WORLDS_PER_BATCH]
            yield from run_in(pool.here(), program, some, suite)

    def outcomes(some: Sequence[Original]) -> list[tuple[Outcome, ...]]:
        return [tuple(run(original.program)) for original in some]

    def result(mutant: Mutant) -> MutantResult:
        original = mutant.original
        found = judge_mutant(run(mutant.program), before[original], judges[original])
        if found.status is MutantStatus.SURVIVED and mutant.key in equivalent:
            return MutantResult(MutantStatus.EQUIVALENT, why=equivalent[mutant.key])
        return found

    equivalent = equivalent_mutants(task)
    programs = originals(task, further)
    ran = pool.map_distinct(outcomes, programs, name=lambda original: digest(original.program))
    before = dict(zip(programs, progress(ran, f"running {task.name}", len(programs)), strict=True))
    asked = [tuple(one.asked_by(prompt) for one in scenarios) for prompt in range(len(task.prompts))]
    faults = {original: [find_failure(before[original], one) for one in asked] for original in programs}
    judges = {one: _satisfied(scenarios, found) for one, found in faults.items() if None in found}
    right = tuple(original for original in programs if original in judges)
    context = Context.of([scenario.world for scenario in scenarios], task.prompts)
    made = sample_mutants(mutants(right, context), most, seed)
    tried = pool.map_distinct(
        lambda some: [*map(result, some)], made, name=lambda mutant: digest(mutant.program)
    )
    return MutationScore(
        task=task.name,
        worlds=len(scenarios),
        right=right,
        wrong=tuple((one, found[-1]) for one, found in faults.items() if found[-1] and None not in found),
        mutants=tuple(map(TriedMutant, made, progress(tried, f"mutating {task.name}", len(made)))),
    )


def _satisfied(scenarios: Sequence[Scenario], faults: Sequence[MutantResult | None]) -> tuple[Scenario, ...]:
    """Return the scenarios with only the requirements of the prompts that an original satisfies."""
    fitting = [prompt for prompt, fault in enumerate(faults) if fault is None]
    return tuple(one.asked_by(*fitting) for one in scenarios)


def mutation_worlds(suite: Suite, task: Task, count: int | None, seed: int) -> tuple[Scenario, ...]:
    """Return the worlds to run mutants in: `count` (default: 200) new samples, or those written by hand."""
    if suite.worlds is None and count is None:
        return task.scenarios
    sampled = suite.with_worlds(count or DEFAULT_MUTANT_WORLDS, seed + 1 + (suite.seed or 0))
    return sampled.tasks[task.name].scenarios


def find_failure(outcomes: Sequence[Outcome], scenarios: Sequence[Scenario]) -> MutantResult | None:
    """Return a program's first failure, with the status `killed`, or None if it passes in all scenarios."""
    verdicts = map(judge, outcomes, scenarios)
    return next((_killed(verdict) for verdict in verdicts if not verdict.satisfied), None)


def judge_mutant(
    outcomes: Iterable[Outcome], before: Sequence[Outcome], scenarios: Sequence[Scenario]
) -> MutantResult:
    """Return a mutant's status, given its outcomes in the scenarios and those of its original (`before`).

    Outcomes are read only until a check fails. A mutant that crashes in every world does not count as killed,
    because no check is needed to reject it.
    """
    crashes: list[Verdict] = []
    changed = False
    for now, outcome, scenario in zip(outcomes, before, scenarios, strict=True):
        verdict = judge(now, scenario)
        if verdict.outcome.status in CRASH_STATUSES:
            crashes.append(verdict)
        elif not verdict.satisfied:
            return _killed(verdict)
        changed = changed or not _alike(outcome, verdict.outcome)
    if crashes:
        killed = _killed(crashes[0])
        return killed._replace(status=MutantStatus.CRASHES) if len(crashes) == len(scenarios) else killed
    return MutantResult(MutantStatus.SURVIVED if changed else MutantStatus.SAME)


def _killed(verdict: Verdict) -> MutantResult:
    error = verdict.outcome.error
    why = verdict.failed[0].text if verdict.failed else "" if error is None else error.kind
    return MutantResult(MutantStatus.KILLED, verdict.world, why)


def _alike(one: Outcome, other: Outcome) -> bool:
    kinds = [None if end.error is None else end.error.kind for end in (one, other)]
    return one.status == other.status and kinds[0] == kinds[1] and one.trace == other.trace
