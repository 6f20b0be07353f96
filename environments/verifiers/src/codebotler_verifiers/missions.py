"""The tools of missions, as a server that all rollouts share."""

import asyncio
from collections.abc import Sequence
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Annotated, Any

import verifiers.v1 as vf
from pydantic import Field, WithJsonSchema

from roboeval.training.missions import TrainingMission, mission_tools

if TYPE_CHECKING:
    from mcp.server.mcpserver import MCPServer


class MissionState(vf.State):
    """A mission, as the server needs it: the row of `load_missions`, and the calls so far."""

    row: dict[str, Any] = Field(default_factory=dict)
    calls: list[tuple[str, dict[str, Any]]] = Field(default_factory=list)


def repeat_calls(row: dict[str, Any], calls: Sequence[tuple[str, str | dict[str, Any]]]) -> TrainingMission:
    """Begin the mission of a row and repeat some calls, which have the same results each time."""
    mission = TrainingMission.begin(row)
    for name, arguments in calls:
        mission.call(name, arguments)
    return mission


class MissionToolset(vf.Toolset[vf.SharedToolsetConfig, MissionState]):
    """Offer the skills as tools, without a prefix to their names."""

    TOOL_PREFIX = None

    async def call(self, name: str, arguments: dict[str, Any]) -> str:
        """Make a call in the mission of the current rollout, and return its result."""
        state = self.state
        mission = await asyncio.to_thread(repeat_calls, state.row, state.calls)
        result = mission.call(name, arguments)
        state.calls.append((name, arguments))
        return result

    def register(self, mcp: "MCPServer") -> None:
        """Register a function for each tool."""
        for tool in mission_tools():
            function = tool["function"]
            mcp.add_tool(
                self._with_state(self._function(function["name"], function["parameters"]["properties"])),
                name=function["name"],
                description=function["description"],
            )

    def _function(self, name: str, properties: dict[str, Any]) -> Any:  # noqa: ANN401 - of any signature
        async def call(**arguments: Any) -> str:  # noqa: ANN401 - the mission checks the arguments
            return await self.call(name, arguments)

        parameters = [
            Parameter(parameter, Parameter.KEYWORD_ONLY, annotation=_annotation(schema))
            for parameter, schema in properties.items()
        ]
        call.__signature__ = Signature(parameters, return_annotation=str)  # type: ignore[attr-defined]  # The inspect module reads it.
        return call


def _annotation(schema: dict[str, Any]) -> Any:  # noqa: ANN401 - a type or an annotated one
    """Return the type of a parameter. The server parses text as JSON unless the type is exactly `str`."""
    return str if schema == {"type": "string"} else Annotated[Any, WithJsonSchema(schema)]


if __name__ == "__main__":
    MissionToolset.run()
