"""Summaries of runs: each is read only when it changes, and says what is wrong with its run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.files import to_line
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import Results, read_results
from roboeval.web.run_store import MAX_SNAPSHOTS, RunStore
from roboeval.web.serializers import RunList, RunState, date_of, notes, run_data, settings_text
from seals import unseal


def test_settings_and_date_of_a_run_are_shown() -> None:
    about = {
        "settings": {
            "temperature": 0.2,
            "max_tokens": None,
            "reasoning_effort": "low",
            "extra_body": {"k": 1},
        },
        "batches": [{"started": "2026-11-28T10:00:00+00:00"}, {"started": "2026-11-27T10:00:00+00:00"}],
    }
    assert settings_text(about) == 'temperature 0.2, reasoning-effort low, extra-body {"k": 1}'
    assert date_of(about) == "2026-11-27T10:00:00+00:00"
    for wrong in ({}, {"settings": 3, "batches": [{"started": 7}]}):
        assert (settings_text(wrong), date_of(wrong)) == ("", None)


def test_many_cut_off_replies_cause_a_note(runs: Path) -> None:
    completions = RunFolder(runs / "hasty").completions
    rows = [json.loads(line) for line in completions.read_bytes().splitlines()]
    cut = [{**row, "finish_reason": "length"} for row in rows[:3]] + rows[3:]
    completions.write_bytes(b"".join(map(to_line, cut)))
    run = RunStore(runs).open("hasty")
    (said,) = notes(run)
    assert "3 of 45 replies (6.7%)" in said
    data = run_data(run)
    assert (data["cut_off"], data["tasks_there"]) == (3, 3)


def test_summaries_are_read_once_and_within_a_time_limit(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(MAX_SNAPSHOTS + 2):
        shutil.copytree(runs / "hasty", runs / f"run-{number}")
    (runs / "run-0" / "run.json").write_text("[]")
    reads: list[Path] = []

    def record_read(run: RunFolder, key: str | None, **others: Any) -> Results:  # noqa: ANN401 - its other options
        reads.append(run.path)
        return read_results(run, key, **others)

    monkeypatch.setattr("roboeval.web.run_store.read_results", record_read)
    all_runs = RunList(RunStore(runs))
    assert {run["state"] for run in all_runs.data(0)} == {RunState.READING}
    assert reads == []
    first = all_runs.data()
    assert len(reads) == len(first) == MAX_SNAPSHOTS + 3
    assert {run["judged"] for run in first if run["run"] != "run-0"} == {45}
    assert [run["run"] for run in first if run["state"] == RunState.UNREADABLE] == ["run-0"]
    assert all_runs.data(0) == all_runs.data() == first
    assert len(reads) == len(first)
    rows = RunFolder(runs / "run-3").rows("paper")
    unseal(runs / "run-3")
    rows.write_bytes(b"".join(rows.read_bytes().splitlines(keepends=True)[:9]))
    shutil.rmtree(runs / "run-4")
    (runs / "run-5" / "completions.jsonl").unlink()
    (runs / "run-5" / "completions.jsonl").symlink_to("/etc/hosts")
    changed = {run["run"]: run for run in all_runs.data()}
    assert changed["run-3"]["judged"] == 9
    assert "run-4" not in changed
    assert changed["run-5"]["state"] == RunState.UNREADABLE
    assert json.dumps(changed)
