"""Finds a suite by name: built-in, from an installed package, in a folder, or generated from families."""

from __future__ import annotations

import re
from importlib.metadata import EntryPoints, entry_points
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.yaml_files import YamlFile
from roboeval.suites.families.suite import family_suite, family_tasks_named
from roboeval.suites.suite import ABLATED, SUITES, Suite, read_suite, rooms_in
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
]


SUITE_NAME = re.compile(r"[a-z][a-z0-9-]*")


def load_suite(name: str | PathLike[str] = "paper", *, skills: SkillTable = SKILLS) -> Suite:
    """Return a suite of tasks, given its name or its folder.

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
        sentence = f'the suite is named "{suite.name}", but its package calls it "{name}"'
        raise YamlFile.read(folder / "suite.yaml").wrong(f"{sentence}; use the same name in both", "name")
    return suite


def has_suite(name: str) -> bool:
    """Return whether a suite is built in, installed or generated from families. Folders do not count."""
    return name in known_suites() or family_tasks_named(name) is not None


def shipped_suites() -> tuple[str, ...]:
    """Return the names of the suites that ship with RoboEval."""
    return tuple(sorted(path.parent.name for path in SUITES.glob("*/suite.yaml")))


def known_suites() -> tuple[str, ...]:
    """Return the names of the suites that ship with RoboEval or with installed packages."""
    return tuple(dict.fromkeys([*shipped_suites(), *sorted(installed_suites().names)]))


def suite_folder(name: str) -> Path:
    """Return the folder of a suite, given its name or a path. Raise UserError if there is no such suite."""
    if name in shipped_suites():
        return SUITES / name
    if SUITE_NAME.fullmatch(name) and (installed := installed_folder(name)) is not None:
        return installed.resolve()
    folder = Path(name)
    if not (folder / "suite.yaml").is_file():
        known = ", ".join(known_suites())
        raise UserError(f'unknown suite "{name}"; use one of {known}, or a folder with a suite.yaml')
    return folder.resolve()


# --- suites in installed packages


def installed_suites() -> EntryPoints:
    """Return the entry points of suites in installed packages. Several may have the same name."""
    return entry_points(group="roboeval.suites")


def installed_folder(name: str) -> Path | None:
    """Return the folder of a suite in an installed package, or None if no package has a suite of this name.

    The package is not imported. Raises UserError if the name is ambiguous or the folder has no suite.
    """
    modules = [point.value.strip() for point in installed_suites().select(name=name)]
    if not modules:
        return None
    if len(modules) > 1 or (Path(name) / "suite.yaml").is_file():
        places = " and ".join([*modules, *([f"./{name}"] if Path(name).is_dir() else [])])
        mend = f"uninstall all but one, or name a folder, such as ./{name}"
        raise UserError(f'several suites are named "{name}": {places}; {mend}')
    top, *below = modules[0].split(".")
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        spec = None
    for place in (spec and spec.submodule_search_locations) or ():
        if (Path(place, *below) / "suite.yaml").is_file():
            return Path(place, *below)
    raise UserError(f'the suite "{name}" has no suite.yaml in {modules[0]}; reinstall its package')
