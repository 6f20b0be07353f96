"""Defines the command line of RoboEval."""

from __future__ import annotations

from codebotler.cli.ending import obey
from codebotler.cli.options import command_line
from codebotler.core.terminal import report_problems
from roboeval.cli.clarify import clarify
from roboeval.cli.compare import compare, resample
from roboeval.cli.evaluate import evaluate, import_
from roboeval.cli.find import find
from roboeval.cli.generate import generate, run
from roboeval.cli.mcp import mcp
from roboeval.cli.mutate import mutate
from roboeval.cli.recover import recover
from roboeval.cli.report import report
from roboeval.cli.show import export, serve, show
from roboeval.cli.tasks import tasks

app = command_line("roboeval", "Measure how well language models write programs for service robots.")
commands = (
    generate,
    evaluate,
    run,
    show,
    find,
    tasks,
    resample,
    clarify,
    report,
    compare,
    mcp,
    mutate,
    recover,
    serve,
    export,
)
for command in commands:
    app.command()(command)
app.command("import")(import_)


def main() -> None:
    """Run the command line."""
    with report_problems():
        obey(app, "roboeval")


if __name__ == "__main__":
    main()
