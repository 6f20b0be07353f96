"""Test missions that a client of the Model Context Protocol carries out."""

import asyncio
import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from mcp import Client, StdioServerParameters
from mcp_types import TextContent

from forked import PROGRAMS, Forked
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.load import Suite, load_suite
from small_suite import write_suite

TIMEOUT_S = 60
PRELOAD = (*PROGRAMS, "roboeval.evaluation.agents.mcp_server")
WORLDS = """\
name: T
summary: s
prompts: [Say hello.]
checks:
  says(what): {category: SayAtLocation, rtl: 'tr.Exists(say("{what}"))'}
worlds:
- {about: one, robot: lobby, rooms: [lobby], require: [says("hello")]}
- {about: two, robot: lobby, rooms: [lobby], require: [says("hello")]}
- {about: three, robot: lobby, rooms: [lobby], require: [says("hello")]}
"""


@pytest.fixture
def suite(tmp_path: Path) -> Suite:
    folder = tmp_path / "suite"
    folder.mkdir()
    return load_suite(write_suite(folder, WORLDS))


def command(run: Path, suite: Suite) -> list[str]:
    arguments = ["-m", "roboeval", "mcp", "--out", str(run), "--suite", str(suite.folder), "--name", "coder"]
    return [*arguments, "--max-turns", "4"]


def client(run: Path, suite: Suite) -> Client:
    """Return a client that starts the command, as a coding agent does."""
    return Client(StdioServerParameters(command=sys.executable, args=command(run, suite), env={**os.environ}))


async def call(to: Client, name: str, **arguments: Any) -> str:  # noqa: ANN401 - JSON
    (content,) = (await to.call_tool(name, arguments)).content
    assert isinstance(content, TextContent)
    return content.text


@pytest.mark.slow
def test_a_client_continues_missions_after_a_restart(tmp_path: Path, suite: Suite) -> None:
    run = tmp_path / "run"

    async def carry_out_first() -> None:
        async with asyncio.timeout(TIMEOUT_S), client(run, suite) as agent:
            names = {tool.name for tool in (await agent.list_tools()).tools}
            assert names == {"next_mission", "finish_mission", "wait", "give_up", *suite.skills}
            assert "next_mission" in await call(agent, "say", message="hello")  # There is no mission yet.
            assert "Say hello." in await call(agent, "next_mission")
            assert "not over" in await call(agent, "next_mission")
            assert (await call(agent, "say", message="hello")) == "done"
            assert "over" in await call(agent, "finish_mission", answer="I said it.")
            await call(agent, "next_mission")
            await call(agent, "say", message="hello")  # The client disconnects during a mission.

    async def carry_out_second() -> None:
        async with asyncio.timeout(TIMEOUT_S), client(run, suite) as agent:
            await call(agent, "next_mission")
            replies = [await call(agent, "is_in_room", entity="Ann") for _ in range(4)]
            assert ["over" in one for one in replies] == [False, False, False, True]
            assert "All missions are done" in await call(agent, "next_mission")

    asyncio.run(carry_out_first())
    assert [one.more["world"] for one in RunFolder(run).read(suite)] == [0, 1]
    asyncio.run(carry_out_second())
    completions = [*RunFolder(run).read(suite)]
    assert [(one.model, one.more["ending"], one.turns) for one in completions] == [
        ("mcp:coder", "answer", 2),
        ("mcp:coder", "GaveUp", 2),  # It is not repeated.
        ("mcp:coder", "TurnLimit", 4),
    ]
    rows = [*evaluate_run(RunFolder(run), suite, ablated=False, tasks=None, redo=False)]
    assert [row["passed"] for row in rows] == [True, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_mission_like_the_end_of_input(
    tmp_path: Path, suite: Suite, number: signal.Signals
) -> None:
    about = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "c", "version": "1"}}
    asked: list[tuple[str, Any]] = [
        ("initialize", about),
        ("tools/call", {"name": "next_mission", "arguments": {}}),
    ]
    _, *words = command(tmp_path / "run", suite)
    with Forked(*words, cwd=tmp_path, environment=os.environ, preload=PRELOAD) as process:
        assert process.stdout is not None
        for one, (method, parameters) in enumerate(asked):
            request = {"jsonrpc": "2.0", "id": one, "method": method, "params": parameters}
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
            process.stdout.readline()
        process.send_signal(number)
        assert process.wait(TIMEOUT_S) == -number
    assert [one.more["ending"] for one in RunFolder(tmp_path / "run").read(suite)] == ["GaveUp"]
