"""The guide lists the modules, keys and categories that the code has."""

import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from codebotler.checking.check import check
from codebotler.core.trace import Status
from codebotler.core.world import Room, World
from codebotler.core.world_file import OptionFile, PersonFile, RoomFile
from codebotler.models.recorded import Solution
from codebotler.simulator.engine import run
from codebotler.simulator.sandbox.stdlib import LISTED
from roboeval.linting.findings import FindingKind
from roboeval.suites.schema import (
    Ability,
    AcceptedFinding,
    Category,
    CheckFile,
    CornerFile,
    SampledPersonFile,
    SampledTaskFile,
    SampledThingFile,
    SampledWorldsFile,
    ScenarioFile,
    SuiteFile,
    TaskFact,
    TaskFile,
)
from roboeval.suites.solutions import EquivalentMutantFile, SolutionsFile

DOCS = Path(__file__).parent.parent / "docs"
GUIDE = (DOCS / "index.md").read_text()


def test_guide_lists_all_modules_that_a_program_can_import() -> None:
    listed = re.search(r"\n## What a program can import\n.*?```text\n(.*?)```", GUIDE, re.DOTALL)
    assert listed is not None
    assert listed[1].split() == LISTED


def test_program_can_import_parts_of_listed_modules() -> None:
    sentence = re.search(r"made of, such as (.*?), can be imported", GUIDE, re.DOTALL)
    assert sentence is not None
    names = re.findall("`(.+?)`", sentence[1])
    assert names
    assert not set(names) & set(LISTED)
    world = World((Room("hall"),), "hall")
    programs = [f"import {name}\ndef task_program():\n    pass\n" for name in [*names, "numpy"]]
    *can, cannot = run([(program, world) for program in programs], workers=1)
    assert {outcome.status for outcome in can} == {Status.FINISHED}
    assert cannot.status is Status.PYTHON_ERROR


def test_the_keys_of_a_check_are_documented() -> None:
    page = (DOCS / "imagined-worlds.md").read_text().partition("## JSON")[2]
    documented = [re.findall(r"`(\w+)`", row) for row in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE)]
    data = check("def task_program():\n    go_to('a')\n    say(b)\n").data()
    existing = [*data, *data["problems"][0], *data["samples"][0]]
    assert [key for keys in documented for key in keys] == existing


# --- keys of task files


TASK_PAGE, PLUS_PAGE = "write-a-task.md", "roboeval-plus.md"


def table(page: str, head: str) -> list[list[str]]:
    """Return the cells of a table on a page, row by row."""
    _, _, rest = (DOCS / page).read_text().partition(f"\n| {head} |")
    assert rest, head
    return [line.strip("|").split(" | ") for line in rest.partition("\n\n")[0].splitlines()[2:]]


def first_column(page: str, head: str) -> list[str]:
    """Return the names in the first column of a table."""
    return [name for first, *_ in table(page, head) for name in re.findall(r"`([^`]+)`", first)]


def keys(*forms: type[BaseModel]) -> set[str]:
    """Return the keys that files may have, spelt as in the files."""
    fields = (field for form in forms for field in form.model_fields.items())
    return {field.alias or name for name, field in fields}


@pytest.mark.parametrize(
    ("head", "known"),
    [("category", get_args(Category)), ("ability", get_args(Ability)), ("finding", get_args(FindingKind))],
)
def test_categories_abilities_and_findings_are_listed(head: str, known: tuple[str, ...]) -> None:
    assert sorted(first_column(TASK_PAGE, head)) == sorted(known)
    assert all(all(cell.strip() for cell in row) for row in table(TASK_PAGE, head))


@pytest.mark.parametrize(
    ("page", "head", "forms"),
    [
        (TASK_PAGE, "key of `suite.yaml`", (SuiteFile,)),
        (TASK_PAGE, "key of a task", (TaskFile, SampledTaskFile)),
        (TASK_PAGE, "key of a world", (ScenarioFile,)),
        (TASK_PAGE, "key of a room", (RoomFile,)),
        (TASK_PAGE, "key of a person", (PersonFile,)),
        (TASK_PAGE, "key of a file of solutions", (SolutionsFile,)),
        (TASK_PAGE, "key of a program", (Solution,)),
        (PLUS_PAGE, "key", (SampledWorldsFile,)),
        (PLUS_PAGE, "key of a person", (SampledPersonFile,)),
        (PLUS_PAGE, "key of a thing", (SampledThingFile,)),
    ],
)
def test_the_keys_of_files_are_listed(page: str, head: str, forms: tuple[type[BaseModel], ...]) -> None:
    listed = first_column(page, head)
    assert len(listed) == len(set(listed))
    assert set(listed) == keys(*forms)


@pytest.mark.parametrize(
    ("page", "head", "row", "form"),
    [
        (TASK_PAGE, "key of a task", "`facts`", TaskFact),
        (TASK_PAGE, "key of a task", "`checks`", CheckFile),
        (TASK_PAGE, "key of a task", "`accepted`", AcceptedFinding),
        (TASK_PAGE, "key of a person", "`answers`", OptionFile),
        (TASK_PAGE, "key of a file of solutions", "`equivalent_mutants`", EquivalentMutantFile),
        (PLUS_PAGE, "key", "`corners`", CornerFile),
    ],
)
def test_nested_keys_are_listed(page: str, head: str, row: str, form: type[BaseModel]) -> None:
    (meaning,) = (text for first, text in table(page, head) if first.strip() == row)
    listed = re.findall(r"`\{?(\w+)(?:: [^`]*)?`", meaning)
    assert keys(form) <= set(listed)
