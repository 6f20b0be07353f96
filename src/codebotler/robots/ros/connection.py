"""The action, service or topic that performs each skill: from the skill table, or from a file."""

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
Kind: TypeAlias = Literal["action", "service", "topic"]

VARIABLE = re.compile(r"\$([a-z_]+(?:\.[a-z]+)?)")
OF_PLACE = ("place", "place.pose", "place.x", "place.y", "place.yaw")
REASONS = ("error_msg", "error_string", "message", "status_message", "reason")
"""The fields in which servers usually say why something failed."""

FROM_PLACES = {"get_all_rooms": False, "get_current_location": True}
"""Skills that places answer, and whether they need the robot's pose, too."""


@dataclass(frozen=True)
class SkillCall:
    """How a robot is told to perform one skill.

    Args:
        kind: what it offers for that.
        name: of the action, service or topic.
        type: of its messages, such as `nav2_msgs/action/NavigateToPose`.
        request: the fields of the message that is sent; in texts, `$NAME` is the argument of that name.
        definition: the text of the .action file; empty if the robot's own ROS must have it.
        result: the path of the field that the skill returns; empty for nothing.
        success: the path of a field that must be true; empty for none.
        reason: the path of the field that says why something failed; empty for the usual names.
        failure: the kind of error of a goal that fails without naming one.
    """

    kind: Kind
    name: str
    type: str
    request: Values = field(default_factory=dict)
    definition: str = ""
    result: str = ""
    success: str = ""
    reason: str = ""
    failure: str = ""

    def fields(self, values: Values) -> Any:  # noqa: ANN401 - as in a message
        """The fields of the message that is sent, from the values of its variables."""
        return _filled(self.request, values)

    def answer(self, received: Values) -> Any:  # noqa: ANN401 - a mission looks whether it fits the skill
        """What a skill returns, from the message that came back.

        Raises:
            RobotError: it says that the skill has failed.
        """
        try:
            if self.success and not _at(received, self.success):
                raise RobotError(self.failure, self.why(received) or f"{self.name} says that it failed")
            return _at(received, self.result) if self.result else None
        except LookupError as error:
            raise RobotError(self.failure, str(error.args[0])) from None

    def why(self, received: Values) -> str:
        """Why something failed, as far as a message says it: its words, and its number of an error."""
        if self.reason:
            with suppress(LookupError):
                return str(_at(received, self.reason))
        words = next((text for name in REASONS if isinstance(text := received.get(name), str) and text), "")
        code = received.get("error_code")
        return f"{words} (error {code})".strip() if code else words


@dataclass(frozen=True)
class Watched:
    """A topic that tells where a robot is, or how fast it moves.

    Args:
        topic: its name.
        frames: for poses from tf, the frame of the map and that of the robot.
    """

    topic: str
    frames: tuple[str, str] | None = None


@dataclass(frozen=True)
class Connection:
    """What a robot offers.

    Args:
        calls: how it is told to perform each skill.
        robot: its kind: ros1, rosbridge or ros2.
        places: where it can go, if that is known.
        pose: what tells where it is.
        velocity: what tells how fast it moves.
        packages: folders of packages with the messages that its ROS may lack.
        cameras: for each skill that looks at a picture, the topic and the model that looks.
        keepout: the topics of a mask of where it must not be, and of what describes the mask.
    """

    calls: Mapping[str, SkillCall]
    robot: str = "ros2"
    places: Places | None = None
    pose: Watched | None = None
    velocity: Watched | None = None
    packages: tuple[str, ...] = ()
    cameras: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    keepout: tuple[str, str] | None = None

    def skills(self, known: SkillTable) -> SkillTable:
        """Those of the known skills that the robot has."""
        has = {*self.calls, *self.cameras}
        if self.places is not None:
            has |= {skill for skill, needs_pose in FROM_PLACES.items() if self.pose or not needs_pose}
        return known.without(known.keys() - has)


def connection_of(skills: SkillTable) -> Connection:
    """The actions that belong to the skills."""
    return Connection({row.name: _action_of(row) for row in skills.rows if row.ros is not None})


def _action_of(skill: Skill) -> SkillCall:
    ros = skill.ros
    assert ros is not None, "it has an action"
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


# --- fields of messages


def _filled(request: Any, values: Values) -> Any:  # noqa: ANN401 - as in a message
    match request:
        case dict():
            found: dict[str, Any] = {}
            for key, value in request.items():
                _put(found, key, _filled(value, values))
            return found
        case list():
            return [_filled(value, values) for value in request]
        case str() if (whole := VARIABLE.fullmatch(request)) is not None:
            return values[whole[1]]
        case str():
            return VARIABLE.sub(lambda found: str(values[found[1]]), request)
    return request


def _put(fields: dict[str, Any], path: str, value: Any) -> None:  # noqa: ANN401 - as in a message
    """Set the field at a path, such as `pose.position.x`."""
    first, _, rest = path.partition(".")
    if rest:
        _put(fields.setdefault(first, {}), rest, value)
    else:
        fields[first] = value


def variables_in(request: Values) -> set[str]:
    """The names of the variables in what is sent."""
    return set(VARIABLE.findall(str(request)))


def _at(received: Any, path: str) -> Any:  # noqa: ANN401 - as in a message
    """The value at a path of fields, such as `result.found`, or of positions, such as `poses.0`."""
    for step in path.split("."):
        try:
            received = received[int(step) if isinstance(received, list) else step]
        except (LookupError, TypeError, ValueError):
            raise LookupError(f'what the robot answered has no field "{path}"') from None
    return received
