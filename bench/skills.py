"""Measures how much misuse of custom skills the check finds before a robot moves.

Each correct program of the sets in `examples/skills` is changed by the operators for custom skills, and by
swapping steps. A changed program is a misuse if it passes an argument that a skill does not accept, or if it
ends in an error or breaks a house rule of the set in any of WORLDS sampled worlds. For each operator, the
script prints how many changed programs are a misuse, how many of these the check finds in 5 worlds, and how
many others it rejects. It also prints each misuse that the check misses.
"""

import os
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from codebotler.checking.check import check
from codebotler.checking.house_rules.file import read_rules
from codebotler.core.trace import Status
from codebotler.core.world import World
from codebotler.core.world_file import read_world
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import AS_WRITTEN, SampledRobot
from roboeval.mutation.mutants import Mutant, mutants, originals
from roboeval.mutation.operator import Context, Operator, operators_in
from roboeval.mutation.operators import control_flow, misuse
from roboeval.suites.load import Suite, load_suite

SETS = Path(__file__).parents[1] / "examples" / "skills"
WORLDS = int(os.environ.get("WORLDS", "300"))
SWAP = "swap-steps"
ALWAYS = {
    "pass-another-type",
    "pass-no-choice",
    "forget-an-argument",
}  # These are a misuse even if the program catches errors.


def operators() -> list[Operator]:
    """Return the operators for custom skills, and the one that swaps steps."""
    return [*operators_in(misuse), *(one for one in operators_in(control_flow) if one.name == SWAP)]


def change_programs(suite: Suite) -> Iterator[Mutant]:
    """Yield the changed programs of a set."""
    for task in suite.tasks.values():
        worlds = [scenario.world for scenario in task.scenarios]
        yield from mutants(originals(task), Context.of(worlds, task.prompts), operators())


def is_misuse(pool: WorkerPool, program: str, suite: Suite, world: World, rules: tuple[Rule, ...]) -> bool:
    """Return whether a program ends in an error or breaks a rule in some world."""
    rooms = RoomMap.of(world)

    def robot(number: int) -> SimulatedRobot:
        sampler = FactSampler(7_919, number, lucky=number % 2 == 1)
        return SampledRobot(rooms, sampler, AS_WRITTEN, suite.skills, guard=RuleGuard(rules))

    (outcomes,) = pool.here().run_all([(program, [partial(robot, number) for number in range(WORLDS)])])
    return any(outcome.status not in {Status.FINISHED, Status.TIMEOUT} for outcome in outcomes)


def main() -> None:
    """Print the table, and each misuse that the check misses."""
    all_of, bad, found, wrongly = Counter[str](), Counter[str](), Counter[str](), Counter[str]()
    missed: list[tuple[str, Mutant]] = []
    with WorkerPool(1) as pool:
        for folder in sorted(path.parent for path in SETS.glob("*/suite.yaml")):
            suite = load_suite(folder)
            world, rules = read_world(folder / "world.yaml"), read_rules(folder / "rules.yaml", suite.skills)
            for mutant in change_programs(suite):
                name = mutant.operator
                all_of[name] += 1
                known = RoomMap.of(world)
                rejected = bool(
                    check(
                        mutant.program, room_map=known, skills=suite.skills, pool=pool, house_rules=rules
                    ).problems
                )
                if name in ALWAYS or is_misuse(pool, mutant.program, suite, world, rules):
                    bad[name] += 1
                    found[name] += rejected
                    if not rejected:
                        missed.append((folder.name, mutant))
                else:
                    wrongly[name] += rejected
    print(f"{'operator':28}{'changed':>9}{'misuse':>9}{'found':>9}{'rejected wrongly':>18}")
    for name in sorted(all_of):
        print(f"{name:28}{all_of[name]:>9}{bad[name]:>9}{found[name]:>9}{wrongly[name]:>18}")
    share = found.total() / bad.total()
    print(f"{'all':28}{all_of.total():>9}{bad.total():>9}{found.total():>9}{wrongly.total():>18}")
    print(
        f"found before running: {share:.1%} of {bad.total()}, in {WORLDS} worlds each; missed: {len(missed)}"
    )
    for folder_name, mutant in missed:
        print(f"\n{folder_name}, {mutant.operator}, of {mutant.original.name!r}\n{mutant.diff}")


if __name__ == "__main__":
    main()
