"""Two runs task by task: the differences of `roboeval compare`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import roboeval
from roboeval.web.comparison_page import differences_of
from roboeval.web.run_store import RunStore


@pytest.mark.slow
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
    assert one.comparison is not None
    rows = one.comparison.tasks
    compared = json.loads(roboeval("compare", tmp_path / "hasty", tmp_path / "careful", "--json").out)
    theirs = {one["task"]: one["second"] - one["first"] for one in compared["tasks"]}
    assert {row.task: row.difference.mean for row in rows} == pytest.approx(theirs)
    for row in rows:
        assert row.second - row.first == pytest.approx(row.difference.mean)
        assert row.difference.low <= row.difference.mean <= row.difference.high
    assert one.comparison.over_tasks.mean == pytest.approx(compared["difference"])
    assert one.sentence.startswith("careful is better than hasty by ")
    three = differences_of([first, second, first])
    assert [tuple(run.name for run in pair.runs) for pair in three] == [
        ("hasty", "careful"),
        ("hasty", "hasty"),
        ("careful", "hasty"),
    ]
    assert [pair.comparison for pair in three] == [None, None, None]
