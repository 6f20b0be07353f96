"""Measures the time and memory of a report on five models with 4,000 completions each.

The runs are synthetic: they repeat the verdicts on the programs that ship with the package. Texts in the
programs are changed, so that four in five programs of a run are distinct. The results of checks are synthetic
as well, so that no program runs, because `roboeval resample` checks the programs of a run once. The script
prints the share of each step, and compares the totals with one minute, 1 GB, and a page of 5 MB.
"""

import os
import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import polars as pl

from codebotler.core.files import to_line, to_text
from roboeval.evaluation.evaluate import evaluation_metadata
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import read_results
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.report.runs import JudgedRun, name_runs
from roboeval.report.writing import headline, sections, write_report
from roboeval.suites.load import Suite, load_suite

MODELS = int(os.environ.get("MODELS", "5"))
COMPLETIONS = int(os.environ.get("COMPLETIONS", "50"))  # per prompt
SECONDS, MEGABYTES, PAGE = 60, 1024, 5_000_000


@contextmanager
def time_step(what: str, spent: dict[str, float]) -> Iterator[None]:
    """Record the duration of a step."""
    start = time.perf_counter()
    yield
    spent[what] = spent.get(what, 0.0) + time.perf_counter() - start


@cache
def verdicts() -> list[Row]:
    """Return the verdicts on the recorded programs, in order."""
    return list(evaluate(recorded_programs(), load_suite(), workers=2))


@cache
def recorded_programs() -> list[Completion]:
    """Return the programs that ship with the package."""
    names = ("recorded:careful", "recorded:hasty")
    return [completion for name in names for completion in recorded_completions(name, load_suite())]


def make_run(folder: Path, number: int, suite: Suite) -> RunFolder:
    """Create a run with synthetic completions, which have the verdicts of the recorded ones they copy."""
    run = RunFolder(folder / f"model-{number}")
    rows = verdicts()
    by_prompt: dict[tuple[str, int], list[int]] = {}
    for at, row in enumerate(rows):
        by_prompt.setdefault((row["task"], row["prompt"]), []).append(at)
    run.rows("paper").parent.mkdir(parents=True)
    about = {"model": f"model-{number}", "settings": {"temperature": 0.2}, "codebotler": "0.1.0"}
    run.about.write_bytes(to_text(about))
    run.manifest("paper").write_bytes(to_text(evaluation_metadata(suite)))
    with run.completions.open("wb") as completions, run.rows("paper").open("wb") as judged:
        for (task, prompt), those in by_prompt.items():
            for index in range(COMPLETIONS):
                at = those[(index * (number + 1)) % len(those)]
                text = index if index % 5 else 0
                program = f"{recorded_programs()[at].program}    # {text}\n    note{text % 7} = {text}\n"
                usage = {"input_tokens": 1_500, "output_tokens": 120 + index}
                key = {"task": task, "prompt": prompt, "index": index}
                more = {"instruction": recorded_programs()[at].instruction, "usage": usage, "latency_s": 1.5}
                written = Completion.of({**key, "model": f"model-{number}", "program": program, **more})
                completions.write(to_line(written.row))
                judged.write(to_line({**rows[at], **key, "program_sha256": written.program_sha256}))
    return run


def read(run: RunFolder, suite: Suite) -> JudgedRun:
    """Read a run as the command does, as if the check rejected all programs that end in an error."""
    results = read_results(run, "paper", suite)
    accepted = pl.col("failure_check").is_not_null() | pl.col("passed")
    return JudgedRun(results, results.table.with_columns(accepted=accepted))


def main() -> None:
    """Print the share of each step, and the totals."""
    suite = load_suite()
    spent: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = [make_run(folder, number, suite) for number in range(MODELS)]
        with time_step("reading", spent):
            judged = name_runs([read(run, suite) for run in runs])
        with time_step("assembling", spent):
            parts = sections(judged, command="bench")
        written = write_report(*headline(judged), parts, folder / "report")
        before = time.perf_counter()
        for piece in written:
            kind = "drawing" if (folder / "report" / "figures" / f"{piece}.png").exists() else "writing"
            spent[kind] = spent.get(kind, 0.0) + time.perf_counter() - before
            before = time.perf_counter()
        size = (folder / "report" / "index.html").stat().st_size
    total = sum(spent.values())
    count = sum(run.completions.height for run in judged)
    for step, seconds in spent.items():
        print(f"{step}: {seconds:.1f} s, {seconds / total:.0%}")
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{MODELS} models, {count:,} completions: {total:.0f} of {SECONDS} s, "
        f"{largest:.0f} of {MEGABYTES} MB, {size:,} of {PAGE:,} bytes"
    )


if __name__ == "__main__":
    main()
