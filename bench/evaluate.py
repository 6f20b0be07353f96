"""Compares the speed of the engine with runs without isolation, and with a new interpreter for each run.

The list is fixed: every distinct pair of program and world from the corpus at CODEBOTLER_CORPUS (without a
corpus, from the recorded models), and then the pairs of every fourth program under the suite `plus`. No runs
are skipped as duplicates. Our engine and the in-process method both compile each program once, and this time
counts. The three methods take turns over parts of the list, several times, so that the ratios hold on a
machine whose speed drifts. Pairs that reach a limit, loops, and programs that hang are reported separately.
"""

import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import cache, partial
from itertools import chain, count, groupby, repeat
from pathlib import Path

from codebotler.core.trace import Status
from codebotler.core.world import Room, World
from codebotler.simulator.batches.replay import REPLAYED
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.settings import PAPER_SETTINGS, SimulationSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from in_process import Reused, compile_program
from roboeval.evaluation.engines.engine import Local, Work
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite

WORKERS = int(os.environ.get("WORKERS", "2"))
PARTS, TIMES = 3, 3

Pair = tuple[str, World]


def pairs(suite: Suite) -> list[Pair]:
    """Return the fixed list of pairs, grouped by program."""
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    if corpus:
        lines = (Path(corpus) / "corpus" / "programs.jsonl").read_text().splitlines()
        programs = [(row["task"], row["program"]) for row in map(json.loads, lines)]
    else:
        models = ("recorded:careful", "recorded:hasty")
        programs = [(c.task, c.program) for model in models for c in recorded_completions(model, suite)]
    return list(
        dict.fromkeys(
            (program, scenario.world)
            for task, program in programs
            for scenario in suite.tasks[task].scenarios
        )
    )


# --- the three methods


def run_isolated(pool: WorkerPool, settings: SimulationSettings, part: Sequence[Pair]) -> list[Status]:
    """Run pairs on our engine, isolated: a few programs per child process, each in all of its worlds."""
    REPLAYED.clear()  # Earlier rounds have left entries.
    programs = [list(same) for _, same in groupby(part, key=lambda pair: pair[0])]

    def run_all(worker: Worker, works: Sequence[Work]) -> list[list[Status]]:
        jobs = [
            (source, [partial(SimulatedRobot, world, settings) for _, world in programs[int(number)]])
            for number, source in works
        ]
        return [[outcome.status for outcome in outcomes] for outcomes in worker.run_all(jobs)]

    works = ((str(number), of_program[0][0]) for number, of_program in enumerate(programs))
    with Local(pool) as engine:
        return list(chain.from_iterable(engine.map_distinct(run_all, works, lambda statuses: statuses)))


@cache
def reused_runner(world: World) -> Reused:
    """Create a runner for this process."""
    return Reused(world)


@cache
def forget(time: int) -> None:  # noqa: ARG001 - do this once for each round
    """Forget all compiled programs, because our engine keeps the code of only a few."""
    compile_program.cache_clear()


def run_bare(part: Sequence[Pair], time: int = 0, settings: SimulationSettings = PAPER_SETTINGS) -> None:
    """Run pairs in this process."""
    forget(time)
    for pair in part:
        reused_runner(NOWHERE).run(pair, settings)


NOWHERE = World((Room("nowhere"),), "nowhere")


def run_in_process(
    processes: ProcessPoolExecutor, times: Iterator[int], settings: SimulationSettings, part: Sequence[Pair]
) -> None:
    """Run the same programs without isolation, in as many processes."""
    share = -(-len(part) // (8 * WORKERS))
    shares = [part[at : at + share] for at in range(0, len(part), share)]
    list(processes.map(run_bare, shares, repeat(next(times)), repeat(settings)))


def start_interpreters(threads: ThreadPoolExecutor, part: Sequence[Pair]) -> None:
    """Start `python -c pass` once for each pair."""
    command = [sys.executable, "-c", "pass"]
    list(threads.map(lambda _: subprocess.run(command, check=True), part))


# --- measuring


def seconds(way: Callable[[Sequence[Pair]], object], part: Sequence[Pair]) -> float:
    """Return how long a method takes for a part of the list."""
    start = time.perf_counter()
    way(part)
    return time.perf_counter() - start


def parts(whole: Sequence[Pair]) -> Iterator[list[Pair]]:
    """Split the list into parts that each have programs from the whole list."""
    programs = [list(same) for _, same in groupby(whole, key=lambda pair: pair[0])]
    for start in range(PARTS):
        yield [pair for program in programs[start::PARTS] for pair in program]


def main() -> None:
    """Print the runs per second of the three methods, the two ratios, and the separate reports."""
    paper, plus = load_suite(), load_suite("plus")
    whole = pairs(paper)
    processes = ProcessPoolExecutor(WORKERS, multiprocessing.get_context("fork"))
    list(processes.map(run_bare, [whole[:1]] * 4 * WORKERS))
    with processes, WorkerPool(WORKERS) as pool, ThreadPoolExecutor(WORKERS) as threads:
        ours = partial(run_isolated, pool, paper.settings)
        honest, limited = by_limit(ours, whole)
        numbers = count(1)
        compare(
            honest,
            {
                "isolated (ours)": ours,
                "in-process, no isolation": partial(run_in_process, processes, numbers, paper.settings),
                "one `python -c pass` a run": partial(start_interpreters, threads),
            },
        )
        ours_plus = partial(run_isolated, pool, plus.settings)
        compare(
            by_limit(ours_plus, every_fourth(pairs(plus)))[0],
            {
                "under plus, isolated (ours)": ours_plus,
                "under plus, in-process": partial(run_in_process, processes, numbers, plus.settings),
            },
        )
        if limited:
            at_limit = seconds(ours, limited) / len(limited)
            print(f"{len(limited)} pairs that reach a limit, ours: {1000 * at_limit:.1f} ms per run")
        report_hanging(ours, honest[: len(honest) // PARTS])
    report_loops(honest)


def by_limit(
    ours: Callable[[Sequence[Pair]], list[Status]], whole: Sequence[Pair]
) -> tuple[list[Pair], list[Pair]]:
    """Return the pairs that end by themselves, and those that reach a limit."""
    statuses = list(zip(whole, ours(whole), strict=True))
    honest = [pair for pair, status in statuses if status is not Status.TIMEOUT]
    return honest, [pair for pair, status in statuses if status is Status.TIMEOUT]


def every_fourth(whole: Sequence[Pair]) -> list[Pair]:
    """Return the pairs of every fourth program."""
    programs = list(dict.fromkeys(program for program, _ in whole))
    some = set(programs[::4])
    return [pair for pair in whole if pair[0] in some]


def compare(honest: Sequence[Pair], ways: dict[str, Callable[[Sequence[Pair]], object]]) -> None:
    """Time all methods in turns, and print their rates."""
    times: dict[str, list[float]] = {}
    for part in list(parts(honest)) * TIMES:
        for name, way in ways.items():
            times.setdefault(name, []).append(seconds(way, part))
    report(len(honest), times)


def report(pairs: int, times: dict[str, list[float]]) -> None:
    """Print the figures."""
    print(f"{pairs} distinct pairs of program and world, {WORKERS} workers, Python {sys.version.split()[0]}")
    total = {name: sum(each) for name, each in times.items()}
    for name, spent in total.items():
        print(f"{name:36}{pairs * TIMES / spent:10.0f} runs/s")
    ours, bare, *fresh = total.values()
    print(f"ours / in-process:         {bare / ours:.3f}   (by round, sorted: {ratios(times, 1)})")
    if fresh:
        print(f"ours / fresh interpreters: {fresh[0] / ours:.2f}    (by round, sorted: {ratios(times, 2)})")


def ratios(times: dict[str, list[float]], other: int) -> str:
    """Format the ratios of the rounds in ascending order."""
    rounds = list(times.values())
    each = sorted(b / a for a, b in zip(rounds[0], rounds[other], strict=True))
    return ", ".join(f"{ratio:.3f}" for ratio in each)


# --- separate reports

COPIES = 12  # Copies of honest programs keep the other workers busy while one is blocked.
HANGS = "def task_program():\n    sum(range(10**12))\n"
LOOPS = {
    "200,000 turns of a loop": "def task_program():\n    for i in range(199_998): pass\n",
    "1,000 looks for the same": "def task_program():\n    for i in range(1000): is_in_room('mug')\n",
    "1,000 looks for others": "def task_program():\n    for i in range(1000): is_in_room(f'mug {i}')\n",
    "1,000 says": "def task_program():\n    for i in range(1000): say('hello')\n",
}


def report_hanging(ours: Callable[[Sequence[Pair]], object], part: Sequence[Pair]) -> None:
    """Print how long a program that hangs for five seconds of processor time delays other programs."""
    longer = [(f"{source}\n# {copy}\n", world) for copy in range(COPIES) for source, world in part]
    alone = seconds(ours, longer)
    beside = seconds(ours, [(HANGS, NOWHERE), *longer])
    print(
        f"{len(longer)} honest runs: {alone:.1f} s; with a program that hangs: {beside:.1f} s "
        f"(5 s shared by {WORKERS} workers: {5 / WORKERS:.1f} s)"
    )


def report_loops(honest: Sequence[Pair]) -> None:
    """Print the cost of loops as multiples of the median honest run, and of the same loop in-process."""
    worker = Worker()

    def one_by_one(part: Sequence[Pair]) -> None:
        for source, world in part:
            worker.run(source, partial(SimulatedRobot, world))

    median = statistics.median(seconds(one_by_one, [pair]) for pair in honest[:: max(1, len(honest) // 200)])
    print(f"median honest run, one worker: {1000 * median:.2f} ms")
    for name, source in LOOPS.items():
        pair = (source, NOWHERE)
        ours = statistics.median(seconds(one_by_one, [pair]) for _ in range(7))
        bare = statistics.median(seconds(run_bare, [pair]) for _ in range(7))
        print(
            f"{name:26}{1000 * ours:8.1f} ms: {ours / median:5.1f} median runs, "
            f"{ours / bare:5.2f} times in-process, {(ours - median) / bare:5.2f} without a median run"
        )
    worker.close()


if __name__ == "__main__":
    main()
