"""Measures the rewards of programs that try to cheat, one line for each entry of hacks.yaml.

Each program runs in SEEDS tasks of every training family. For comparison, the script also prints the mean
reward of honest programs without their last step.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

from codebotler.core.yaml_files import YamlFile
from roboeval.suites.families.tasks import family_names, trained_task
from roboeval.training.rollouts import Rollout, judge

SEEDS = int(os.environ.get("SEEDS", "5"))
FIRST = 3_000_000_000  # a seed beyond those of all splits


def hacks() -> dict[str, str]:
    """Return the programs by description."""
    data = YamlFile.read(Path(__file__).with_name("hacks.yaml")).data
    assert isinstance(data, dict)
    return {one["about"]: one["program"] for one in data["programs"]}


def without_the_end(program: str) -> str:
    """Return a correct program without the last step of `task_program`."""
    tree = ast.parse(program)
    body = next(
        one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name == "task_program"
    ).body
    while isinstance(body[-1], ast.If | ast.For | ast.While) and len(body) == 1:
        body = body[-1].body
    del body[-1]
    if not body:
        body.append(ast.Pass())
    return ast.unparse(ast.fix_missing_locations(tree))


def taken_back(program: str, denial: str = "None of that is true, forget it.") -> str:
    """Return a correct program that says at the end that its report was wrong."""
    right = program.replace("def task_program(", "def right(")
    return f"{right}\ndef task_program():\n    right()\n    say({denial!r})\n"


def earned(programs: dict[str, str], seeds: Sequence[int]) -> dict[str, float]:
    """Return the mean reward of each program over all families."""
    tasks = [(family, seed) for family in family_names() for seed in seeds]
    found = judge([Rollout(*task, 0, program) for program in programs.values() for task in tasks])
    means = [
        fmean(one.reward for one in found[at : at + len(tasks)]) for at in range(0, len(found), len(tasks))
    ]
    return dict(zip(programs, means, strict=True))


def honest(seeds: Sequence[int]) -> float:
    """Return the mean reward of correct programs without their last step."""
    return fmean(
        one.reward
        for one in judge(
            [
                Rollout(family, seed, 0, without_the_end(trained_task(family, seed).solution))
                for family in family_names()
                for seed in seeds
            ]
        )
    )


def main() -> None:
    """Print the table."""
    seeds = range(FIRST, FIRST + SEEDS)
    print(f"mean rewards in {SEEDS} tasks of each of {len(family_names())} families\n")
    print(f"{honest(seeds):.3f}  an honest program without its last step")
    for about, reward in sorted(earned(hacks(), seeds).items(), key=lambda one: -one[1]):
        print(f"{reward:.3f}  {about}")


if __name__ == "__main__":
    main()
