"""Tasks as people read them."""

import re

from roboeval.cli.views.tasks import clauses_view, suite_task_view
from roboeval.suites.load import Suite, load_suite
from small_run import printed


def test_what_some_prompts_ask_is_shown_with_them() -> None:
    shown = printed(suite_task_view(load_suite("plus").task("SayGoodDay")), 200)
    assert 'requires not speaks_in("sam\'s lab") for prompt 0, 1, 2 or 4' in shown
    assert not re.search(r"requires not greets_in\(.*\) for", shown)


def test_the_clauses_of_prompts_stand_beside_what_covers_them() -> None:
    shown = printed(clauses_view([load_suite("plus").task("SayGoodDay")]), 200)
    assert re.search(
        r" Say nothing in a lab where you find nobody\.  +looks_into, greets_in, speaks_in *\n", shown
    )
    firsts = [parts for line in shown.splitlines() if (parts := line.split()) and parts[0].isdigit()]
    assert [parts[0] for parts in firsts] == ["0", "1", "2", "3", "4"]


def test_a_text_longer_than_a_line_is_broken_and_nothing_is_lost(paper: Suite) -> None:
    task = paper.task("LunchTime")
    shown = printed(suite_task_view(task), 24)
    assert max(map(len, shown.splitlines())) <= 24
    for check in task.checks:
        assert re.sub(r"\s", "", check.rtl) in re.sub(r"\s", "", shown)
