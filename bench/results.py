"""Measures how long it takes to read a judged run of 100,000 completions as one table.

The run is synthetic: it repeats the verdicts on programs that ship with the package under new indices. The
script prints the processor time of `load_results`, of only parsing the same files with `json`, and of
computing some statistics.
"""

import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from codebotler.core.files import to_line, to_text
from roboeval import evaluate, load_results, load_suite, recorded_completions
from roboeval.analysis.counting.counts import tally_of, task_scores
from roboeval.analysis.counting.summary import failures
from roboeval.analysis.metrics import overall
from roboeval.evaluation.evaluate import evaluation_metadata
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.rows import Seal

ROWS = int(os.environ.get("ROWS", "100000"))


def measure(what: str, function: Callable[[], object]) -> float:
    """Call a function. Print and return its processor time in seconds."""
    start = time.process_time()
    function()
    spent = time.process_time() - start
    print(f"{what:40} {spent:6.2f} s of processor time")
    return spent


def make_run(folder: Path) -> RunFolder:
    """Create a judged run with about ROWS rows."""
    run, suite = RunFolder(folder), load_suite()
    completions = list(recorded_completions("recorded:hasty", suite))
    rows = list(evaluate(completions, suite, workers=2))
    times = -(-ROWS // len(rows))
    run.rows("paper").parent.mkdir()
    with run.completions.open("wb") as file, run.rows("paper").open("wb") as judged:
        for number in range(times):
            for completion, row in zip(completions, rows, strict=True):
                index = row["index"] + 100 * number
                file.write(to_line({**completion.row, "index": index}))
                judged.write(to_line({**row, "index": index}))
    seal = Seal()
    with run.rows("paper").open("rb") as judged:
        for line in judged:
            seal.add(line)
    run.manifest("paper").write_bytes(to_text({**evaluation_metadata(suite), **seal.data()}))
    return run


def main() -> None:
    """Print the measurements and the ratio to parsing."""
    with tempfile.TemporaryDirectory() as folder:
        run = make_run(Path(folder))
        paths = (run.completions, run.rows("paper"))

        def parse() -> None:
            for path in paths:
                with path.open("rb") as file:
                    for line in file:
                        json.loads(line)

        plain = measure("parsing the files with json", parse)
        table = load_results(run.path)
        print(f"{table.height:,} rows about {sum(1 for _ in run.rows('paper').open('rb')):,} completions")
        spent = measure("load_results", lambda: load_results(run.path))
        measure("pass@1 and failures", lambda: (overall(task_scores(table), 1), failures(tally_of(table))))
        print(f"load_results takes {spent / plain:.1f} times as long as parsing")


if __name__ == "__main__":
    main()
