"""How a robot is told to perform its skills: read from a file, or the actions of the skill table."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from codebotler.core.errors import RobotError
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.yaml_files import YamlFile
from codebotler.robots.base import RobotLostError
from codebotler.robots.places import Places, read_places

Values: TypeAlias = Mapping[str, Any]
Kind: TypeAlias = Literal["action", "service", "topic"]

VARIABLE = re.compile(r"\$([a-z_]+(?:\.[a-z]+)?)")
OF_PLACE = ("place", "place.pose", "place.x", "place.y", "place.yaw")
REASONS = ("error_msg", "error_string", "message", "status_message", "reason")
"""The fields in which servers usually say why something failed."""

FROM_PLACES = {"get_all_rooms": False, "get_current_location": True}
"""Skills that places answer, and whether they need the robot's pose, too."""


@dataclass(frozen=True)
class Call:
    """How a robot is told to perform one skill.

    Args:
        kind: what it offers for that.
        name: of the action, service or topic.
        type: of its messages, such as `nav2_msgs/action/NavigateToPose`.
        request: the fields of the message that is sent; in texts, `$NAME` is the argument of that name.
        definition: the text of the .action file; empty if the robot's own ROS must have it.
        result: the path of the field that the skill returns; empty for nothing.
        success: the path of a field that must be true; empty for none.
        failure: the kind of error of a goal that fails without naming one.
    """

    kind: Kind
    name: str
    type: str
    request: Values = field(default_factory=dict)
    definition: str = ""
    result: str = ""
    success: str = ""
    failure: str = ""

    def fields(self, values: Values) -> Any:  # noqa: ANN401 - as in a message
        """The fields of the message that is sent, from the values of its variables."""
        return _filled(self.request, values)

    def answer(self, received: Values) -> Any:  # noqa: ANN401 - a mission looks whether it fits the skill
        """What a skill returns, from the message that came back.

        Raises:
            RobotError: it says that the skill has failed.
        """
        if self.success and not _at(received, self.success):
            raise RobotError(self.failure, reason(received) or f"{self.name} says that it failed")
        return _at(received, self.result) if self.result else None


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

    calls: Mapping[str, Call]
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


def _action_of(skill: Skill) -> Call:
    ros = skill.ros
    assert ros is not None, "it has an action"
    names = [line.split()[1] for line in ros.goal]
    request = {name: f"${p.name}" for name, p in zip(names, skill.parameters, strict=True)}
    result = "" if ros.result is None else "result"
    failure = ros.failure or f"{ros.type}Failed"
    return Call("action", ros.server, ros.full_type, request, ros.definition, result, failure=failure)


def reason(received: Values) -> str:
    """Why something failed, as far as a message says it: its words, and its number of an error."""
    words = next((text for name in REASONS if isinstance(text := received.get(name), str) and text), "")
    code = received.get("error_code")
    return f"{words} (error {code})".strip() if code else words


# --- the file


def _as_topic(text: str) -> str:
    if not re.fullmatch(r"~?/?\w+(/\w+)*", text):
        raise ValueError("must be a name of ROS, such as /navigate_to_pose")
    return text


def _as_type(text: str) -> str:
    if not re.fullmatch(r"\w+/((action|srv|msg)/)?\w+", text):
        raise ValueError("must be a type with its package, such as std_msgs/msg/String")
    return text


Topic = Annotated[str, Field(strict=True), AfterValidator(_as_topic)]
Type = Annotated[str, Field(strict=True), AfterValidator(_as_type)]


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FramesForm(_Form):
    """The frames between which tf tells the pose."""

    from_: Annotated[str, Field(alias="from")] = "map"
    to: str = "base_link"


class PoseForm(_Form):
    """Where a pose comes from."""

    topic: Topic | None = None
    tf: FramesForm | None = None

    def watched(self) -> Watched:
        """The topic."""
        if self.tf is not None:
            return Watched(self.topic or "/tf", (self.tf.from_, self.tf.to))
        return Watched(self.topic or "/amcl_pose")


class VelocityForm(_Form):
    """Where a velocity comes from."""

    topic: Topic


class KeepoutForm(_Form):
    """The topics of Nav2's keepout filter."""

    mask: Topic
    info: Topic


class SkillForm(_Form):
    """How a robot is told to perform one skill."""

    action: Topic | None = None
    service: Topic | None = None
    topic: Topic | None = None
    type: Type | None = None
    goal: dict[str, Any] = {}
    request: dict[str, Any] = {}
    message: dict[str, Any] = {}
    result: str = ""
    success: str = ""
    detector: str | None = None
    image: Topic | None = None


class ConnectionForm(_Form):
    """A file that connects a robot."""

    robot: Literal["ros1", "rosbridge", "ros2"] = "ros2"
    places: Any = None
    pose: PoseForm | None = None
    velocity: VelocityForm | None = None
    packages: list[str] = []
    keepout: KeepoutForm | None = None
    skills: Annotated[dict[str, SkillForm], Field(min_length=1)]


SENT = {"action": "goal", "service": "request", "topic": "message"}
"""The key of what is sent, for each kind."""


def read_connection(path: Path, skills: SkillTable) -> Connection:
    """Read a file that connects a robot.

    Args:
        path: the file.
        skills: those that it may map.

    Raises:
        UserError: something is wrong; it names the line, and how to mend it.
    """
    file = YamlFile.read(path)
    form = file.validate(ConnectionForm)
    places = None if form.places is None else read_places(file, "places")
    calls, cameras = {}, {}
    for name, skill in form.skills.items():
        if name not in skills:
            raise file.wrong(f"there is no skill {name}; declare it in a file for --skills", "skills", name)
        if skill.detector is not None:
            cameras[name] = _camera(file, name, skill, skills[name])
        else:
            calls[name] = _call(file, skills[name], skill, places)
    folders = tuple(str((path.parent / folder).resolve()) for folder in form.packages)
    for number, folder in enumerate(folders):
        if not Path(folder).is_dir():
            raise file.wrong(f"there is no folder {folder}", "packages", number)
    return Connection(
        calls,
        form.robot,
        places,
        None if form.pose is None else form.pose.watched(),
        None if form.velocity is None else Watched(form.velocity.topic),
        folders,
        cameras,
        None if form.keepout is None else (form.keepout.mask, form.keepout.info),
    )


def _camera(file: YamlFile, name: str, form: SkillForm, skill: Skill) -> tuple[str, str]:
    if form.image is None or form.detector is None:
        raise file.wrong('a detector needs "image", the topic of a camera', "skills", name)
    if skill.returns.annotation != "bool" or len(skill.parameters) != 1:
        raise file.wrong(f"a detector cannot perform {skill.signature}", "skills", name, "detector")
    return form.image, form.detector


def _call(file: YamlFile, skill: Skill, form: SkillForm, places: Places | None) -> Call:
    at = ("skills", skill.name)
    named = [(kind, name) for kind in SENT if (name := getattr(form, kind)) is not None]
    if len(named) != 1 or form.type is None:
        raise file.wrong('write one of "action", "service" and "topic", and its "type"', *at)
    kind, name = named[0]
    for other in {*SENT.values()} - {SENT[kind]}:
        if getattr(form, other):
            raise file.wrong(f'what is sent to {kind}s stands under "{SENT[kind]}"', *at, other)
    if skill.returns.annotation != "None" and not form.result:
        raise file.wrong(f'say in "result" which field {skill.signature} returns', *at)
    request = getattr(form, SENT[kind])
    known = {parameter.name for parameter in skill.parameters} | ({*OF_PLACE} if places else set())
    for variable in _variables(request):
        if variable not in known:
            lacks = "; name a file under places" if variable in OF_PLACE else ""
            given = ", ".join(f"${one}" for one in sorted(known)) or "none"
            raise file.wrong(f"${variable} is unknown here{lacks}; known are: {given}", *at, SENT[kind])
    failure = "".join(word.capitalize() for word in skill.name.split("_")) + "Failed"
    return Call(kind, name, form.type, request, "", form.result, form.success, failure)  # type: ignore[arg-type]


# --- fields of messages


def _filled(request: Any, values: Values) -> Any:  # noqa: ANN401 - as in a message
    match request:
        case dict():
            return {key: _filled(value, values) for key, value in request.items()}
        case list():
            return [_filled(value, values) for value in request]
        case str() if (whole := VARIABLE.fullmatch(request)) is not None:
            return values[whole[1]]
        case str():
            return VARIABLE.sub(lambda found: str(values[found[1]]), request)
    return request


def _variables(request: Any) -> set[str]:  # noqa: ANN401 - as in a message
    match request:
        case dict():
            return {name for value in request.values() for name in _variables(value)}
        case list():
            return {name for value in request for name in _variables(value)}
        case str():
            return set(VARIABLE.findall(request))
    return set()


def _at(received: Any, path: str) -> Any:  # noqa: ANN401 - as in a message
    """The value at a path of fields, such as `result.found`, or of positions, such as `poses.0`."""
    for step in path.split("."):
        try:
            received = received[int(step) if isinstance(received, list) else step]
        except (LookupError, TypeError, ValueError):
            raise RobotLostError(f'what the robot answered has no field "{path}"') from None
    return received
