"""How fast is the engine, compared with no isolation at all and with one fresh interpreter a run?

The list is fixed: every distinct (program, world) pair of the corpus, where CODEBOTLER_CORPUS names it, or
else of the recorded models. Nothing is deduplicated. The three ways take turns over parts of the list, so
that the ratios hold on a machine whose speed drifts. Pairs that reach a limit are timed and printed apart.
"""

import builtins
import json
import multiprocessing
import os
import subprocess
import sys
import time
import types
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from codebotler.simulator.engine import Lanes
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rules import PAPER
from codebotler.simulator.sandbox.execution import BudgetSpentError, Run
from codebotler.simulator.sandbox.ticks import ENTER, ENTRY, TICK, prepared
from codebotler.trace import Option, Status
from codebotler.world import World
from roboeval.records import recorded_completions
from roboeval.suite import load_suite

WORKERS = int(os.environ.get("WORKERS", "2"))
ROUNDS = 3

Pair = tuple[str, World]


def pairs() -> list[Pair]:
    """The fixed list."""
    suite = load_suite()
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


# --- the three ways


def isolated(lanes: Lanes, part: Sequence[Pair]) -> list[Status]:
    """Ours: a closed child for each pair."""

    def one(index: int) -> Status:
        source, world = part[index]
        return simulate(lanes.here(), source, lambda: SimulatedRobot(world)).status

    return list(lanes.map_distinct(one, range(len(part))))


class Bare(Run):
    """A program that runs in this process and calls the simulated robot as a function."""

    def __init__(self, robot: SimulatedRobot) -> None:
        skills = [[s.name, [[p.name, p.type.__name__] for p in s.parameters]] for s in robot.skills.values()]
        super().__init__({"skills": skills, "ticks": PAPER.limits.ticks, "seconds": PAPER.limits.seconds})
        self.robot, self.calls = robot, 0

    def request(self, message: list[Any]) -> Any:  # noqa: ANN401 - what a skill returns
        """Do what the engine would."""
        name, values = message
        self.calls += name != "sleep"
        self.spent = name == "sleep" or self.calls > PAPER.limits.calls
        if self.spent:
            raise BudgetSpentError
        arguments = [
            tuple(Option(text, is_text) for text, is_text in value) if isinstance(value, list) else value
            for value in values
        ]
        return self.robot.perform(name, arguments)


@lru_cache(maxsize=100_000)
def compiled(source: str) -> types.CodeType | BaseException:
    """A program's code, or why there is none."""
    try:
        return prepared(source, lowercase=True)[0]
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        return error


def run_bare(pair: Pair) -> None:
    """Run a pair in this process."""
    source, world = pair
    code = compiled(source)
    if isinstance(code, BaseException):
        return
    run = Bare(SimulatedRobot(world))
    namespace = {"__name__": "__main__", **run.names()}
    tick = run.ticker()
    setattr(builtins, TICK, tick)
    setattr(builtins, ENTRY, tick)
    setattr(builtins, ENTER, run.enter)
    time.sleep = run.sleep
    try:
        exec(code, namespace)
        if not run.entered:
            exec("task_program()", namespace)
    except BaseException:  # noqa: BLE001 - however a program ends, its time was measured
        return


def in_process(pool: ProcessPoolExecutor, part: Sequence[Pair]) -> None:
    """No isolation: the same programs in as many processes, each compiled once."""
    list(pool.map(run_bare, part, chunksize=max(1, len(part) // (4 * WORKERS))))


def fresh_interpreters(threads: ThreadPoolExecutor, part: Sequence[Pair]) -> None:
    """One `python -c pass` for each pair."""
    command = [sys.executable, "-c", "pass"]
    list(threads.map(lambda _: subprocess.run(command, check=True), part))


# --- measuring


def seconds(way: Callable[[Sequence[Pair]], object], part: Sequence[Pair]) -> float:
    """How long a way takes for a part of the list."""
    start = time.perf_counter()
    way(part)
    return time.perf_counter() - start


def parts(whole: Sequence[Pair]) -> Iterator[Sequence[Pair]]:
    """The list in as many parts as there are rounds; each part holds pairs from all over the list."""
    for start in range(ROUNDS):
        yield whole[start::ROUNDS]


def main() -> None:
    """Print runs per second of the three ways, and the two ratios."""
    whole = pairs()
    for source, _ in whole:
        compiled(source)  # here, so that no worker has to: they are forked from this process
    with (
        ProcessPoolExecutor(WORKERS, multiprocessing.get_context("fork")) as pool,
        Lanes(WORKERS) as lanes,
        ThreadPoolExecutor(WORKERS) as threads,
    ):
        list(pool.map(abs, range(100 * WORKERS)))
        ours = partial(isolated, lanes)
        statuses = ours(whole)
        honest = [pair for pair, status in zip(whole, statuses, strict=True) if status is not Status.TIMEOUT]
        limited = [pair for pair, status in zip(whole, statuses, strict=True) if status is Status.TIMEOUT]
        ways: dict[str, Callable[[Sequence[Pair]], object]] = {
            "isolated, one child a run (ours)": ours,
            "in-process, no isolation": partial(in_process, pool),
            "one `python -c pass` a run": partial(fresh_interpreters, threads),
        }
        times: dict[str, list[float]] = {}
        for part in parts(honest):
            for name, way in ways.items():
                times.setdefault(name, []).append(seconds(way, part))
        at_limit = seconds(ours, limited) if limited else 0.0
    report(len(honest), times)
    if limited:
        print(f"{len(limited)} pairs that reach a limit, ours: {1000 * at_limit / len(limited):.1f} ms a run")


def report(count: int, times: dict[str, list[float]]) -> None:
    """Print the figures."""
    print(f"{count} distinct pairs of program and world, {WORKERS} workers, Python {sys.version.split()[0]}")
    total = {name: sum(each) for name, each in times.items()}
    for name, spent in total.items():
        print(f"{name:36}{count / spent:10.0f} runs/s")
    ours, bare, fresh = total.values()
    print(f"ours / in-process:         {bare / ours:.3f}   (by round: {ratios(times, 1)})")
    print(f"ours / fresh interpreters: {fresh / ours:.2f}    (by round: {ratios(times, 2)})")


def ratios(times: dict[str, list[float]], other: int) -> str:
    """The ratio in each round."""
    rounds = list(times.values())
    return ", ".join(f"{b / a:.3f}" for a, b in zip(rounds[0], rounds[other], strict=True))


if __name__ == "__main__":
    main()
