"""Measures which programs the check rejects, compared with the true worlds of their tasks, and at what cost.

The programs are those that models wrote, those of recorded:careful, and, as a separate collection, programs
written by hand to show one fault or unusual approach each. They are in the corpus at CODEBOTLER_CORPUS.
Without a corpus, the recorded models are used. A program is right if it passes in every world of its task.
PART=10 takes every tenth program, and SEEDS=20 checks each program with 20 seeds.
"""

import json
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from codebotler.checking.check import check_on
from codebotler.checking.sampled import DEFAULT_SAMPLES, CheckSettings
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite

WORKERS = int(os.environ.get("WORKERS", "2"))
SEEDS = int(os.environ.get("SEEDS", "20"))
PART = int(os.environ.get("PART", "1"))
CERTAIN = frozenset({"GoToInvalidLocation", "SyntaxError", "NameError"})
CAUGHT, LOST, LOST_IN_A_TASK = 0.95, 0.01, 0.05
"""The targets: at least CAUGHT of certain errors are rejected, and at most LOST of the correct programs."""

Source = tuple[str, str]
"""The name of a task, and a program."""


def real(suite: Suite) -> list[Source]:
    """Return the available programs of models, and the careful programs."""
    found = [(c.task, c.program) for c in recorded_completions("recorded:careful", suite)]
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    if corpus:
        files = [Path(corpus, "corpus", "programs.jsonl")]
        files += sorted(Path(corpus, "corpus", "completions").glob("*.jsonl"))
        return [*(source for file in files for source in rows(file)), *found]
    return [*found, *((c.task, c.program) for c in recorded_completions("recorded:hasty", suite))]


def handwritten_programs() -> list[Source]:
    """Return the programs that were written by hand for demonstrations."""
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    return list(rows(Path(corpus, "tasks", "synthetic.jsonl"))) if corpus else []


def rows(file: Path) -> Iterator[Source]:
    """Yield the programs in a file."""
    for line in file.read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        yield row["task"], row["program"]


# --- verdicts in true worlds, and verdicts of the check


@dataclass
class Truth:
    """The results of a program in the true worlds of its task.

    Args:
        passed: whether it is right in all of these worlds.
        kinds: the kinds of errors in which it ends in some of them, or `no error` if it is wrong without any.
    """

    passed: bool
    kinds: frozenset[str]


def truths(sources: Sequence[Source], suite: Suite, workers: int = WORKERS) -> list[Truth]:
    """Judge programs in the true worlds of their tasks."""
    completions = (
        Completion(task=task, prompt=0, index=index, program=program)
        for index, (task, program) in enumerate(sources)
    )
    found = []
    for row in evaluate(completions, suite, workers=workers):
        kinds = {verdict["error"]["kind"] for verdict in row["verdicts"] if verdict["error"] is not None}
        found.append(Truth(row["passed"], frozenset(kinds or {"no error"})))
    return found


def rejections(
    sources: Sequence[Source],
    suite: Suite,
    seeds: Sequence[int],
    pool: WorkerPool,
    *,
    with_rooms: bool = True,
) -> list[list[bool]]:
    """Return, for each program and seed, whether the check rejects it. A program is compiled once for all."""
    plans = {name: RoomMap.of(task.scenarios[0].world) for name, task in suite.tasks.items()}

    def run_checks(source: Source) -> list[bool]:
        task, program = source
        plan = plans[task] if with_rooms else None
        checks = (check_on(pool.here(), program, plan, CheckSettings(seed=seed)) for seed in seeds)
        return [bool(check.problems) for check in checks]

    def run_all(some: Sequence[Source]) -> list[list[bool]]:
        return list(map(run_checks, some))

    return list(pool.map_distinct(run_all, sources, name=lambda source: digest(*source)))


@dataclass
class Tally:
    """Counts rejections.

    Args:
        rejected: the number of checks that rejected a program.
        checks: the number of all checks.
    """

    rejected: int = 0
    checks: int = 0

    def add(self, results: Sequence[bool]) -> None:
        """Count the checks of one program."""
        self.rejected += sum(results)
        self.checks += len(results)

    @property
    def share(self) -> float:
        """Return the share of checks that rejected a program, from 0 to 1."""
        return self.rejected / self.checks if self.checks else 0.0

    def __str__(self) -> str:
        return f"{self.rejected:6} of {self.checks:6}  {100 * self.share:6.2f} %"


@dataclass
class Rates:
    """Counts the rejected programs of one collection.

    Args:
        certain: rejections of programs that end in an error of the kinds in CERTAIN.
        right: rejections of all correct programs.
        by_task: rejections of correct programs, by task.
        by_kind: rejections of incorrect programs, by the kind of error.
    """

    certain: Tally = field(default_factory=Tally)
    right: Tally = field(default_factory=Tally)
    by_task: defaultdict[str, Tally] = field(default_factory=lambda: defaultdict(Tally))
    by_kind: defaultdict[str, Tally] = field(default_factory=lambda: defaultdict(Tally))

    @property
    def worst(self) -> tuple[str, Tally]:
        """Return the task with the largest share of rejected correct programs."""
        return max(self.by_task.items(), key=lambda item: item[1].share)

    @property
    def hold(self) -> bool:
        """Return whether all targets are met."""
        return (
            self.certain.share >= CAUGHT
            and self.right.share <= LOST
            and self.worst[1].share <= LOST_IN_A_TASK
        )


def rates(sources: Iterable[Source], true: Iterable[Truth], results: Iterable[Sequence[bool]]) -> Rates:
    """Count rejected programs."""
    found = Rates()
    for (task, _), truth, rejected in zip(sources, true, results, strict=True):
        if truth.passed:
            found.right.add(rejected)
            found.by_task[task].add(rejected)
            continue
        if truth.kinds & CERTAIN:
            found.certain.add(rejected)
        for kind in truth.kinds:
            found.by_kind[kind].add(rejected)
    return found


# --- printing


def report(name: str, sources: Sequence[Source], suite: Suite, pool: WorkerPool) -> bool:
    """Print how many programs of a collection are rejected. Return whether the targets are met."""
    start = time.perf_counter()
    true = truths(sources, suite)
    flags = rejections(sources, suite, range(SEEDS), pool)
    found = rates(sources, true, flags)
    spent = time.perf_counter() - start
    print(f"\n{name}: {len(sources)} programs, {SEEDS} seeds, {DEFAULT_SAMPLES} samples each, {spent:.0f} s")
    print(f"  {', '.join(sorted(CERTAIN))} in some world:")
    print(f"    rejected             {found.certain}  (target: at least {100 * CAUGHT:.0f} %)")
    print("  right in all worlds:")
    print(f"    rejected             {found.right}  (target: at most {100 * LOST:.0f} %)")
    for task, tally in sorted(found.by_task.items()):
        print(f"      {task:18} {tally}")
    print(f"    worst task: {found.worst[0]} (target: at most {100 * LOST_IN_A_TASK:.0f} %)")
    print("  wrong, by the kinds of errors in true worlds (a program may have several):")
    for kind, tally in sorted(found.by_kind.items(), key=lambda item: -item[1].checks):
        print(f"    {kind:20} {tally}")
    wrongly = Counter(
        task for (task, _), truth, one in zip(sources, true, flags, strict=True) if truth.passed and any(one)
    )
    print(f"  correct programs that are rejected with some seed: {dict(wrongly) or 'none'}")
    return found.hold


def report_guessing(sources: Sequence[Source], suite: Suite, pool: WorkerPool) -> None:
    """Print how many programs are rejected if the rooms are taken from the programs themselves."""
    true = truths(sources, suite)
    found = rates(sources, true, rejections(sources, suite, [0], pool, with_rooms=False))
    print("\nthe same programs without known rooms, one seed:")
    print(f"    right, rejected      {found.right}, worst task {found.worst[0]} {found.worst[1]}")
    print(f"    certain, rejected    {found.certain}")


def report_cost(sources: Sequence[Source], suite: Suite) -> None:
    """Print the cost of a check as a multiple of the cost of one run in one imagined world."""
    worker = Worker()
    plans = {name: RoomMap.of(task.scenarios[0].world) for name, task in suite.tasks.items()}
    once = checked = 0.0
    for task, program in sources:
        new_robot = partial(SampledRobot, plans[task], FactSampler())
        worker.run(program, new_robot)  # Compile the program before both measurements.
        start = time.perf_counter()
        worker.run(program, new_robot)
        middle = time.perf_counter()
        check_on(worker, program, plans[task])
        checked += time.perf_counter() - middle
        once += middle - start
    worker.close()
    print(
        f"\na check of {DEFAULT_SAMPLES} samples: {1000 * checked / len(sources):.2f} ms, a single run: "
        f"{1000 * once / len(sources):.2f} ms; a check costs as much as {checked / once:.1f} single runs "
        f"(mean of {len(sources)} programs)"
    )


def main() -> int:
    """Print all parts. Return 1 if a target is missed."""
    suite = load_suite()
    written = list(dict.fromkeys(real(suite)))[::PART]
    shown = [source for source in dict.fromkeys(handwritten_programs()) if source not in set(written)][::PART]
    with WorkerPool(WORKERS) as pool:
        hold = report("written by models, and recorded:careful", written, suite, pool)
        if shown:
            report("written by hand for demonstrations", shown, suite, pool)
        report_guessing(written, suite, pool)
    report_cost(written[:: max(1, len(written) // 200)], suite)
    print("\nall targets met" if hold else "\ntargets MISSED")
    return 0 if hold else 1


if __name__ == "__main__":
    sys.exit(main())
