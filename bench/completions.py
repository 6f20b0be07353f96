"""Measures the speed of a complete evaluation, and how its memory grows.

The first part judges the published completions of two models in the corpus at CODEBOTLER_CORPUS (without a
corpus, of the recorded models). It prints how many rows, runs, and executed pairs of program and world the
command and the evaluation alone process per second. The paper's own code does runs one by one, 0.354 s each.
The second part judges synthetic completions, of which nine in ten repeat another one. It prints the time, and
the memory of the largest process. The third part judges distinct completions with 1, 2, 4 and 8 workers. If
there are more workers than cores, it only shows the overhead of the additional ones.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from codebotler.core.files import to_line
from codebotler.simulator.pool import cores
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import read_completions
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite

ORIGINAL = 0.354  # seconds per run
ROWS = tuple(int(n) for n in os.environ.get("ROWS", "1000,10000,100000").split(","))
DIFFERENT = int(os.environ.get("DIFFERENT", "20000"))
DISTINCT = 10  # one of this many rows has a new program
WORKERS = os.environ.get("WORKERS", "2")
TASK = "SayGoodDay"
PROGRAM = "def task_program():\n    say('this is {number}')\n    go_to('lobby')\n"


def run_command(file: Path, workers: str = WORKERS) -> tuple[float, float]:
    """Judge a file of completions. Return the seconds, and the megabytes of the largest process."""
    command = [
        sys.executable,
        "-m",
        "roboeval.cli.app",
        "evaluate",
        str(file),
        "--workers",
        workers,
        "--json",
    ]
    measure = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    start = time.perf_counter()
    ended = subprocess.run(
        [sys.executable, "-c", measure, *command], check=True, capture_output=True, text=True
    )
    return time.perf_counter() - start, int(ended.stdout) / 1024


def print_models(folder: Path) -> None:
    """Print the figures for real models."""
    suite = load_suite()
    for name, file in models(folder).items():
        rows = [(c.task, c.program) for c in read_completions(file)]
        worlds = {task: len(suite.tasks[task].scenarios) for task, _ in rows}
        runs, executed = (sum(worlds[task] for task, _ in some) for some in (rows, set(rows)))
        print(f"{name}: {len(rows)} rows, {runs} runs, {executed} executed")
        for what, spent in (("the command", run_command(file)[0]), ("its evaluation", judge(file, suite))):
            print(
                f"    {what} in {spent:.2f} s: {len(rows) / spent:.0f} rows/s, {runs / spent:.0f} runs/s, "
                f"{executed / spent:.0f} executed/s, "
                f"{ORIGINAL * executed / spent:.0f} times the paper's own code"
            )


def judge(file: Path, suite: Suite) -> float:
    """Judge a file of completions in this process, and return the seconds."""
    start = time.perf_counter()
    for _ in evaluate(read_completions(file), suite, workers=int(WORKERS)):
        pass
    return time.perf_counter() - start


def models(folder: Path) -> dict[str, Path]:
    """Return the files of completions by model."""
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    if corpus:
        return {file.stem: file for file in sorted(Path(corpus, "corpus", "completions").glob("*.jsonl"))}
    files = {}
    for name in ("recorded:careful", "recorded:hasty"):
        files[name] = folder / f"{name.partition(':')[2]}.jsonl"
        rows = recorded_completions(name, load_suite())
        files[name].write_bytes(b"".join(to_line(one.row) for one in rows))
    return files


def print_growth(folder: Path) -> None:
    """Print time and memory for increasing numbers of rows."""
    for count in ROWS:
        file = folder / f"{count}.jsonl"
        with file.open("w") as rows:
            for number in range(count):
                program = PROGRAM.format(number=number % (count // DISTINCT))
                row = {"task": TASK, "prompt": number % 5, "index": number // 5, "program": program}
                rows.write(json.dumps(row) + "\n")
        spent, largest = run_command(file)
        pairs = count // DISTINCT * len(load_suite().tasks[TASK].scenarios)
        print(
            f"{count:7} rows, {pairs:6} distinct pairs: {spent:6.1f} s, "
            f"{1000 * spent / pairs:.2f} ms per pair, {largest:.0f} MB"
        )


def print_scaling(folder: Path) -> None:
    """Print the time for increasing numbers of workers."""
    file = folder / "different.jsonl"
    with file.open("w") as rows:
        for number in range(DIFFERENT):
            row = {
                "task": TASK,
                "prompt": number % 5,
                "index": number,
                "program": PROGRAM.format(number=number),
            }
            rows.write(json.dumps(row) + "\n")
    print(f"{DIFFERENT:,} different completions on {cores()} cores:")
    alone = run_command(file, "1")[0]
    for workers in (1, 2, 4, 8):
        spent = alone if workers == 1 else run_command(file, str(workers))[0]
        print(f"    {workers} workers: {spent:.1f} s, {alone / spent:.2f} times as fast as one")


def main() -> None:
    """Print all parts."""
    with tempfile.TemporaryDirectory() as name:
        print_models(Path(name))
        print_growth(Path(name))
        print_scaling(Path(name))


if __name__ == "__main__":
    main()
