"""Finds a suite by its name: one that ships, that a package brings, in a folder, or made of families."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.yaml_files import YamlFile
from roboeval.suites.families.suite import family_tasks_named
from roboeval.suites.installed import installed_suites
from roboeval.suites.schema import Accepted, Fact
from roboeval.suites.suite import (
    ABLATED,
    SUITES,
    Suite,
    read_suite,
    rooms_in,
    shipped_suites,
    suite_folder,
    task_files,
)
from roboeval.suites.task import Check, Requirement, Scenario, Task
from roboeval.suites.taskfile import read_task

__all__ = [
    "ABLATED",
    "SUITES",
    "Accepted",
    "Check",
    "Fact",
    "Requirement",
    "Scenario",
    "Suite",
    "Task",
    "has_suite",
    "load_suite",
    "read_task",
    "rooms_in",
    "shipped_suites",
    "suite_folder",
    "task_files",
]


def load_suite(name: str | PathLike[str] = "paper", *, skills: SkillTable = SKILLS) -> Suite:
    """Read a suite.

    Args:
        name: of a suite that ships with RoboEval, or that an installed package brings, or its folder; or
            `families-SPLIT-SEED`, such as `families-test-7`: a fresh task of each family, and with `-N` at
            the end N tasks.
        skills: what can stand in formulas, besides those of files that the suite names.

    Raises:
        UserError: there is no such suite, or one of its files is wrong.
    """
    name = str(name)
    if (which := family_tasks_named(name)) is not None:
        return which.suite(skills)
    folder = suite_folder(name)
    suite = read_suite(folder, skills)
    if suite.name != name and not (Path(name) / "suite.yaml").is_file():
        sentence = f'the suite is named "{suite.name}", but its package calls it "{name}"; use the same name'
        raise YamlFile.read(folder / "suite.yaml").wrong(sentence, "name")
    return suite


def has_suite(name: str) -> bool:
    """Whether a suite ships, is installed, or is made of families; no folder is looked for."""
    known = {*shipped_suites(), *(suite.name for suite in installed_suites())}
    return name in known or family_tasks_named(name) is not None
