"""The action, service or topic for each skill, as defined by the skill table or a connection file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from codebotler.core.errors import RobotError
from codebotler.core.skills.table import SkillTable

if TYPE_CHECKING:
    from codebotler.robots.places import Places

Values: TypeAlias = Mapping[str, Any]
CallKind: TypeAlias = Literal["action", "service", "topic"]

CALL_VARIABLE = re.compile(r"\$([a-z_]+(?:\.[a-z]+)?)")
PLACE_VARIABLES = ("place", "place.pose", "place.x", "place.y", "place.yaw")
REASON_FIELDS = ("error_msg", "error_string", "message", "status_message", "reason")
"""Common names of message fields that give the reason for a failure."""
PLACE_SKILLS = {"get_all_rooms": False, "get_current_location": True}
"""Skills that can be answered from a list of places, and whether they also need the robot's pose."""


@dataclass(frozen=True)
class SkillCall:
    """The action, service or topic that performs a skill, with its request and how to read the answer."""

    kind: CallKind
    name: str  # the name of the action, service or topic
    type: str  # the ROS type, such as `nav2_msgs/action/NavigateToPose`
    request: Values = field(default_factory=dict)  # the fields to send, in which `$NAME` is a variable
    definition: str = ""  # the text of the .action file; empty if the type must be installed
    result: str = ""  # the path of the field that the skill returns; empty if it returns nothing
    success: str = ""  # the path of a field that is false if the skill failed; empty if there is none
    reason: str = ""  # the path of the field with the reason for a failure; empty to try common names
    failure: str = ""  # the kind of error for failures that do not specify one

    def fields(self, values: Values) -> Any:  # noqa: ANN401 - a message
        """Return the request with each variable, such as `$place.x`, replaced by its value in `values`."""
        return _fill(self.request, values)

    def answer(self, received: Values) -> Any:  # noqa: ANN401 - a mission checks its type
        """Return the skill's result from the received message, or raise RobotError if the skill failed."""
        try:
            if self.success and not _get(received, self.success):
                raise RobotError(self.failure, self.why(received) or f"{self.name} reports a failure")
            return _get(received, self.result) if self.result else None
        except LookupError as error:
            raise RobotError(self.failure, str(error.args[0])) from None

    def why(self, received: Values) -> str:
        """Return the reason for a failure from the received message, with any error code, or "" if none."""
        if self.reason:
            with suppress(LookupError):
                return str(_get(received, self.reason))
        texts = (text for name in REASON_FIELDS if isinstance(text := received.get(name), str) and text)
        words, code = next(texts, ""), received.get("error_code")
        return f"{words} (error {code})".strip() if code else words


@dataclass(frozen=True)
class Connection:
    """Says how each skill is performed over ROS, and where the robot's places, poses and pictures are.

    Args:
        calls: the action, service or topic for each skill.
        robot: the kind of robot: ros1, rosbridge or ros2.
        places: the places that the robot can drive to, or None if unknown.
        pose: the topic with the robot's poses, or "" if there is none.
        velocity: the topic with the robot's velocities, or "" if there is none.
        frames: the frames of the map and of the robot if poses come from tf, else None.
        packages: folders of message packages to build if they are not installed.
        cameras: the camera topic and the detector model for each skill that looks at pictures.
        keepout: the topics of Nav2's keepout mask and its CostmapFilterInfo, or None.
    """

    calls: Mapping[str, SkillCall]
    robot: str = "ros2"
    places: Places | None = None
    pose: str = ""
    velocity: str = ""
    frames: tuple[str, str] | None = None
    packages: tuple[str, ...] = ()
    cameras: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    keepout: tuple[str, str] | None = None

    def skills(self, known: SkillTable) -> SkillTable:
        """Return the part of a skill table that this connection supports."""
        has = {*self.calls, *self.cameras}
        if self.places is not None:
            has |= {skill for skill, needs_pose in PLACE_SKILLS.items() if self.pose or not needs_pose}
        return known.without(known.keys() - has)


def default_connection(skills: SkillTable) -> Connection:
    """Return a connection that performs skills by the ROS actions in their declarations."""
    calls = {}
    for skill in skills.rows:
        if (ros := skill.ros) is not None:
            names = [line.split()[1] for line in ros.goal]
            request = {name: f"${p.name}" for name, p in zip(names, skill.parameters, strict=True)}
            type_name, failure = f"{ros.package}/action/{ros.type}", ros.failure or f"{ros.type}Failed"
            result = "" if ros.result is None else "result"
            calls[skill.name] = SkillCall(
                "action", ros.server, type_name, request, ros.definition, result, failure=failure
            )
    return Connection(calls)


def _fill(request: Any, values: Values) -> Any:  # noqa: ANN401 - a message
    match request:
        case dict():
            found: dict[str, Any] = {}
            for key, value in request.items():
                _put(found, key, _fill(value, values))
            return found
        case list():
            return [_fill(value, values) for value in request]
        case str() if (whole := CALL_VARIABLE.fullmatch(request)) is not None:
            return values[whole[1]]
        case str():
            return CALL_VARIABLE.sub(lambda found: str(values[found[1]]), request)
    return request


def _put(fields: dict[str, Any], path: str, value: Any) -> None:  # noqa: ANN401 - a message
    """Set the field at a path such as `pose.position.x`, creating the fields that contain it."""
    first, _, rest = path.partition(".")
    if rest:
        _put(fields.setdefault(first, {}), rest, value)
    else:
        fields[first] = value


def _get(received: Any, path: str) -> Any:  # noqa: ANN401 - a message
    """Return the value at a path of field names and list indices, such as `poses.0.position`."""
    for step in path.split("."):
        try:
            received = received[int(step) if isinstance(received, list) else step]
        except (LookupError, TypeError, ValueError):
            raise LookupError(f'the robot\'s answer has no field "{path}"') from None
    return received
