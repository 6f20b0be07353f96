"""Offers names for shell completion."""

from __future__ import annotations

import typer


def suite_names(incomplete: str) -> list[str]:
    """Return the names of built-in and installed suites. The shell itself completes folders."""
    from roboeval.suites.load import known_suites

    return sorted(name for name in known_suites() if name.startswith(incomplete))


def task_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return the task names of the suite on the command line, by default of `paper`."""
    from codebotler.core.errors import UserError
    from roboeval.suites.load import suite_folder, task_files

    try:
        files = task_files(suite_folder(context.params.get("suite") or "paper"))
    except UserError:
        return []
    return [file.stem for file in files if file.stem.startswith(incomplete)]


def listed_task_names(context: typer.Context, incomplete: str) -> list[str]:
    """Complete the last of several comma-separated task names."""
    *whole, last = incomplete.split(",")
    return [",".join([*whole, name]) for name in task_names(context, last) if name not in whole]
