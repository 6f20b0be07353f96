"""List the actions, services and topics of a robot on ROS 2, and draft a file for `--connect` from them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from codebotler.core.skills.paper import SKILLS
from codebotler.robots.base import NotReadyError
from codebotler.robots.ros.connections.connection import default_connection
from codebotler.robots.ros.kinds import choose_python, domain_of
from codebotler.robots.ros.worker import RosWorker


def _own_actions() -> Iterator[tuple[str, str, str, str]]:
    for skill, call in default_connection(SKILLS).calls.items():
        text = f"{ACTION_LINE}{call.request}{', result: result' if call.result else ''}".replace("'", "")
        yield rf"action \S+ {call.type}", skill, text, ""


ACTION_LINE, SERVICE_LINE = "action: NAME, type: TYPE, goal: ", "service: NAME, type: TYPE, request: "
SAY_LINE, CAMERA_LINE = "topic: NAME, type: TYPE, message: {data: $message}", "detector: hf:PATH, image: NAME"
PLACES_FIRST, DETECTOR_FIRST = "name places first", "choose a detector first"
SKILL_FIRST = "declare this skill of yours first"
CHECK_FRAME = "only if the places are in its frame"
MAPPINGS = (
    *_own_actions(),
    (r"action \S+ nav2_msgs/action/NavigateToPose", "go_to", ACTION_LINE + "{pose: $place}", PLACES_FIRST),
    (r"hears \S*[/_](say|speak|speech|tts|talk)(_text|_output)? std_msgs/msg/String", "say", SAY_LINE, ""),
    (r"sends \S+ sensor_msgs/msg/(Compressed)?Image", "is_in_room", CAMERA_LINE, DETECTOR_FIRST),
    (r"service \S+ std_srvs/srv/Trigger", "", SERVICE_LINE + "{}, success: success", SKILL_FIRST),
    (r"service \S+ std_srvs/srv/SetBool", "", SERVICE_LINE + "{data: $on}, success: success", SKILL_FIRST),
    (r"sends \S*/(amcl_)?pose geometry_msgs/msg/Pose(WithCovariance)?Stamped", "pose", "topic: NAME", ""),
    (r"sends /tf tf2_msgs/msg/TFMessage", "pose", "tf: {from: map, to: base_link}", ""),
    (r"sends \S+ nav_msgs/msg/Odometry", "pose", "topic: NAME", CHECK_FRAME),
    (r"sends \S+ nav_msgs/msg/Odometry", "velocity", "topic: NAME", ""),
)
"""Regexes for offers such as `sends /odom nav_msgs/msg/Odometry`, each with the draft's key (empty to use the
offer's name), its value, and a task for the user. A line with a task becomes a comment.
"""

INTERNAL_OFFERS = re.compile(
    r"\S+ \S*((lifecycle|controller)_manager|costmap|rosbag|rosbridge|rosapi|rviz|/_|/tf_static).*"
    r"|.* (rcl_interfaces|lifecycle_msgs|\w+_interfaces|bond|diagnostic_msgs)/\w+/\w+"
)
"""Matches actions, services and topics that no skill can use, such as every node's parameter services."""

NOT_SKILLS = ("pose", "velocity")


def discover_offers(address: str, python: Path) -> list[str]:
    """Return the actions, services and topics of all nodes, such as `sends /tf tf2_msgs/msg/TFMessage`.

    The first word is `action`, `service`, `sends` (nodes publish the topic) or `hears` (nodes subscribe).

    Args:
        address: a ROS 2 domain number, or "" for the default.
        python: the Python interpreter of the robot's ROS installation.

    Raises:
        UserError: the address is invalid.
        NotReadyError: ROS 2 is not installed, or no node was found.
    """
    domain = domain_of(address)
    worker = RosWorker(choose_python(python), "discovery_worker.py", {}, {"ROS_DOMAIN_ID": domain})
    worker.leave()
    if not worker.about["offers"]:
        mend = "start the robot, or set another --address"
        raise NotReadyError(f"no node was found with ROS_DOMAIN_ID {domain}; {mend}")
    return [" ".join(offer) for offer in worker.about["offers"]]


def draft_connection(offers: Iterable[str]) -> str:
    """Draft a `--connect` file from the result of `discover_offers`. Comments say what to complete."""
    valid = filter(re.compile(r"\w+ [\w/]+ [\w/]+").fullmatch, sorted(offers))
    known = [offer for offer in valid if not INTERNAL_OFFERS.fullmatch(offer)]
    rest = {offer.partition(" ")[2] for offer in known}
    ready: set[str] = set()
    lines: list[tuple[bool, str]] = []  # the lines of the draft, and whether each defines a skill
    for pattern, use, text, first in MAPPINGS:
        for offer in (offer for offer in known if re.fullmatch(pattern, offer)):
            _, name, kind = offer.split()
            key = use or "_".join(reversed(name.strip("/").lower().split("/")))
            line = f"{key}: {{{text.replace('TYPE', kind).replace('NAME', name)}}}"
            why = first or "already defined above" * (key in ready)
            ready |= set() if why else {key}
            lines.append((key not in NOT_SKILLS, f"# {line}  # {why}" if why else line))
            rest.discard(f"{name} {kind}")
    draft = [
        "# A draft of `codebotler connect --discover`; read each line before you use it.",
        "robot: ros2",
        "# places: places.yaml",
        *(line for is_skill, line in lines if not is_skill),
        "skills:",
        *(f"  {line}" for is_skill, line in lines if is_skill),
        *(["# Not mapped:"] if rest else []),
        *(f"#   {offer}" for offer in sorted(rest)),
    ]
    return "".join(f"{line}\n" for line in draft)
