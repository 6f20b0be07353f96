"""Read a connection file (`--connect`), which maps skills to ROS calls and names the robot's places."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.yaml_files import YamlFile
from codebotler.robots.places import Places, read_places
from codebotler.robots.ros.connections.connection import CALL_VARIABLE, PLACE_VARIABLES, Connection, SkillCall


def _expect(pattern: str, what: str) -> AfterValidator:
    def check(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError(f"must be {what}")
        return text

    return AfterValidator(check)


ROS_NAME = _expect(r"~?/?\w+(/\w+)*", "a ROS name, such as /navigate_to_pose")
ROS_TYPE = _expect(r"\w+/((action|srv|msg)/)?\w+", "a type with its package, such as std_msgs/msg/String")
Topic = Annotated[str, Field(strict=True), ROS_NAME]
Type = Annotated[str, Field(strict=True), ROS_TYPE]


class _ConnectionPart(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PoseForm(_ConnectionPart):
    """The `pose` of a connection file: the topic or the transforms that give the robot's pose."""

    topic: Topic | None = None
    tf: dict[Literal["from", "to"], str] | None = None


class KeepoutForm(_ConnectionPart):
    """The `keepout` of a connection file: the topics for the mask and the info of Nav2's filter."""

    mask: Topic
    info: Topic


class SkillForm(_ConnectionPart):
    """The entry of a skill in a connection file: an action, service or topic, or a camera and a detector."""

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


class ConnectionForm(_ConnectionPart):
    """The structure of a connection file: the robot's kind, its places and poses, and its skills."""

    robot: Literal["ros1", "rosbridge", "ros2"] = "ros2"
    places: Any = None
    pose: PoseForm | None = None
    velocity: Annotated[dict[Literal["topic"], Topic], Field(min_length=1)] | None = None
    packages: list[str] = []
    keepout: KeepoutForm | None = None
    skills: Annotated[dict[str, SkillForm], Field(min_length=1)]


MESSAGE_KEYS = {"action": "goal", "service": "request", "topic": "message"}
"""The key in a connection file that contains the fields to send, for each kind of call."""
TYPE_FOLDERS = {"action": "action", "service": "srv", "topic": "msg"}
"""The middle part of a full ROS 2 type name, for each kind of call."""


def read_connection(path: Path, skills: SkillTable) -> Connection:
    """Read a connection file, which may use only the given skills. Raise UserError if it is invalid."""
    file = YamlFile.read(path)
    form = file.validate(ConnectionForm)
    places = None if form.places is None else read_places(form.places, file)
    calls, cameras = {}, {}
    for name, skill in form.skills.items():
        if name not in skills:
            raise file.wrong(f"unknown skill {name}; declare it in a file for --skills", "skills", name)
        if skill.detector is not None:
            cameras[name] = _camera(file, name, skill, skills[name])
        else:
            calls[name] = _call(file, skills[name], skill, places)
    folders = tuple(str((path.parent / folder).resolve()) for folder in form.packages)
    for number, folder in enumerate(folders):
        if not Path(folder).is_dir():
            raise file.wrong(f"there is no folder {folder}; correct the path", "packages", number)
    if form.keepout is not None and (form.robot != "ros2" or places is None):
        raise file.wrong("keepout needs places and Nav2; add places, and use robot: ros2", "keepout")
    tf = None if form.pose is None else form.pose.tf
    usual_topic = "" if form.pose is None else "/amcl_pose" if tf is None else "/tf"
    return Connection(
        calls,
        form.robot,
        places,
        (form.pose and form.pose.topic) or usual_topic,
        (form.velocity or {}).get("topic", ""),
        None if tf is None else (tf.get("from", "map"), tf.get("to", "base_link")),
        folders,
        cameras,
        None if form.keepout is None else (form.keepout.mask, form.keepout.info),
    )


def _camera(file: YamlFile, name: str, form: SkillForm, skill: Skill) -> tuple[str, str]:
    if form.image is None or form.detector is None:
        raise file.wrong('a detector needs "image", the topic of a camera; add it', "skills", name)
    if skill.returns.annotation != "bool" or len(skill.parameters) != 1:
        sentence = f"{skill.signature} cannot use a detector; it needs one parameter and the result type bool"
        raise file.wrong(sentence, "skills", name, "detector")
    return form.image, form.detector


def _call(file: YamlFile, skill: Skill, form: SkillForm, places: Places | None) -> SkillCall:
    at = ("skills", skill.name)
    named = [(kind, name) for kind in MESSAGE_KEYS if (name := getattr(form, kind)) is not None]
    if len(named) != 1 or form.type is None:
        raise file.wrong('give exactly one of "action", "service" and "topic", and its "type"', *at)
    kind, name = named[0]
    for other in {*MESSAGE_KEYS.values()} - {MESSAGE_KEYS[kind]}:
        if getattr(form, other):
            sentence = f'"{other}" does not fit "{kind}"; write the message in "{MESSAGE_KEYS[kind]}"'
            raise file.wrong(sentence, *at, other)
    if skill.returns.annotation != "None" and not form.result:
        raise file.wrong(f'in "result", name the field of the answer that {skill.signature} returns', *at)
    request = getattr(form, MESSAGE_KEYS[kind])
    known = {parameter.name for parameter in skill.parameters}
    known |= {*PLACE_VARIABLES} if places and skill.is_drive else set()
    if known and not request:
        raise file.wrong(f'"{MESSAGE_KEYS[kind]}" is missing; add it, such as {{data: ${min(known)}}}', *at)
    for variable in CALL_VARIABLE.findall(str(request)):
        if variable not in known:
            lacks = "; name a file under places" if variable in PLACE_VARIABLES and skill.is_drive else ""
            given = ", ".join(f"${one}" for one in sorted(known)) or "none"
            sentence = f"unknown variable ${variable}{lacks}; the known variables are: {given}"
            raise file.wrong(sentence, *at, MESSAGE_KEYS[kind])
    try:
        SkillCall("topic", "", "", request).fields(dict.fromkeys(known, ""))
    except (AttributeError, TypeError):
        sentence = 'a path, such as "x", has a value and also subfields, such as "x.y"; keep one of the two'
        raise file.wrong(sentence, *at, MESSAGE_KEYS[kind]) from None
    failure = "".join(word.capitalize() for word in skill.name.split("_")) + "Failed"
    whole, ros = _full_type(kind, form.type), skill.ros
    is_ours = ros is not None and whole == f"{ros.package}/action/{ros.type}"
    definition = ros.definition if ros is not None and is_ours else ""
    return SkillCall(kind, name, whole, request, definition, form.result, form.success, form.reason, failure)  # type: ignore[arg-type]  # kind is a str here


def _full_type(kind: str, text: str) -> str:
    """Return the full ROS 2 name of a type, such as std_srvs/srv/Trigger for std_srvs/Trigger."""
    package, *middle, name = text.split("/")
    if kind == "action" and middle != ["action"]:
        name = name.removesuffix("Action")
    return f"{package}/{TYPE_FOLDERS[kind]}/{name}"
