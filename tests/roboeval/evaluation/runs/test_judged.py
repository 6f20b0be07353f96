"""What is read of a run to show one completion."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import to_line
from roboeval.evaluation.runs.folder import Run
from roboeval.evaluation.runs.judged import read_judged
from roboeval.evaluation.runs.results import read_results
from roboeval.evaluation.runs.table import keys_where


def write(run: Run, tasks: str) -> None:
    """Write a run in which each letter is the task of a completion; those in capitals passed."""
    why = {"class": "PythonError", "kind": "NameError", "world": 0, "check": None}
    verdict: dict[str, object] = {
        "world": "w",
        "status": "finished",
        "error": None,
        "line": None,
        "failed_checks": [],
    }
    written, rows = [], []
    for index, letter in enumerate(tasks):
        key = {"task": letter.lower(), "prompt": 0, "index": index}
        passed = letter.isupper()
        written.append({**key, "program": ""})
        sha = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855" if index else "changed"
        verdicts = [{**verdict, "satisfied": passed, "trace": []}]
        failure = None if passed else why
        rows.append(
            {**key, "program_sha256": sha, "passed": passed, "failure": failure, "verdicts": verdicts}
        )
    run.rows("paper").parent.mkdir(parents=True)
    run.completions.write_bytes(b"".join(map(to_line, written)))
    run.rows("paper").write_bytes(b"".join(map(to_line, rows)))
    run.head("paper").write_text(json.dumps({"suite": "paper"}))


@pytest.mark.parametrize("task", ["a", "b"])
def test_one_task_reads_like_the_whole_run(tmp_path: Path, task: str) -> None:
    run = Run(tmp_path)
    write(run, "aAbBaAb")
    whole, one = read_results(run, "paper"), read_judged(run, "paper", task=task)
    assert [*one.completions] == [key for key in whole.completions if key[0] == task]
    assert one.places == {key: place for key, place in whole.places.items() if key[0] == task}
    for column, keys in (("passed", one.passed), ("stale", one.stale)):
        assert keys == [key for key in keys_where(whole.table, column) if key[0] == task]
    assert one.row(one.passed[0]) == whole.row(one.passed[0])


def test_name_of_a_task_that_is_written_with_escapes_is_found(tmp_path: Path) -> None:
    run = Run(tmp_path)
    write(run, "aAb")
    run.completions.write_bytes(run.completions.read_bytes().replace(b'"a"', rb'"\u0061"'))
    assert len(read_judged(run, "paper", task="a").completions) == 2


def test_line_of_another_task_is_not_looked_at(tmp_path: Path) -> None:
    run = Run(tmp_path)
    write(run, "aAb")
    with run.rows("paper").open("a") as file:
        file.write("no row\n")
    assert len(read_judged(run, "paper", task="a").places) == 2
    with pytest.raises(UserError, match="not a row"):
        read_results(run, "paper")


def test_task_without_completions_is_no_error(tmp_path: Path) -> None:
    run = Run(tmp_path)
    write(run, "aAb")
    assert not read_judged(run, "paper", task="c").places


@pytest.mark.slow
def test_one_completion_is_shown_without_what_makes_tables() -> None:
    modules = "roboeval.cli.views.completions, roboeval.analysis.cluster, roboeval.evaluation.runs.selection"
    code = f"import {modules}, sys; sys.exit(bool({{'polars', 'numpy'}} & {{*sys.modules}}))"
    subprocess.run([sys.executable, "-c", code], check=True)
