"""Two runs task by task: the differences that `roboeval compare` has."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import roboeval
from roboeval.web.difference import differences_of
from roboeval.web.run_store import RunStore


def test_differences_are_those_of_compare(tmp_path: Path) -> None:
    for name in ("hasty", "careful"):
        words = (
            "evaluate",
            f"recorded:{name}",
            "--out",
            tmp_path / name,
            "--tasks",
            "LunchTime,SayGoodDay,GetDrink",
        )
        assert roboeval(*words).status == 0
    store = RunStore(tmp_path)
    first, second = store.open("hasty"), store.open("careful")
    (one,) = differences_of([first, second])
    told = json.loads(roboeval("compare", tmp_path / "hasty", tmp_path / "careful", "--json").out)
    assert one.comparison is not None
    assert one.comparison.over_tasks.mean == pytest.approx(told["difference"])
    assert {row.task for row in one.comparison.tasks} == {row["task"] for row in told["tasks"]}
    assert one.sentence.startswith("careful is better than hasty by ")
    three = differences_of([first, second, first])
    assert [tuple(run.name for run in pair.runs) for pair in three] == [
        ("hasty", "careful"),
        ("hasty", "hasty"),
        ("careful", "hasty"),
    ]
