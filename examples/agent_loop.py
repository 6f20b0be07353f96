"""An agent without a model: it proposes a program, and a person at the terminal approves it.

    python examples/agent_loop.py

To turn it into an agent, give `tools` to your model, and call those that it chooses with `client.call_tool`.
"""

import asyncio
import os
import sys
import termios
from pathlib import Path
from typing import Any

from mcp import Client, StdioServerParameters
from mcp.client.session import ClientRequestContext
from mcp_types import ElicitRequestParams, ElicitResult

OFFICE = Path(__file__).parent / "office.yaml"
SERVER = StdioServerParameters(
    command=sys.executable,
    args=["-m", "codebotler", "mcp", "--world", str(OFFICE), "--speed", "20"],
    env=dict(os.environ),  # for CODEBOTLER_HOME and the keys of models
)
PROGRAM = """
def task_program():
    start = get_current_location()
    go_to("printer room 1")
    found = is_in_room("stapler")
    go_to(start)
    say("Printer room 1 has a stapler." if found else "Printer room 1 has no stapler.")
"""


async def ask(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the client passes it
    """Ask the person at the terminal. Never answer such a question with a model."""
    print(f"\n{params.message}\n")
    if sys.stdin.isatty():  # what was typed before the question is no answer to it
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
    try:
        answer = await asyncio.to_thread(input, "May the robot do this? [y/N] ")
    except EOFError:
        answer = ""
    if answer.strip().lower() != "y":
        return ElicitResult(action="decline")
    return ElicitResult(action="accept", content={"approve": True})


async def call(client: Client, tool: str, **arguments: Any) -> Any:  # noqa: ANN401 - of any type
    """Call a tool, and return its result or raise an error."""
    result = await client.call_tool(tool, arguments)
    if result.is_error:
        raise RuntimeError(" ".join(getattr(part, "text", "") for part in result.content))
    return result.structured_content


async def main() -> None:
    """Propose one program, and show what came of it."""
    async with Client(SERVER, elicitation_callback=ask) as client:
        tools = [tool.name for tool in (await client.list_tools()).tools]
        robot = await call(client, "read_robot")
        print(f"{len(tools)} tools, {len(robot['rooms'])} rooms")
        report = await call(
            client, "propose_mission", instruction="Does printer room 1 have a stapler?", program=PROGRAM
        )
        if not report["is_over"]:  # it is over if, for example, another tool uses the robot
            report = await call(client, "run_mission", digest=report["digest"])
        while not report["is_over"]:
            report = await call(client, "follow_mission", after=report["event_count"])
        print("\n".join(report["events"]))
        print(f"the mission is {report['state'] or report['reason']}")


asyncio.run(main())
