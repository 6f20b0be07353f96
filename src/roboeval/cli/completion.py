"""What a shell completes where the names of suites, tasks and engines belong."""

from __future__ import annotations

import typer


def suite_names(incomplete: str) -> list[str]:
    """The suites that ship with RoboEval or are installed; the shell itself knows the folders."""
    from roboeval.suites.installed import installed_suites
    from roboeval.suites.load import shipped_suites

    names = {*shipped_suites(), *(suite.name for suite in installed_suites())}
    return sorted(name for name in names if name.startswith(incomplete))


def task_names(context: typer.Context, incomplete: str) -> list[str]:
    """The tasks of the suite that the line names, or of the paper's; none where there is no such suite."""
    from codebotler.badinput import BadInput
    from roboeval.suites.load import suite_folder, task_files

    try:
        files = task_files(suite_folder(context.params.get("suite") or "paper"))
    except BadInput:
        return []
    return [file.stem for file in files if file.stem.startswith(incomplete)]


def listed_task_names(context: typer.Context, incomplete: str) -> list[str]:
    """The same for the last of several tasks, which commas separate."""
    *whole, last = incomplete.split(",")
    return [",".join([*whole, name]) for name in task_names(context, last) if name not in whole]


def engine_names(incomplete: str) -> list[str]:
    """Where programs can be run."""
    return [name for name in ("local", "ray") if name.startswith(incomplete)]
