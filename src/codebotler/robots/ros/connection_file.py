"""Files of `--connect`: what a robot offers for each skill, and where its places are."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.yaml_files import YamlFile
from codebotler.robots.places import Places, read_places
from codebotler.robots.ros.connection import OF_PLACE, Connection, SkillCall, Watched, variables_in


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
    reason: str = ""
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

FOLDERS = {"action": "action", "service": "srv", "topic": "msg"}
"""The middle of a type, for each kind."""


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
    places = None if form.places is None else read_places(form.places, file)
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
    if form.keepout is not None and (form.robot != "ros2" or places is None):
        raise file.wrong("keepout needs places and Nav2, so robot: ros2", "keepout")
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


def _call(file: YamlFile, skill: Skill, form: SkillForm, places: Places | None) -> SkillCall:
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
    known = {parameter.name for parameter in skill.parameters}
    known |= {*OF_PLACE} if places and skill.is_drive else set()
    if known and not request:
        raise file.wrong(f'say in "{SENT[kind]}" what is sent, such as {{data: ${min(known)}}}', *at)
    for variable in variables_in(request):
        if variable not in known:
            lacks = "; name a file under places" if variable in OF_PLACE and skill.is_drive else ""
            given = ", ".join(f"${one}" for one in sorted(known)) or "none"
            raise file.wrong(f"${variable} is unknown here{lacks}; known are: {given}", *at, SENT[kind])
    try:
        SkillCall("topic", "", "", request).fields(dict.fromkeys(known, ""))
    except (AttributeError, TypeError):
        raise file.wrong("a field is both a value and the start of a path", *at, SENT[kind]) from None
    failure = "".join(word.capitalize() for word in skill.name.split("_")) + "Failed"
    whole, ros = _whole(kind, form.type), skill.ros
    is_ours = ros is not None and whole == f"{ros.package}/action/{ros.type}"
    definition = ros.definition if ros is not None and is_ours else ""
    return SkillCall(kind, name, whole, request, definition, form.result, form.success, form.reason, failure)  # type: ignore[arg-type]


def _whole(kind: str, text: str) -> str:
    """A type as ROS 2 writes it, such as std_srvs/srv/Trigger, from that or from how ROS 1 does."""
    package, *middle, name = text.split("/")
    if kind == "action" and middle != ["action"]:
        name = name.removesuffix("Action")
    return f"{package}/{FOLDERS[kind]}/{name}"
