"""Reference solutions: their files, their order, and wrong files."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from codebotler.core.errors import UserError
from codebotler.models.recorded import open_recorded
from roboeval.suites.load import Suite, Task
from roboeval.suites.solutions import equivalent_mutants, solutions


def with_solutions(task: Task, folder: Path, text: str) -> Task:
    """Return the task as part of a suite in another folder, with a file of solutions."""
    (folder / "solutions").mkdir()
    (folder / "solutions" / task.path.name).write_text(text)
    return replace(task, path=folder / "tasks" / task.path.name)


def test_replies_of_recorded_models_come_first(paper: Suite) -> None:
    for task in paper.tasks.values():
        replies = [
            reply
            for name in ("careful", "hasty")
            for prompt in task.prompts
            for reply in open_recorded(name).replies[prompt]
        ]
        written = solutions(task)[len(replies) :]
        assert solutions(task)[: len(replies)] == tuple(replies)
        assert len(written) >= 10
        assert all(one.fails is None or one.right for one in written)
        assert len({one.about for one in solutions(task)}) == len(solutions(task))


def test_a_task_with_a_borrowed_instruction_has_its_solutions_too(tmp_path: Path, paper: Suite) -> None:
    theirs = solutions(paper.task("LunchTime"))
    programs = [
        {"about": "mine", "program": "x"},
        {"about": "again", "fails": "Location", "program": theirs[0].program},
    ]
    text = yaml.safe_dump({"programs": programs})
    task = with_solutions(paper.task("LunchTime"), tmp_path, text)
    mine = solutions(task)
    assert [(one.about, one.fails) for one in mine] == [("mine", None), ("again", "Location")]
    assert solutions(replace(task, borrows=True)) == (*mine, *theirs[1:])


def test_a_suite_may_have_no_solutions(tmp_path: Path, paper: Suite) -> None:
    task = replace(paper.task("LunchTime"), path=tmp_path / "tasks" / "LunchTime.yaml")
    assert solutions(task) == ()
    assert equivalent_mutants(task) == {}


def test_a_solution_without_a_program_is_refused(tmp_path: Path, paper: Suite) -> None:
    task = with_solutions(
        paper.task("LunchTime"), tmp_path, "programs:\n  - about: a\n    program: b\n  - about: c\n"
    )
    with pytest.raises(UserError, match='"program"') as caught:
        solutions(task)
    assert (caught.value.file, caught.value.line) == (tmp_path / "solutions" / "LunchTime.yaml", 4)
