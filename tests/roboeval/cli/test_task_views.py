"""Tasks as people read them."""

import re

import pytest

from roboeval.cli.views.tasks import suite_task_view
from roboeval.suites.load import Suite
from small_run import printed


@pytest.mark.parametrize("width", [60, 80, 200])
def test_no_text_of_a_formula_is_torn(paper: Suite, width: int) -> None:
    for task in paper.tasks.values():
        shown = printed(suite_task_view(task), width).split("\nChecks\n")[1]
        lines = shown.splitlines()
        assert max(map(len, lines)) <= width
        in_formulas = [line for line in lines if "answers" not in line]
        assert [line for line in in_formulas if line.count('"') % 2] == []
        told = "".join(shown.split())
        for check in task.checks:
            assert "".join(check.rtl.split()) in told


def test_a_text_longer_than_a_line_is_broken_and_nothing_is_lost(paper: Suite) -> None:
    task = paper.task("LunchTime")
    shown = printed(suite_task_view(task), 24)
    assert max(map(len, shown.splitlines())) <= 24
    for check in task.checks:
        assert re.sub(r"\s", "", check.rtl) in re.sub(r"\s", "", shown)
