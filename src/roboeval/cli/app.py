"""The command line of RoboEval."""

from __future__ import annotations

from typing import Annotated

import typer

from codebotler import __version__
from codebotler.cli.ending import obey
from codebotler.core.terminal import noting_all, print_text
from roboeval.cli.compare import compare, resample
from roboeval.cli.evaluate import evaluate, import_
from roboeval.cli.find import find
from roboeval.cli.generate import generate, run
from roboeval.cli.mutate import mutate
from roboeval.cli.report import report
from roboeval.cli.show import export, serve, show
from roboeval.cli.tasks import tasks

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)


@app.callback(invoke_without_command=True)
def roboeval(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """How good are language models at writing programs for service robots?"""
    if version:
        print_text(f"roboeval {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print_text(context.get_help())


commands = generate, evaluate, run, show, find, tasks, resample, report, compare, mutate, serve, export
for command in commands:
    app.command()(command)
app.command("import")(import_)


def main() -> None:
    """Run the command line."""
    with noting_all():
        obey(app, "roboeval")


if __name__ == "__main__":
    main()
