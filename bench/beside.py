"""Compares the speed of this version with that of another one, each in its own environment.

    OTHER=../before/.venv/bin python bench/beside.py

Both versions do the same work in turns. They run `roboeval evaluate` on the published completions of two
models in the corpus at CODEBOTLER_CORPUS (without a corpus, of the recorded models), and on 4,000 completions
made from these by renaming variables. They compute `reward` under `plus`, and `check` programs in 5 worlds
each, one program after another, first on a running engine and then with a new engine for each. The script
prints the medians over TURNS turns and the ratio of this version to the other.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from statistics import median

from codebotler.core.files import to_line
from completions import models
from roboeval.evaluation.runs.completions import Completion, read_completions

TURNS = int(os.environ.get("TURNS", "3"))
WORKERS = os.environ.get("WORKERS", "2")
MANY = 4_000
FIRST_VARIABLE = re.compile(r"^\s+(\w+) = ", re.MULTILINE)

READ = """
import json, sys, time
rows = [json.loads(line) for line in open(sys.argv[1])]
programs = list(dict.fromkeys((row["task"], row["program"]) for row in rows))
"""
REWARD = (
    READ
    + """
from itertools import groupby
from roboeval import reward
reward("LunchTime", 0, [""], suite="plus")
began = time.perf_counter()
for task, those in groupby(sorted(programs)[::4], lambda one: one[0]):
    reward(task, 0, [program for _, program in those], suite="plus")
print(time.perf_counter() - began)
"""
)
CHECK = (
    READ
    + """
from codebotler import check
try:
    from codebotler.simulator.pool import WorkerPool
    engine, name = WorkerPool(1), "pool"
except ImportError:
    from codebotler.simulator.engine import Lanes
    engine, name = Lanes(1), "lanes"
with engine:
    check(programs[0][1], **{name: engine})
    began = time.perf_counter()
    for _, program in programs[::5]:
        check(program, **{name: engine})
    print(time.perf_counter() - began)
"""
)
CHECK_ANEW = (
    READ
    + """
from codebotler import check
check(programs[0][1])
began = time.perf_counter()
for _, program in programs[::60]:
    check(program)
print(time.perf_counter() - began)
"""
)


def main() -> None:
    """Print a line for each measurement."""
    other = os.environ.get("OTHER")
    if other is None:
        sys.exit("set OTHER to the bin folder of the other environment")
    folders = Path(sys.executable).parent, Path(other)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        real = [one for file in models(folder).values() for one in read_completions(file)]
        few, many = folder / "real.jsonl", folder / "many.jsonl"
        few.write_bytes(b"".join(map(to_line, (one.row for one in renumber(real)))))
        many.write_bytes(b"".join(map(to_line, (one.row for one in renumber(rename_variables(real))))))
        compare(f"evaluate, {len(real):,} completions", time_evaluate(few), folders)
        compare(f"evaluate, {MANY:,} completions", time_evaluate(many), folders)
        compare("reward under plus", time_script(REWARD, few), folders)
        compare("check in 5 worlds", time_script(CHECK, few), folders)
        compare("check with a new engine", time_script(CHECK_ANEW, few), folders)


def renumber(completions: list[Completion]) -> Iterator[Completion]:
    """Renumber completions so that no two of them have the same key."""
    return (replace(one, index=index) for index, one in enumerate(completions))


def rename_variables(completions: list[Completion]) -> list[Completion]:
    """Repeat completions until there are MANY. In each copy, the first variable has a different name."""
    found = []
    for number, one in enumerate(islice(cycle(completions), MANY)):
        copy, variable = number // len(completions), FIRST_VARIABLE.search(one.program)
        new = rf"\g<0>_{copy}"
        if copy and variable is not None:
            one = replace(one, program=re.sub(rf"\b{variable[1]}\b", new, one.program))  # noqa: PLW2901 - each variable in turn
        found.append(one)
    return found


def time_evaluate(file: Path) -> Callable[[Path], float]:
    """Return a function that times the whole command."""

    def time_it(folder: Path) -> float:
        start = time.perf_counter()
        command = [str(folder / "roboeval"), "evaluate", str(file), "--workers", WORKERS]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return time.perf_counter() - start

    return time_it


def time_script(script: str, file: Path) -> Callable[[Path], float]:
    """Return a function that runs a script, which measures its own time without imports."""

    def time_it(folder: Path) -> float:
        command = [str(folder / "python"), "-c", script, str(file)]
        return float(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)

    return time_it


def compare(what: str, time_it: Callable[[Path], float], folders: tuple[Path, Path]) -> None:
    """Time both versions in turns, and print the medians and their ratio."""
    times = [tuple(map(time_it, folders)) for _ in range(TURNS)]
    ours, theirs = (median(column) for column in zip(*times, strict=True))
    print(f"{what}: {ours:.2f} s, other {theirs:.2f} s, ratio {ours / theirs:.2f}", flush=True)


if __name__ == "__main__":
    main()
