"""A robot whose skills are the tools of an MCP server: each tool is used only with a person's approval.

    pip install mcp
    codebotler run program.py --skills examples/skills/hotel_lift/skills.py --robot mcp_robot.py:Porter

PORTER_URL is the address of the server, such as http://127.0.0.1:8000/mcp. PORTER_TOOLS lists the tools that
may be used without asking; for any other, the terminal asks once.
"""

import os
import sys
from typing import Any

from mcp import Client

from codebotler import RobotError

URL = os.environ.get("PORTER_URL", "http://127.0.0.1:8000/mcp")


class Porter:
    """A porter that takes the lift."""

    def __init__(self) -> None:
        self.approved = {tool for tool in os.environ.get("PORTER_TOOLS", "").split(",") if tool}

    def rooms(self) -> list[str]:
        """List the places where it can be."""
        return ["lobby", "third floor"]

    def get_current_location(self) -> str:
        """Return the place where it starts."""
        return "lobby"

    async def say(self, message: str) -> None:
        """Speak."""
        await self.use("say", message=message)

    async def call_lift(self) -> bool:
        """Call the lift."""
        return bool(await self.use("call_lift"))

    async def ride_to(self, floor: int) -> None:
        """Ride to a floor."""
        await self.use("ride_to", floor=floor)

    async def knock(self, room: int) -> bool:
        """Knock at a room."""
        return bool(await self.use("knock", room=room))

    async def stop(self) -> None:
        """Stop at once, without approval."""
        async with Client(URL) as client:
            await client.call_tool("stop", {})

    async def use(self, tool: str, **arguments: Any) -> Any:  # noqa: ANN401 - of any type
        """Call a tool if a person approves it, and return its result."""
        if tool not in self.approved:
            self.ask_for(tool)
        async with Client(URL) as client:
            result = await client.call_tool(tool, arguments)
        if result.is_error:
            text = " ".join(getattr(part, "text", "") for part in result.content)
            raise RobotError(f"{tool.title().replace('_', '')}Failed", text)
        return (result.structured_content or {}).get("result")

    def ask_for(self, tool: str) -> None:
        """Ask a person at the terminal to approve a tool; raise a RobotError if they do not."""
        if not sys.stdin.isatty() or input(f"May the program use the tool {tool}? [y/N] ").lower() != "y":
            raise RobotError("NotApproved", f"nobody has approved of the tool {tool}")
        self.approved.add(tool)
