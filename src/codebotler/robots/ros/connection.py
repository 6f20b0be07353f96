"""The action, service or topic for each skill, from the skill table or from a file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from codebotler.core.errors import RobotError
from codebotler.core.skills.table import Skill, SkillTable

if TYPE_CHECKING:
    from codebotler.robots.places import Places

Values: TypeAlias = Mapping[str, Any]
CallKind: TypeAlias = Literal["action", "service", "topic"]

CALL_VARIABLE = re.compile(r"\$([a-z_]+(?:\.[a-z]+)?)")
PLACE_VARIABLES = ("place", "place.pose", "place.x", "place.y", "place.yaw")
REASON_FIELDS = ("error_msg", "error_string", "message", "status_message", "reason")
"""The usual fields for the reason of a failure."""
PLACE_SKILLS = {"get_all_rooms": False, "get_current_location": True}
"""Skills that the places answer, and whether they also need the robot's pose."""


@dataclass(frozen=True)
class SkillCall:
    """The action, service or topic that performs a skill."""

    kind: CallKind  # action, service or topic
    name: str  # its name
    type: str  # the message type, such as `nav2_msgs/action/NavigateToPose`
    request: Values = field(default_factory=dict)  # fields; `$NAME` is an argument
    definition: str = ""  # the text of the .action file; empty if the robot's ROS has the type
    result: str = ""  # the path of the field that the skill returns; empty for no result
    success: str = ""  # the path of a field that must be true; empty for none
    reason: str = ""  # the path of the field with the reason of a failure; empty for the usual names
    failure: str = ""  # the kind of error for failures without a kind

    def fields(self, values: Values) -> Any:  # noqa: ANN401 - a message
        """Fill in the variables of the request."""
        return _fill(self.request, values)

    def answer(self, received: Values) -> Any:  # noqa: ANN401 - a mission checks its type
        """Return a skill's result from the received message; RobotError if the skill failed."""
        try:
            if self.success and not _get(received, self.success):
                raise RobotError(self.failure, self.why(received) or f"{self.name} reports a failure")
            return _get(received, self.result) if self.result else None
        except LookupError as error:
            raise RobotError(self.failure, str(error.args[0])) from None

    def why(self, received: Values) -> str:
        """Return the reason and the error code in a message, if it has them."""
        if self.reason:
            with suppress(LookupError):
                return str(_get(received, self.reason))
        words = next(
            (text for name in REASON_FIELDS if isinstance(text := received.get(name), str) and text), ""
        )
        code = received.get("error_code")
        return f"{words} (error {code})".strip() if code else words


@dataclass(frozen=True)
class MotionTopic:
    """A topic with poses or velocities of a robot."""

    topic: str
    frames: tuple[str, str] | None = None  # for poses from tf: the frames of the map and of the robot


@dataclass(frozen=True)
class Connection:
    """The interface of a robot.

    Args:
        calls: the call for each skill.
        robot: the kind of robot: ros1, rosbridge or ros2.
        places: the places that it can drive to, if known.
        pose: the topic of its poses.
        velocity: the topic of its velocities.
        packages: folders of packages with messages that its ROS may lack.
        cameras: topics and detector models by skill.
        keepout: the topics of Nav2's keepout mask and of its description.
    """

    calls: Mapping[str, SkillCall]
    robot: str = "ros2"
    places: Places | None = None
    pose: MotionTopic | None = None
    velocity: MotionTopic | None = None
    packages: tuple[str, ...] = ()
    cameras: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    keepout: tuple[str, str] | None = None

    def skills(self, known: SkillTable) -> SkillTable:
        """Return the known skills that the robot has."""
        has = {*self.calls, *self.cameras}
        if self.places is not None:
            has |= {skill for skill, needs_pose in PLACE_SKILLS.items() if self.pose or not needs_pose}
        return known.without(known.keys() - has)


def default_connection(skills: SkillTable) -> Connection:
    """Return the connection with the skills' own actions."""
    return Connection({row.name: _action_of(row) for row in skills.rows if row.ros is not None})


def _action_of(skill: Skill) -> SkillCall:
    ros = skill.ros
    assert ros is not None, "the caller selects skills with an action"
    names = [line.split()[1] for line in ros.goal]
    request = {name: f"${p.name}" for name, p in zip(names, skill.parameters, strict=True)}
    result = "" if ros.result is None else "result"
    failure = ros.failure or f"{ros.type}Failed"
    return SkillCall(
        "action",
        ros.server,
        f"{ros.package}/action/{ros.type}",
        request,
        ros.definition,
        result,
        failure=failure,
    )


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
    """Set the field at a path such as `pose.position.x`."""
    first, _, rest = path.partition(".")
    if rest:
        _put(fields.setdefault(first, {}), rest, value)
    else:
        fields[first] = value


def find_variables(request: Values) -> set[str]:
    """Return the names of the variables in a request."""
    return set(CALL_VARIABLE.findall(str(request)))


def _get(received: Any, path: str) -> Any:  # noqa: ANN401 - a message
    """Return the value at a path of fields such as `result.found`, or positions such as `poses.0`."""
    for step in path.split("."):
        try:
            received = received[int(step) if isinstance(received, list) else step]
        except (LookupError, TypeError, ValueError):
            raise LookupError(f'the answer of the robot has no field "{path}"') from None
    return received
