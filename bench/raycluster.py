"""Measures the overhead of a Ray cluster on one machine, and how many programs a process can dispatch to it.

The recorded programs are judged by the local engine and on a cluster of this machine, in turns, with the same
number of cores. The script prints the ratio of the medians. Then it counts calls per second that only return
a row of typical length. This is how many programs one process can dispatch and collect, no matter how they
are judged. The last lines say what this means for a million completions.
"""

import json
import os
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from codebotler.simulator.worker import Worker
from roboeval.evaluation.engines.engine import Engine, Local, Work
from roboeval.evaluation.engines.ray import RayCluster
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite

ROUNDS = 3
EMPTY = 20_000
MILLION = 1_000_000


@contextmanager
def keep_open(engine: Engine) -> Iterator[Engine]:
    """Yield an engine that is already open, and leave it open."""
    yield engine


def seconds(engine: Engine, completions: list[Completion], suite: Suite) -> tuple[float, list[str]]:
    """Judge completions, and return the seconds and the rows."""
    start = time.perf_counter()
    rows = [json.dumps(row) for row in evaluate(completions, suite, engine=keep_open(engine))]
    return time.perf_counter() - start, rows


def dispatch_rate(cluster: Engine, row: str) -> float:
    """Return the number of calls per second that one process can dispatch and collect."""

    def give(_worker: Worker, works: Sequence[Work]) -> list[str]:
        return [row[: -1 - int(number) % 2] for _, number in works]

    start = time.perf_counter()
    count = sum(1 for _ in cluster.map_distinct(give, (("", str(n)) for n in range(EMPTY)), len))
    return count / (time.perf_counter() - start)


def main() -> int:
    """Print the measurements. Return 1 if rows differ."""
    suite = load_suite(sys.argv[1] if len(sys.argv) > 1 else "paper")
    models = ("recorded:careful", "recorded:hasty")
    completions = [c for model in models for c in recorded_completions(model, suite)]
    cores = os.cpu_count() or 1
    took: dict[str, list[float]] = {"local": [], "ray": []}
    rows: dict[str, list[str]] = {}
    with Local(cores) as local, RayCluster() as cluster:
        for engine in (local, cluster):
            seconds(engine, completions[:40], suite)  # Start the processes.
        for number in range(ROUNDS):
            for name, engine in (("local", local), ("ray", cluster)):
                spent, rows[name] = seconds(engine, completions, suite)
                took[name].append(spent)
            print(f"round {number + 1} of {ROUNDS}", file=sys.stderr)
        a_second = dispatch_rate(cluster, sorted(rows["ray"], key=len)[len(completions) // 2])
    here, there = (statistics.median(times) for times in took.values())
    each = cores * here / len(completions)
    print(f"{len(completions)} programs, suite {suite.name}, {cores} cores: {here:.1f} s, Ray {there:.1f} s")
    print(f"Ray takes {there / here:.2f} times as long")
    print(f"one process dispatches and collects {a_second:,.0f} programs per second")
    hours, least = MILLION * each * there / here / 3600, MILLION / a_second / 60
    print(f"a million distinct programs take {hours:,.1f} core hours and at least {least:,.0f} minutes;")
    print(f"{a_second * each:,.0f} cores suffice for this, and more would wait for the dispatching process")
    return rows["local"] != rows["ray"]


if __name__ == "__main__":
    sys.exit(main())
