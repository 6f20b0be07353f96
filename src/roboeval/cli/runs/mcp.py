"""Defines the command mcp, which lets an MCP client carry out the missions of a run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from codebotler.core.errors import installed
from roboeval.cli.inputs import command, load_suite_option
from roboeval.cli.options import SuiteOption, TasksOption, TurnsOption, path_to
from roboeval.cli.output import fail, note


def mcp(
    out: Annotated[Path, typer.Option(help="The run folder for the missions.", parser=path_to("a run"))],
    name: Annotated[
        str, typer.Option(help="The name of the model behind the client, for tables.")
    ] = "client",
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    num_completions: Annotated[
        int, typer.Option(min=1, max=10_000, help="Number of missions per prompt and world.")
    ] = 1,
    max_turns: TurnsOption = None,
) -> None:
    """Let an MCP client act as an agent in simulation.

    The client, such as a coding agent, starts this command and calls the robot's skills as tools. Its
    missions become a run, which `roboeval evaluate` judges.
    """
    import asyncio

    with installed():
        from roboeval.evaluation.agents.mcp_server import open_desk, serve_agent
    from roboeval.evaluation.agents.conversation import TurnLimits
    from roboeval.evaluation.agents.plan import DEFAULT_TURNS, AgentPlan
    from roboeval.evaluation.runs.folder import RunFolder, tasks_to_judge

    if sys.stdin.isatty():
        fail("this command only works if an MCP client starts it; the guide shows the client's configuration")
    known = load_suite_option(suite)
    selected = tasks_to_judge(known, tasks, ablated=False)[0]
    limits = TurnLimits(max_turns or DEFAULT_TURNS["agent"])
    plan = AgentPlan(known, selected, num_completions, mode="agent", limits=limits)
    with open_desk(RunFolder(out), plan, f"mcp:{name}") as desk:
        try:
            asyncio.run(serve_agent(desk))
        finally:
            desk.leave()
        left = len(desk.todo)
    again = command("evaluate", out, suite=suite)
    note(f"{left:,} missions are left; `{again}` judges the others")
