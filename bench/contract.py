"""Measures whether contracts bound what programs do, how tight they are, and which rules are decided.

Each program of models (the corpus at CODEBOTLER_CORPUS, and the recorded ones) runs in the worlds of its
task in `plus`. Its contract is derived from its text and the rooms of the world, and knows nothing else about
the world. The targets: at least COVERED of the runs stay within their contract, whose median size is at most
TIGHT times what all runs of the program together touch. At least DECIDED of the pairs of a program and a rule
are decided, in a median of less than SECONDS each. PART=10 takes every tenth program, and MAPS=3 at most
three different maps of each.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from check import Source, real
from codebotler.checking.check import check_on, extend_check
from codebotler.checking.exploration import ExploringGuard
from codebotler.checking.house_rules.file import read_rules
from codebotler.checking.problems import CheckResult
from codebotler.checking.sampled import CheckSettings
from codebotler.core.world import World
from codebotler.missions.rule_effects import LIMITED_SIMULATION
from codebotler.simulator.engine import digest
from codebotler.simulator.guard.contract import Contract, RequestedCall
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from roboeval.suites.load import load_suite

WORKERS = int(os.environ.get("WORKERS", "2"))
PART = int(os.environ.get("PART", "1"))
MAPS = int(os.environ.get("MAPS", "1000"))
COVERED, TIGHT, DECIDED, SECONDS = 0.99, 1.5, 0.80, 1.0
RULES = Path(__file__).with_name("rules.yaml")
ANYTHING = 1_000  # entries that an argument without a bound counts for


@dataclass(frozen=True)
class Measurement:
    """The results of one program in the worlds of its task.

    Args:
        source: the task and the program.
        runs: how many runs there were.
        outside: for each run that left its contract, the world and the call.
        size: the number of entries of its contracts.
        touched: the number of entries that its runs used.
        verdicts: how many rules were decided, and how many not.
        seconds: how long the exploration took, for each rule.
    """

    source: Source
    runs: int
    outside: tuple[tuple[str, RequestedCall], ...]
    size: int
    touched: int
    verdicts: Counter[str]
    seconds: float


def worlds_of(task: str) -> Iterator[World]:
    """Yield the worlds of a task in `plus`."""
    for scenario in load_suite("plus").tasks[task].scenarios:
        yield scenario.world


def measure(worker: Worker, source: Source) -> Measurement:
    """Derive the contracts of a program, and run it in all worlds of its task."""
    task, program = source
    rules = read_rules(RULES)
    outside: list[tuple[str, RequestedCall]] = []
    entries: set[object] = set()
    touched: set[object] = set()
    verdicts: Counter[str] = Counter()
    known: dict[RoomMap, CheckResult] = {}
    seconds = runs = 0.0
    for world in worlds_of(task):
        room_map = replace(RoomMap.of(world), things=(), people=(), traits=())
        if room_map not in known:
            if len(known) == MAPS:
                continue
            began = time.perf_counter()
            found = check_on(worker, program, room_map, CheckSettings(1))
            settings = CheckSettings(1, house_rules=rules)
            known[room_map] = extend_check(worker, program, found, settings)
            seconds += time.perf_counter() - began
            verdicts += Counter(proof.verdict for proof in known[room_map].proofs)
        contract = known[room_map].contract
        if contract is None:
            continue
        calls = calls_in(worker, program, world)
        runs += 1
        entries |= set(entries_of(contract))
        touched |= {entry for call in calls for entry in touched_by(call)}
        earlier: Counter[str] = Counter()
        for call in calls:
            if why := contract.objection(call, earlier[call.skill]):
                outside.append((f"{world.about}: {why}", call))
                break
            earlier[call.skill] += 1
    each = seconds / max(1, verdicts.total())
    return Measurement(source, int(runs), tuple(outside), len(entries), len(touched), verdicts, each)


def calls_in(worker: Worker, program: str, world: World) -> list[RequestedCall]:
    """Run a program in a world, and return its calls."""
    guards: list[ExploringGuard] = []

    def new_robot() -> SimulatedRobot:
        guards.append(ExploringGuard((), RoomMap.of(world)))
        return SimulatedRobot(world, LIMITED_SIMULATION, guard=guards[-1])

    worker.run(program, new_robot)
    return guards[-1].calls


def entries_of(contract: Contract) -> Iterator[tuple[str, ...]]:
    """Yield an entry for each text that a contract allows."""
    for skill, bound in contract.skills.items():
        for name, templates in bound.texts:
            if any(one.is_any for one in templates):
                yield from ((skill, name, str(number)) for number in range(ANYTHING))
            else:
                yield from ((skill, name, str(one).casefold()) for one in templates)


def touched_by(call: RequestedCall) -> Iterator[tuple[str, ...]]:
    """Yield an entry for each text of a call."""
    for number, texts in enumerate(call.texts):
        yield from ((call.skill, str(number), text.casefold()) for text in texts)


def measure_here(pool: WorkerPool, source: Source) -> Measurement:
    """Measure a program on the worker of this thread."""
    return measure(pool.here(), source)


def main() -> bool:
    """Measure all programs, print the figures, and return whether the targets are reached."""
    sources = list(dict.fromkeys(real(load_suite())))[::PART]
    with WorkerPool(WORKERS) as pool:
        found = []
        futures = [pool.submit(measure_here, pool, source) for source in sources]
        for number, future in enumerate(futures, 1):
            found.append(future.result())
            print(f"\r{number:,} of {len(sources):,} programs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return report(found)


def report(found: list[Measurement]) -> bool:
    """Print the figures, and return whether the targets are reached."""
    runs, outside = sum(one.runs for one in found), [each for one in found for each in one.outside]
    for one in found:
        for where, call in one.outside[:1]:
            print(f"outside: {one.source[0]} {digest(one.source[1]).hex()[:8]}: {where}: {call}")
    verdicts = sum((one.verdicts for one in found), Counter())
    covered, decided = 1 - len(outside) / runs, 1 - verdicts["unknown"] / verdicts.total()
    size = statistics.median(one.size / one.touched for one in found if one.touched)
    seconds = statistics.median(one.seconds for one in found)
    figures = {
        f"runs within their contract, of {runs:,}": (covered, covered >= COVERED),
        "median size of contracts, as a multiple of what was touched": (size, size <= TIGHT),
        f"decided pairs of a program and a rule, of {verdicts.total():,}": (decided, decided >= DECIDED),
        "seconds for a pair, median": (seconds, seconds < SECONDS),
    }
    for what, (figure, holds) in figures.items():
        print(f"{what}: {figure:.4f} {'ok' if holds else 'MISSED'}")
    return all(holds for _, holds in figures.values())


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
