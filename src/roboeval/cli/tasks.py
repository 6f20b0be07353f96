"""Defines the command tasks, which lists, shows, lints and creates tasks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roboeval.cli.inputs import command, load_suite_option
from roboeval.cli.options import SuiteOption
from roboeval.cli.output import fail, note, print_rich, print_text, show_progress

if TYPE_CHECKING:
    from roboeval.suites.load import Suite, Task


def tasks(
    task: Annotated[str | None, typer.Argument(help="Show only this task.")] = None,
    suite: SuiteOption = "paper",
    lint: Annotated[
        bool, typer.Option("--lint", help="Look for likely mistakes; exit with status 1 if there are any.")
    ] = False,
    accepted: Annotated[
        bool, typer.Option("--accepted", help="With --lint: also list accepted findings, with the reasons.")
    ] = False,
    new: Annotated[
        str | None,
        typer.Option(help="Create a task with this name in the folder --suite, which is created if needed."),
    ] = None,
) -> None:
    """List, show or lint a suite's tasks, or create a new task."""
    if new is not None:
        if task is not None or lint or accepted:
            fail("--new can only be combined with --suite; leave out the other options")
        start(new, suite)
        return
    if accepted and not lint:
        fail("--accepted needs --lint; add --lint")
    known = load_suite_option(suite)
    if lint:
        chosen = list(known.tasks.values()) if task is None else [known.task(task)]
        lint_tasks(known, chosen, accepted=accepted)
    else:
        show(known, task)


def show(suite: Suite, task: str | None) -> None:
    """Print a table of a suite's tasks or, if a task is named, its prompts, checks and worlds."""
    from roboeval.cli.views.tasks import suite_task_view, suite_view
    from roboeval.suites.load import known_suites

    if task is not None:
        print_rich(suite_task_view(suite.task(task)))
        return
    print_rich(suite_view(suite))
    others = ", ".join(name for name in known_suites() if name != suite.name)
    note(f"other suites for --suite: {others}; or a folder of your own")


def start(task: str, suite: str) -> None:
    """Create an example task named `task` in a suite's folder, for the user to edit."""
    from roboeval.suites.load import known_suites
    from roboeval.suites.new_task import new_task

    if suite in known_suites():
        fail(f'the suite "{suite}" is installed and cannot be changed; name your own folder with --suite')
    path = new_task(Path(suite), task)
    lint = command("tasks", "--lint", suite=suite)
    note(f"{path} is a complete task; edit it, then check it with `{lint}`")


def lint_tasks(suite: Suite, tasks: Sequence[Task], *, accepted: bool) -> None:
    """Print the linter's findings, with accepted ones if `accepted`. Exit with status 1 if others exist."""
    from codebotler.simulator.pool import cores
    from roboeval.linting.findings import render
    from roboeval.linting.lint import lint
    from roboeval.linting.task_findings import judge_solutions

    matching = suite.settings.matching
    linted = (lint(one, judge_solutions(one, suite, workers=cores()), matching) for one in tasks)
    findings = [found for several in show_progress(linted, "linting", len(tasks)) for found in several]
    print_text(render(findings, accepted=accepted))
    if any(finding.accepted is None for finding in findings):
        raise SystemExit(1)
