"""Lets any MCP client act as the agent of a run: it asks for one mission after another and calls skills."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server
from mcp_types import CallToolRequestParams, CallToolResult, ListToolsResult, TextContent
from mcp_types import Tool as ClientTool

from codebotler import __version__
from codebotler.core.files import Appender, to_line, to_text, write_whole
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts.tools import GIVE_UP, agent_prompt, object_schema, tools_for
from roboeval.evaluation.agents.conversation import mission_data
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.agents.plan import AgentPlan
from roboeval.evaluation.generating.requests import begin_batch
from roboeval.evaluation.runs.completions import CompletionKey, row_for
from roboeval.evaluation.runs.endings import TURN_LIMIT
from roboeval.evaluation.runs.folder import RunFolder

NEXT, FINISH = "next_mission", "finish_mission"
_TO_END = f"When everything is done, call {FINISH}. This ends the mission."
_OVER = f"This mission is over; call {NEXT} for the next one."


UNKNOWN_SETTINGS = SamplingSettings(temperature=None, top_p=None)  # a client has settings of its own


@dataclass
class MissionDesk:
    """Hands the unfinished missions of a run to an MCP client one at a time, and saves each when it ends."""

    plan: AgentPlan
    model: str  # the name of the model behind the client
    file: Appender
    todo: list[CompletionKey]
    _current: tuple[CompletionKey, AgentMission] | None = None
    _calls: int = 0

    def tools(self) -> list[ClientTool]:
        """Return the tools for the client: the robot's skills, `next_mission` and `finish_mission`."""
        answer = object_schema({"answer": {"type": "string"}})
        offered = [
            (NEXT, "Get the next mission. Call this first, and after each mission.", object_schema({})),
            (FINISH, "End the mission, since everything is done.", answer),
            *((tool.name, tool.description, tool.schema) for tool in tools_for(self.plan.suite.skills)),
        ]
        return [
            ClientTool(name=name, description=words, input_schema=json.loads(schema))
            for name, words, schema in offered
        ]

    def call(self, name: str, arguments: dict[str, Any]) -> str:
        """Call one of the `tools` for the client. Return the result or an error message."""
        if self._current is None:
            return self._begin() if name == NEXT else f"There is no mission; call {NEXT}."
        key, mission = self._current
        if name == NEXT:
            return f"A mission is not over yet; go on with it, or call {FINISH} or give_up."
        self._calls += 1
        if name == FINISH:
            mission.answer(str(arguments.get("answer", "")))
            result = "done"
        else:
            result = mission.call(name, arguments)
        if mission.ending is None and self._calls >= self.plan.limits.turns:
            mission.end(TURN_LIMIT)
        if mission.ending is None:
            return result
        self._keep(key, mission)
        return f"{result}\n{_OVER}"

    def leave(self) -> None:
        """End and save the current mission, if any, because the client has left. It cannot be resumed."""
        if self._current is not None:
            self.call(GIVE_UP, {"reason": "the client has left"})

    def _begin(self) -> str:
        if not self.todo:
            return "All missions are done. Say so, and stop."
        key, self._calls = self.todo[0], 0
        self._current = key, self.plan.begin_mission(key)
        suite, instruction = self.plan.suite, self.plan.instruction(key)
        request = agent_prompt(instruction, rules=suite.house_sentences, skills=suite.skills, to_end=_TO_END)
        left = f"({len(self.todo)} missions are left.)"
        return "\n\n".join([*(message.text for message in request.messages), left])

    def _keep(self, key: CompletionKey, mission: AgentMission) -> None:
        where = {"mode": "agent", "world": self.plan.world(key)}
        ended = {**mission_data(mission), "no_program": None, "turns": self._calls, "usage": None}
        row = row_for(key, self.plan.instruction(key), self.model, where | ended)
        self.file.append(to_line(row))
        self.file.sync()
        self.todo.remove(key)
        self._current = None


@contextlib.contextmanager
def open_desk(run: RunFolder, plan: AgentPlan, model: str) -> Iterator[MissionDesk]:
    """Lock a run, and yield a desk that hands out its missions. `model` is the model name in saved rows."""
    with run.writing():
        about, _, todo = begin_batch(run, plan, model, UNKNOWN_SETTINGS)
        write_whole(run.about, to_text(about))
        with contextlib.closing(Appender(run.completions)) as file:
            yield MissionDesk(plan, model, file, todo)


async def serve_agent(desk: MissionDesk) -> None:
    """Serve one MCP client on standard input and output, until the client leaves or a signal arrives."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, _end, desk, number)

    async def list_tools(*_: object) -> ListToolsResult:
        return ListToolsResult(tools=desk.tools())

    async def call_tool(_: object, asked: CallToolRequestParams) -> CallToolResult:
        text = desk.call(asked.name, asked.arguments or {})
        return CallToolResult(content=[TextContent(text=text)])

    server: Server[Any] = Server(
        "roboeval",
        version=__version__,
        instructions=f"Call {NEXT}, do what it says with the robot's skills, and repeat until all is done.",
        on_list_tools=list_tools,
        on_call_tool=call_tool,
    )
    async with stdio_server() as (reading, writing):
        await server.run(reading, writing, server.create_initialization_options())


def _end(desk: MissionDesk, number: int) -> None:
    try:
        desk.leave()
    finally:
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)  # any other end would wait for the thread that reads standard input
