"""Compares the cost of judging a program in one world under the suites `plus` and `paper`.

Every third recorded program is judged under both suites, in turns, so that the ratio holds on a machine whose
speed drifts. For each pair of program and world, the program is run and its trace is judged. The script
prints the milliseconds per pair under each suite, the ratio of the medians over rounds, and the total time.
"""

import statistics
import sys
import time
from functools import partial

from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worlds.robot import SimulatedRobot
from roboeval.evaluation.judging.judge import judge
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite

ROUNDS = 3


def programs(suite: Suite) -> list[tuple[str, str]]:
    """Return the fixed list of programs with their tasks."""
    models = ("recorded:careful", "recorded:hasty")
    return sorted({(c.task, c.program) for model in models for c in recorded_completions(model, suite)})[::3]


def seconds(pool: WorkerPool, suite: Suite, task: str, program: str) -> tuple[float, int]:
    """Judge a program, and return the seconds and the number of worlds."""
    scenarios = suite.tasks[task].scenarios
    start = time.perf_counter()
    for scenario in scenarios:
        judge(pool.here().run(program, partial(SimulatedRobot, scenario.world, suite.settings)), scenario)
    return time.perf_counter() - start, len(scenarios)


def main() -> int:
    """Print the figures. Return 1 if a pair under `plus` costs too much."""
    suites = [load_suite("paper"), load_suite("plus")]
    chosen = programs(suites[0])
    means: list[list[float]] = [[], []]
    spent, pairs = [0.0, 0.0], [0, 0]
    with WorkerPool(1) as pool:
        for _ in range(ROUNDS):
            spent, pairs = [0.0, 0.0], [0, 0]
            for task, program in chosen:
                for at, suite in enumerate(suites):
                    took, worlds = seconds(pool, suite, task, program)
                    spent[at] += took
                    pairs[at] += worlds
            for at in range(2):
                means[at].append(1000 * spent[at] / pairs[at])
            lines = [f"{s.name} {spent[i]:.1f} s for {pairs[i]:,} pairs" for i, s in enumerate(suites)]
            print("; ".join(lines), file=sys.stderr)
    paper, plus = map(statistics.median, means)
    costs = f"{plus:.2f} ms and {paper:.2f} ms"
    print(f"a pair costs {plus / paper:.2f} times as much under plus as under paper ({costs})")
    counted = f"{pairs[0]:,} pairs under paper, {pairs[1]:,} under plus"
    print(f"{len(chosen)} programs: {counted}, the latter in {spent[1]:.1f} s")
    return plus / paper > MOST


MOST = 1.2

if __name__ == "__main__":
    sys.exit(main())
