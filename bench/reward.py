"""Measures how many distinct programs per minute are rewarded, in batches of 64.

For comparison, one call of `evaluate` judges the same programs, which shows what could be reached. Both rates
are printed for the suites `paper` and `plus`. Under `plus`, which has more worlds, there are only a quarter
of the programs. They are those that models wrote, if CODEBOTLER_CORPUS names the corpus, and the recorded
ones. One in ten recorded programs was written to use all of Python, and needs a process for each run. Then
the script generates PROMPTS prompts of the training families and some of their tasks, and judges ROLLOUTS
rollouts at once, with 1 to 8 workers in turns.
"""

import os
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from itertools import cycle, islice
from pathlib import Path
from statistics import median
from typing import Any

from codebotler.simulator.pool import SHARED_POOL, WorkerPool, cores
from completions import models
from roboeval import Completion, evaluate, load_suite, recorded_completions, reward
from roboeval.evaluation.runs.completions import read_completions
from roboeval.suites.families.tasks import trained_task
from roboeval.suites.load import Suite
from roboeval.training.prompts import load_prompts
from roboeval.training.rollouts import Rollout, judge

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 2_000
BATCH = 64
WORKERS = 2
ROLLOUTS, TURNS = 1_024, 3
PROMPTS, TASKS = 10_000, 500


def main() -> None:
    """Print all measurements."""
    for name, count in (("paper", COUNT), ("plus", COUNT // 4)):
        suite = load_suite(name)
        if os.environ.get("CODEBOTLER_CORPUS"):
            by_models = [one for file in models(Path()).values() for one in read_completions(file)]
            measure("programs of models", suite, by_models[::5], count)
        recorded = [
            completion
            for model in ("recorded:careful", "recorded:hasty")
            for completion in recorded_completions(model, suite)
        ]
        measure("recorded programs", suite, recorded, count)
    measure_prompts()
    measure_families()


def measure_prompts() -> None:
    """Print the time for generating prompts, and its ratio to generating their tasks with all worlds."""
    began = time.monotonic()
    rows = load_prompts("test", count=PROMPTS)
    prompts = time.monotonic() - began
    began = time.monotonic()
    for row in rows[-TASKS:]:
        trained_task(row["family"], row["seed"])
    tasks = (time.monotonic() - began) * PROMPTS / TASKS
    print(f"{PROMPTS:,} prompts: {prompts:.1f} s, {prompts / tasks:.2f} times the time of their tasks")


def measure_families() -> None:
    """Print the rollouts per minute by number of workers, and the ratios to one worker."""
    took: dict[int, list[float]] = defaultdict(list)
    for turn in range(TURNS):
        rows = load_prompts("test", count=ROLLOUTS, seed=turn)
        for workers in (1, 2, 4, 8):
            SHARED_POOL.end()
            SHARED_POOL.pool = WorkerPool(workers).__enter__()
            rollouts = [rollout(row, f"{turn} {workers}") for row in rows]
            judge(rollouts[:1])
            began = time.monotonic()
            judge(rollouts, progress=lambda count: print(f"\r{count:,} of {ROLLOUTS:,}", end="", flush=True))
            took[workers].append(time.monotonic() - began)
    print(f"\r{ROLLOUTS:,} rollouts of the families at once, on {cores()} cores:")
    for workers, seconds in took.items():
        rate, ratio = 60 * ROLLOUTS / median(seconds), median(map(float.__truediv__, took[1], seconds))
        print(
            f"  {workers} workers: {rate:,.0f} programs per minute, {per_core(rate)}, {ratio:.2f} times one"
        )


def rollout(row: dict[str, Any], name: str) -> Rollout:
    """Create a rollout with a unique program, which is right or wrong."""
    task = trained_task(row["family"], row["seed"])
    programs = [task.solution, *(one.program for one in task.wrong)]
    program = f"{programs[row['seed'] % len(programs)]}\n# {name}\n"
    return Rollout(row["family"], row["seed"], row["prompt_index"], program)


def per_core(rate: float) -> str:
    """Format a rate per core."""
    return f"{rate / cores():,.0f} for each of {cores()} cores"


def measure(what: str, suite: Suite, given: Sequence[Completion], count: int) -> None:
    """Print both rates for `count` programs, which repeat the given completions under unique names."""
    written: dict[str, list[str]] = {}
    for number, completion in enumerate(islice(cycle(given), count)):
        written.setdefault(completion.task, []).append(f"{completion.program}\n# {number} of {what}\n")
    first = time.monotonic()
    reward("LunchTime", 0, ["", "def task_program():\n    pass\n"], suite=suite)
    began = time.monotonic()
    for task, programs in written.items():
        for start in range(0, len(programs), BATCH):
            reward(task, 0, programs[start : start + BATCH], suite=suite)
    took = time.monotonic() - began
    rate = 60 * count / took
    print(f"{suite.name}, {what}, {count:,} distinct: {rate:,.0f} programs per minute, {per_core(rate)}")
    print(f"the first call, which starts the engine: {began - first:.2f} s")
    began = time.monotonic()
    for task, programs in written.items():
        for start in range(0, len(programs), BATCH):
            reward(task, 0, programs[start : start + BATCH], suite=suite)
    print(f"the same again, cached: {60 * count / (time.monotonic() - began):,.0f} programs per minute")
    completions = [
        Completion(task=task, prompt=0, index=index, program=program)
        for task, programs in written.items()
        for index, program in enumerate(programs)
    ]
    began = time.monotonic()
    for _ in evaluate(completions, suite, workers=WORKERS):
        pass
    took = time.monotonic() - began
    print(f"evaluate, {WORKERS} workers, one call: {60 * count / took:,.0f} programs per minute")


if __name__ == "__main__":
    main()
