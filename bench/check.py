"""Which programs does the check reject, compared with the true worlds of their tasks, and at what cost?

The programs are those that models wrote and those of recorded:careful, and apart from them those that were
written by hand to show one fault or one odd way each (where CODEBOTLER_CORPUS names the corpus; else the
recorded models). A program is right if it passes every world of its task. PART=10 takes every tenth program,
SEEDS=20 checks each with so many seeds.
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
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.sampled_robot import RoomMap, SampledRobot
from codebotler.simulator.worker import Worker
from roboeval.evaluation.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite

WORKERS = int(os.environ.get("WORKERS", "2"))
SEEDS = int(os.environ.get("SEEDS", "20"))
PART = int(os.environ.get("PART", "1"))
CERTAIN = frozenset({"GoToInvalidLocation", "SyntaxError", "NameError"})
CAUGHT, LOST, LOST_IN_A_TASK = 0.95, 0.01, 0.05
"""The aims: the least share of certain errors, and the largest share of right programs, that is rejected."""

Source = tuple[str, str]
"""A task's name and a program."""


def real(suite: Suite) -> list[Source]:
    """The available programs of models, and the careful programs."""
    found = [(c.task, c.program) for c in recorded_completions("recorded:careful", suite)]
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    if corpus:
        files = [Path(corpus, "corpus", "programs.jsonl")]
        files += sorted(Path(corpus, "corpus", "completions").glob("*.jsonl"))
        return [*(source for file in files for source in rows(file)), *found]
    return [*found, *((c.task, c.program) for c in recorded_completions("recorded:hasty", suite))]


def by_hand() -> list[Source]:
    """Programs written for demonstrations."""
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    return list(rows(Path(corpus, "tasks", "synthetic.jsonl"))) if corpus else []


def rows(file: Path) -> Iterator[Source]:
    """The programs of a file."""
    for line in file.read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        yield row["task"], row["program"]


# --- verdicts in true worlds, and verdicts of the check


@dataclass
class Truth:
    """The results of a program in the true worlds of its task.

    Args:
        passed: whether it is right in all of them.
        kinds: the kinds of errors in which it ends in some of them; `no error` if it is wrong without any.
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
    """For each program and each seed, whether the check rejects it; the seeds of a program share its code."""
    plans = {name: RoomMap.of(task.scenarios[0].world) for name, task in suite.tasks.items()}

    def rejected(source: Source) -> list[bool]:
        task, program = source
        plan = plans[task] if with_rooms else None
        checks = (check_on(pool.here(), program, plan, CheckSettings(seed=seed)) for seed in seeds)
        return [bool(check.problems) for check in checks]

    def all_rejected(some: Sequence[Source]) -> list[list[bool]]:
        return list(map(rejected, some))

    return list(pool.map_distinct(all_rejected, sources, name=lambda source: digest(*source)))


@dataclass
class Tally:
    """How often checks rejected, and how many checks there were.

    Args:
        rejected: checks that rejected.
        checks: all.
    """

    rejected: int = 0
    checks: int = 0

    def add(self, said: Sequence[bool]) -> None:
        """Count the checks of one program."""
        self.rejected += sum(said)
        self.checks += len(said)

    @property
    def share(self) -> float:
        """The share of rejected programs, from 0 to 1."""
        return self.rejected / self.checks if self.checks else 0.0

    def __str__(self) -> str:
        return f"{self.rejected:6} of {self.checks:6}  {100 * self.share:6.2f} %"


@dataclass
class Rates:
    """The rejected programs of one collection.

    Args:
        certain: of those that end in an error of the kinds in CERTAIN.
        right: of those that are right, all together.
        by_task: of those that are right, by task.
        by_kind: of those that are wrong, by the kind of error.
    """

    certain: Tally = field(default_factory=Tally)
    right: Tally = field(default_factory=Tally)
    by_task: defaultdict[str, Tally] = field(default_factory=lambda: defaultdict(Tally))
    by_kind: defaultdict[str, Tally] = field(default_factory=lambda: defaultdict(Tally))

    @property
    def worst(self) -> tuple[str, Tally]:
        """The task with the largest share of rejected right programs."""
        return max(self.by_task.items(), key=lambda item: item[1].share)

    @property
    def hold(self) -> bool:
        """Whether all aims are met."""
        return (
            self.certain.share >= CAUGHT
            and self.right.share <= LOST
            and self.worst[1].share <= LOST_IN_A_TASK
        )


def rates(sources: Iterable[Source], true: Iterable[Truth], said: Iterable[Sequence[bool]]) -> Rates:
    """Count rejected programs."""
    found = Rates()
    for (task, _), truth, rejected in zip(sources, true, said, strict=True):
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
    """Print the rejected programs of a collection; return whether the aims are met."""
    start = time.perf_counter()
    true = truths(sources, suite)
    said = rejections(sources, suite, range(SEEDS), pool)
    found = rates(sources, true, said)
    spent = time.perf_counter() - start
    print(
        f"\n{name}: {len(sources)} programs, {SEEDS} seeds, {DEFAULT_SAMPLES} samples a check, {spent:.0f} s"
    )
    print(f"  {', '.join(sorted(CERTAIN))} in some world:")
    print(f"    rejected             {found.certain}  (aim: at least {100 * CAUGHT:.0f} %)")
    print("  right in all worlds:")
    print(f"    rejected             {found.right}  (aim: at most {100 * LOST:.0f} %)")
    for task, tally in sorted(found.by_task.items()):
        print(f"      {task:18} {tally}")
    print(f"    worst task: {found.worst[0]} (aim: at most {100 * LOST_IN_A_TASK:.0f} %)")
    print("  wrong, by the kinds of errors in true worlds (a program may have several):")
    for kind, tally in sorted(found.by_kind.items(), key=lambda item: -item[1].checks):
        print(f"    {kind:20} {tally}")
    wrongly = Counter(
        task for (task, _), truth, each in zip(sources, true, said, strict=True) if truth.passed and any(each)
    )
    print(f"  right programs that some seed rejects: {dict(wrongly) or 'none'}")
    return found.hold


def report_guessing(sources: Sequence[Source], suite: Suite, pool: WorkerPool) -> None:
    """Print the rejected programs if rooms are taken from the programs themselves."""
    true = truths(sources, suite)
    found = rates(sources, true, rejections(sources, suite, [0], pool, with_rooms=False))
    print("\nthe same without rooms, one seed:")
    print(f"    right, rejected      {found.right}, worst task {found.worst[0]} {found.worst[1]}")
    print(f"    certain, rejected    {found.certain}")


def report_cost(sources: Sequence[Source], suite: Suite) -> None:
    """Print the cost of a check, in runs of the same programs in one imagined world."""
    worker = Worker()
    plans = {name: RoomMap.of(task.scenarios[0].world) for name, task in suite.tasks.items()}
    once = checked = 0.0
    for task, program in sources:
        new_robot = partial(SampledRobot, plans[task], FactSampler())
        worker.run(program, new_robot)  # compiles it, for both
        start = time.perf_counter()
        worker.run(program, new_robot)
        middle = time.perf_counter()
        check_on(worker, program, plans[task])
        checked += time.perf_counter() - middle
        once += middle - start
    worker.close()
    print(
        f"\na check of {DEFAULT_SAMPLES} samples: {1000 * checked / len(sources):.2f} ms, a single run: "
        f"{1000 * once / len(sources):.2f} ms; so it costs {checked / once:.1f} single runs "
        f"(mean of {len(sources)} programs)"
    )


def main() -> int:
    """Print all parts; return 1 if an aim is missed."""
    suite = load_suite()
    written = list(dict.fromkeys(real(suite)))[::PART]
    shown = [source for source in dict.fromkeys(by_hand()) if source not in set(written)][::PART]
    with WorkerPool(WORKERS) as pool:
        hold = report("written by models, and recorded:careful", written, suite, pool)
        if shown:
            report("written by hand to show one thing each", shown, suite, pool)
        report_guessing(written, suite, pool)
    report_cost(written[:: max(1, len(written) // 200)], suite)
    print("\nas aimed at" if hold else "\nNOT as aimed at")
    return 0 if hold else 1


if __name__ == "__main__":
    sys.exit(main())
