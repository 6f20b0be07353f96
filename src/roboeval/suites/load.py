"""Finds a suite by name: built-in, from an installed package, in a folder, or generated from families."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.yaml_files import YamlFile
from roboeval.suites.families.suite import family_suite, family_tasks_named
from roboeval.suites.suite import (
    ABLATED,
    SUITES,
    Suite,
    known_suites,
    read_suite,
    rooms_in,
    shipped_suites,
    suite_folder,
)
from roboeval.suites.task import Requirement, Scenario, Task, TaskCheck
from roboeval.suites.taskfile import read_task

__all__ = [
    "ABLATED",
    "SUITES",
    "Requirement",
    "Scenario",
    "Suite",
    "Task",
    "TaskCheck",
    "has_suite",
    "known_suites",
    "load_suite",
    "read_task",
    "rooms_in",
    "shipped_suites",
    "suite_folder",
]


def load_suite(name: str | PathLike[str] = "paper", *, skills: SkillTable = SKILLS) -> Suite:
    """Read a suite.

    Args:
        name: a suite that ships with RoboEval or with an installed package, a folder, or
            `families-SPLIT-SEED`, such as `families-test-7`, for a new task from each family. Append `-N`
            for N tasks.
        skills: the skills that formulas may use, in addition to skills declared in the suite's files.

    Raises:
        UserError: the suite does not exist, or one of its files is not valid.
    """
    name = str(name)
    if (which := family_tasks_named(name)) is not None:
        return family_suite(which, skills)
    folder = suite_folder(name)
    suite = read_suite(folder, skills)
    if suite.name != name and not (Path(name) / "suite.yaml").is_file():
        sentence = (
            f'the suite is named "{suite.name}", but its package calls it "{name}"; use the same name in both'
        )
        raise YamlFile.read(folder / "suite.yaml").wrong(sentence, "name")
    return suite


def has_suite(name: str) -> bool:
    """Whether a suite is built in, installed or generated from families. Folders do not count."""
    return name in known_suites() or family_tasks_named(name) is not None
