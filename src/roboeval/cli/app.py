"""Defines the command line of RoboEval."""

from __future__ import annotations

from codebotler.cli.ending import run_command_line
from codebotler.cli.options import command_line
from codebotler.core.terminal import report_problems
from roboeval.cli.mutate import mutate
from roboeval.cli.results.compare import compare, resample
from roboeval.cli.results.find import find
from roboeval.cli.results.report import report
from roboeval.cli.results.show import export, serve, show
from roboeval.cli.runs.clarify import clarify
from roboeval.cli.runs.evaluate import evaluate, import_
from roboeval.cli.runs.generate import generate, run
from roboeval.cli.runs.mcp import mcp
from roboeval.cli.runs.recover import recover
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
    """Run the `roboeval` command with the arguments of this process."""
    with report_problems():
        run_command_line(app, "roboeval")


if __name__ == "__main__":
    main()
