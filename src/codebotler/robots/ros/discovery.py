"""Looks at what the nodes of a robot offer, and writes a first file for `--connect` from it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import PACKAGE
from codebotler.robots.base import NotReadyError
from codebotler.robots.ros import ros1, ros2
from codebotler.robots.ros.worker import RosWorker


def _own_actions() -> Iterator[tuple[str, str, str, str]]:
    for skill in SKILLS.rows:
        assert skill.ros is not None, "all of them have an action"
        fields = zip(skill.ros.goal, skill.parameters, strict=True)
        goal = ", ".join(f"{field.split()[1]}: ${parameter.name}" for field, parameter in fields)
        text = f"action: NAME, type: TYPE, goal: {{{goal}}}" + ", result: result" * bool(skill.ros.result)
        yield rf"action \S+ {PACKAGE}/{skill.ros.type}", skill.name, text, ""


NAV = "action: NAME, type: TYPE, goal: {%s: $place}"
SAY, SERVICE = "topic: NAME, type: TYPE, message: {data: $message}", "service: NAME, type: TYPE, request: "
PLACES, DETECTOR, OWN = "name places first", "choose a detector first", "declare this skill of yours first"
USES = (
    *_own_actions(),
    (r"action \S+ nav2_msgs/NavigateToPose", "go_to", NAV % "pose", PLACES),
    (r"action \S+ move_base_msgs/MoveBase", "go_to", NAV % "target_pose", PLACES),
    (r"hears \S*[/_](say|speak|speech|tts|talk)(_text|_output)? std_msgs/String", "say", SAY, ""),
    (r"sends \S+ sensor_msgs/(Compressed)?Image", "is_in_room", "detector: hf:PATH, image: NAME", DETECTOR),
    (r"service \S+ std_srvs/Trigger", "", SERVICE + "{}, success: success", OWN),
    (r"service \S+ std_srvs/SetBool", "", SERVICE + "{data: $on}, success: success", OWN),
    (r"sends \S*/(amcl_)?pose geometry_msgs/Pose(WithCovariance)?Stamped", "pose", "topic: NAME", ""),
    (r"sends /tf tf2_msgs/TFMessage", "pose", "tf: {from: map, to: base_link}", ""),
    (r"sends \S+ nav_msgs/Odometry", "pose", "topic: NAME", "use it only if the places are in its frame"),
    (r"sends \S+ nav_msgs/Odometry", "velocity", "topic: NAME", ""),
)
"""What we map: a regex of offers, the key that uses them (a skill is named after the offer if it is empty),
what the key maps to, and what must be done first, so that the line is a comment."""

OF_ROS = re.compile(
    r"\S+ \S*((lifecycle|controller)_manager|costmap|rosbag|rosbridge|rosapi|rviz|/_|/tf_static).*"
    r"|.* (rcl_interfaces|lifecycle_msgs|\w+_interfaces|rosgraph_msgs|roscpp|actionlib_msgs|bond"
    r"|dynamic_reconfigure|diagnostic_msgs)/\w+|.*Action(Goal|Result|Feedback)"
)
"""A regex of offers that nobody maps, such as the services for parameters that each node has."""

FROM_PLACES = ("get_all_rooms", "get_current_location")


def offers_of(robot: str, address: str, python: Path) -> list[str]:
    """What the nodes of a robot offer: kind (action, service, hears or sends), name and type in a line.

    Args:
        robot: ros1 or ros2.
        address: the URI of the master, or a domain; empty for the default.
        python: the interpreter that the robot's ROS belongs to.

    Raises:
        UserError: the kind or the address is wrong.
        NotReadyError: there is no ROS, no master or no node.
    """
    if robot == "ros1":
        environment = {"ROS_MASTER_URI": ros1.master_uri(address)}
    elif robot == "ros2":
        environment, python = {"ROS_DOMAIN_ID": ros2.domain_of(address)}, ros2.python_of(python)
    else:
        raise UserError(f'"{robot}" cannot be looked at; use ros1 or ros2, on a machine with its ROS')
    worker = RosWorker(python, "discovery_worker.py", {"robot": robot}, environment)
    worker.leave()
    if not (offers := worker.about["offers"]):
        where = " ".join(environment.values())
        raise NotReadyError(f"no node of a robot was found at {where}; start it, or give its --address")
    return [" ".join(offer) for offer in offers]


def first_connection(robot: str, offers: Iterable[str]) -> str:
    """The text of a first file for `--connect`; what is not ready, or is not mapped, is in comments.

    Args:
        robot: ros1 or ros2.
        offers: as `offers_of` returns them.
    """
    by_form = {re.sub("/(action|srv|msg)/", "/", offer): offer for offer in sorted(offers)}
    known = {
        form: offer
        for form, offer in by_form.items()
        if re.fullmatch(r"\w+ [\w/]+ [\w/*]+", form) and not OF_ROS.fullmatch(form)
    }
    found = list(_uses_of(known))
    ready = {key for key, line, _ in found if not line.startswith("#")}
    packages = {known[form].split()[2].partition("/")[0] for *_, form in found if form.startswith("action")}
    rest = {offer.partition(" ")[2] for form, offer in known.items() if form not in {f for *_, f in found}}
    lacks = [name for name in SKILLS if name not in ready and name not in FROM_PLACES]
    return "\n".join(
        [
            "# A draft of `codebotler connect --discover`; read each line before you use it. Missing:",
            *["# - places: name a file of places, and take away the # there"] * (FROM_PLACES[0] not in ready),
            *["# - pose: nothing tells where the robot is"] * ("pose" not in ready),
            *[f"# - skills: {', '.join(lacks)}"] * bool(lacks),
            f"robot: {robot}",
            *["# places: places.yaml"] * (FROM_PLACES[0] not in ready),
            *[f"# packages: [{', '.join(sorted(packages))}]  # folders, if this ROS lacks them"]
            * (robot == "ros2" and bool(packages)),
            *[line for key, line, _ in found if key in {"pose", "velocity"}],
            "skills:",
            *[f"  {line}" for key, line, _ in found if key not in {"pose", "velocity"}],
            *["# Not mapped:"] * bool(rest),
            *[f"#   {offer}" for offer in sorted(rest)],
            "",
        ]
    )


def _uses_of(known: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    """The key, the line and the offer of each use."""
    ready = set()
    for pattern, of_all, text, first in USES:
        for form in [form for form in known if re.fullmatch(pattern, form)]:
            _, name, kind = known[form].split()
            key = of_all or name.strip("/").replace("/", "_").lower()
            line = f"{key}: {{{text.replace('TYPE', kind).replace('NAME', name)}}}"
            why = first or "another one" * (key in ready)
            ready |= set() if why else {key}
            yield key, f"# {line}  # {why}" if why else line, form
