"""Missions of agents, whose methods a trainer of TRL offers to the model as tools."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature
from typing import Any

from codebotler.core.errors import UserError
from roboeval.training.missions import TrainingMission, mission_tools


class MissionEnvironment:
    """A mission at a time: pass the class to a trainer as its `environment_factory`.

    It has a method for each tool. TRL takes all public methods except `reset` for tools.
    """

    def __init__(self) -> None:
        self._mission: TrainingMission | None = None

    def reset(self, **row: Any) -> None:  # noqa: ANN401 - columns of any type
        """Begin the mission of a row of `load_missions`."""
        self._mission = TrainingMission.begin(row)

    @property
    def mission(self) -> TrainingMission:
        """The current mission."""
        if self._mission is None:
            raise UserError("there is no mission yet; call reset first")
        return self._mission


def _method(function: dict[str, Any]) -> Callable[..., str]:
    """Return a method for a tool, with the types and the docstring from which TRL makes a schema."""
    name, properties = function["name"], function["parameters"]["properties"]

    def call(self: MissionEnvironment, **arguments: Any) -> str:  # noqa: ANN401 - the mission checks them
        return self.mission.call(name, arguments)

    types = {parameter: _python_type(schema) for parameter, schema in properties.items()}
    lines = [f"    {parameter}: the {parameter} of the call." for parameter in types]
    call.__name__ = name
    call.__doc__ = "\n".join([function["description"], *(["", "Args:", *lines] if lines else [])])
    call.__annotations__ = types
    own = Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)
    rest = [Parameter(one, Parameter.KEYWORD_ONLY, annotation=kind) for one, kind in types.items()]
    call.__signature__ = Signature([own, *rest])  # type: ignore[attr-defined]  # The inspect module reads it.
    return call


def _python_type(schema: dict[str, Any]) -> Any:  # noqa: ANN401 - a type
    if schema["type"] == "array":
        return list[_python_type(schema["items"])]  # type: ignore[misc]  # The type is made at run time.
    return {"string": str, "number": float, "integer": int, "boolean": bool}[schema["type"]]


for _tool in mission_tools():
    setattr(MissionEnvironment, _tool["function"]["name"], _method(_tool["function"]))
