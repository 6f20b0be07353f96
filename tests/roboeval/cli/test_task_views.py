"""Tasks as people read them."""

import re

from roboeval.cli.views.tasks import suite_task_view
from roboeval.suites.load import Suite, load_suite
from small_run import printed


def test_what_some_prompts_ask_is_shown_with_them() -> None:
    shown = printed(suite_task_view(load_suite("plus").task("SayGoodDay")), 200)
    assert 'requires not speaks_in("sam\'s lab") for prompt 0, 1, 2 or 4' in shown
    assert not re.search(r"requires not greets_in\(.*\) for", shown)


def test_a_text_longer_than_a_line_is_broken_and_nothing_is_lost(paper: Suite) -> None:
    task = paper.task("LunchTime")
    shown = printed(suite_task_view(task), 24)
    assert max(map(len, shown.splitlines())) <= 24
    for check in task.checks:
        assert re.sub(r"\s", "", check.rtl) in re.sub(r"\s", "", shown)
