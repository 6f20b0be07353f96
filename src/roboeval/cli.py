"""The command line of RoboEval."""

from __future__ import annotations

from typing import Annotated

import typer

from codebotler import __version__
from codebotler.cli import obey
from codebotler.terminal import noting_all, print_text
from roboeval.commands.catalogue import tasks
from roboeval.commands.finding import find
from roboeval.commands.generating import generate, run
from roboeval.commands.judging import evaluate, export, import_, show
from roboeval.commands.mutating import mutate
from roboeval.commands.reporting import compare, report
from roboeval.commands.resampling import resample
from roboeval.commands.serving import serve

app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


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


app.command()(generate)
app.command()(evaluate)
app.command()(run)
app.command()(show)
app.command()(find)
app.command()(tasks)
app.command()(resample)
app.command()(report)
app.command()(compare)
app.command()(mutate)
app.command()(serve)
app.command()(export)
app.command("import")(import_)


def main() -> None:
    """Run the command line."""
    with noting_all():
        obey(app, "roboeval")


if __name__ == "__main__":
    main()
