"""Compares what an exploration says of house rules with other ways to find it out.

The programs are those of models (the corpus at CODEBOTLER_CORPUS, or else the recorded ones), in the rooms of
the first world of their task. Each program runs in SAMPLES random worlds, with and without facts that it
takes for granted. If it meets at most FACTS facts in at most ROOMS rooms, it also runs in every world that
these facts can form, also those that it cannot tell apart. The target: no rule that is called unbreakable is
broken, and each rule that is called broken is broken in one of these worlds. PART=10 takes every tenth
program.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from math import prod
from pathlib import Path

from check import Source, real
from codebotler.checking.exploration import ExploringGuard, explore
from codebotler.checking.house_rules.file import read_rules
from codebotler.checking.sampled import CheckSettings
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import Draw, FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot
from roboeval.suites.load import load_suite

WORKERS = int(os.environ.get("WORKERS", "2"))
PART = int(os.environ.get("PART", "1"))
SAMPLES, ROOMS, FACTS = 300, 4, 12
MOST_WORLDS = 20_000  # questions with many options are left out
RULES = Path(__file__).with_name("rules.yaml")


def find_broken(
    worker: Worker, program: str, room_map: RoomMap, rules: Sequence[Rule], samplers: Iterable[FactSampler]
) -> tuple[set[str], set[tuple[Draw, ...]]]:
    """Return the names of the rules that a program breaks in some worlds, and the facts that it meets."""
    robots: list[SampledRobot] = []

    def new_robot(sampler: FactSampler) -> SampledRobot:
        robots.append(SampledRobot(room_map, sampler, guard=ExploringGuard(rules, room_map)))
        return robots[-1]

    some = list(samplers)
    for start in range(0, len(some), 64):
        these = some[start : start + 64]
        worker.run_all([(program, [lambda one=one: new_robot(one) for one in these])])  # type: ignore[misc]  # mypy infers no type of a default
    guards = [robot.guard for robot in robots if isinstance(robot.guard, ExploringGuard)]
    return set().union(*(guard.violations for guard in guards)), {tuple(robot.draws) for robot in robots}


def all_worlds(draws: Iterable[tuple[Draw, ...]], *, strict: bool) -> Iterator[FactSampler]:
    """Yield a sampler for each combination of the values of all facts."""
    facts = {(one.method, one.arguments): one for many in draws for one in many}
    values = [[one, *one.alternatives] for one in facts.values()]
    if len(facts) <= FACTS and prod(map(len, values)) <= MOST_WORLDS:
        yield from (FactSampler(strict=strict, forced=forced) for forced in product(*values))


def compare(pool: WorkerPool, source: Source) -> Counter[str]:
    """Count the rules of one program on which the exploration and the other ways agree, or do not."""
    task, program = source
    worker, rules, counts = pool.here(), read_rules(RULES), Counter[str]()
    room_map = replace(RoomMap.of(load_suite().tasks[task].scenarios[0].world), things=(), people=())
    found = explore(worker, program, room_map, CheckSettings(1, house_rules=rules))
    samplers = [FactSampler(7, number, strict) for strict in (False, True) for number in range(SAMPLES)]
    sampled, draws = find_broken(worker, program, room_map, rules, samplers)
    everywhere: set[str] = set()
    worlds = [one for strict in (False, True) for one in all_worlds(draws, strict=strict)]
    is_small = found.is_complete and len(room_map.rooms) <= ROOMS and bool(worlds)
    if is_small:
        everywhere, _ = find_broken(worker, program, room_map, rules, worlds)
        counts["programs in every world"] = 1
    for rule in rules:
        is_found, is_known = rule.name in found.violations, rule.name in sampled | everywhere
        counts["rules"] += 1
        if not found.is_complete:
            counts["unknown"] += 1
        elif is_known and not is_found:
            counts["called unbreakable, but broken"] += 1
        elif is_found and is_small and not is_known:
            counts["called broken, but kept in every world"] += 1
    return counts


def main() -> bool:
    """Compare all programs, print the figures, and return whether the target is reached."""
    sources = list(dict.fromkeys(real(load_suite())))[::PART]
    total: Counter[str] = Counter()
    with WorkerPool(WORKERS) as pool:
        futures = [pool.submit(compare, pool, source) for source in sources]
        for number, future in enumerate(futures, 1):
            total += future.result()
            print(f"\r{number:,} of {len(sources):,} programs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    for what, count in total.items():
        print(f"{what}: {count:,}")
    wrong = total["called unbreakable, but broken"] + total["called broken, but kept in every world"]
    print(f"contradictions: {wrong} {'MISSED' if wrong else 'ok'}")
    return not wrong


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
