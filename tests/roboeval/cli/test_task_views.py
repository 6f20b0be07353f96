"""Views of tasks for people."""

import re

from roboeval.cli.views.tasks import suite_task_view
from roboeval.suites.load import Suite, load_suite
from small_run import text_of


def test_requirements_of_some_prompts_only_name_them() -> None:
    shown = text_of(suite_task_view(load_suite("plus").task("SayGoodDay")), 200)
    assert 'requires not speaks_in("sam\'s lab") for prompt 0, 1, 2 or 4' in shown
    assert not re.search(r"requires not greets_in\(.*\) for", shown)


def test_long_texts_are_wrapped_without_loss(paper: Suite) -> None:
    task = paper.task("LunchTime")
    shown = text_of(suite_task_view(task), 24)
    assert max(map(len, shown.splitlines())) <= 24
    for check in task.checks:
        assert re.sub(r"\s", "", check.rtl) in re.sub(r"\s", "", shown)
