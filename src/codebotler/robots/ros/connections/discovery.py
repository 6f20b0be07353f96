"""List the actions, services and topics of a robot, and draft a file for `--connect` from them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.robots.base import NotReadyError
from codebotler.robots.ros.connections.connection import default_connection
from codebotler.robots.ros.kinds import choose_python, domain_of, master_uri
from codebotler.robots.ros.worker import RosWorker


def _own_actions() -> Iterator[tuple[str, str, str, str]]:
    for skill, call in default_connection(SKILLS).calls.items():
        text = f"{ACTION_LINE}{call.request}{', result: result' if call.result else ''}".replace("'", "")
        yield rf"action \S+ {call.type.replace('/action/', '/')}", skill, text, ""


ACTION_LINE, SERVICE_LINE = "action: NAME, type: TYPE, goal: ", "service: NAME, type: TYPE, request: "
SAY_LINE = "topic: NAME, type: TYPE, message: {data: $message}"
PLACES_FIRST, DETECTOR_FIRST = "name places first", "choose a detector first"
SKILL_FIRST = "declare this skill of yours first"
CHECK_FRAME = "only if the places are in its frame"
MAPPINGS = (
    *_own_actions(),
    (r"action \S+ nav2_msgs/NavigateToPose", "go_to", ACTION_LINE + "{pose: $place}", PLACES_FIRST),
    (r"action \S+ move_base_msgs/MoveBase", "go_to", ACTION_LINE + "{target_pose: $place}", PLACES_FIRST),
    (r"hears \S*[/_](say|speak|speech|tts|talk)(_text|_output)? std_msgs/String", "say", SAY_LINE, ""),
    (
        r"sends \S+ sensor_msgs/(Compressed)?Image",
        "is_in_room",
        "detector: hf:PATH, image: NAME",
        DETECTOR_FIRST,
    ),
    (r"service \S+ std_srvs/Trigger", "", SERVICE_LINE + "{}, success: success", SKILL_FIRST),
    (r"service \S+ std_srvs/SetBool", "", SERVICE_LINE + "{data: $on}, success: success", SKILL_FIRST),
    (r"sends \S*/(amcl_)?pose geometry_msgs/Pose(WithCovariance)?Stamped", "pose", "topic: NAME", ""),
    (r"sends /tf tf2_msgs/TFMessage", "pose", "tf: {from: map, to: base_link}", ""),
    (r"sends \S+ nav_msgs/Odometry", "pose", "topic: NAME", CHECK_FRAME),
    (r"sends \S+ nav_msgs/Odometry", "velocity", "topic: NAME", ""),
)
"""For each regex for offers: the key in the draft (empty to derive it from the offer's name), the value, and
a task for the user. A line with a task becomes a comment.
"""

INTERNAL_OFFERS = re.compile(
    r"\S+ \S*((lifecycle|controller)_manager|costmap|rosbag|rosbridge|rosapi|rviz|/_|/tf_static|_logger).*"
    r"|.* (rcl_interfaces|lifecycle_msgs|\w+_interfaces|rosgraph_msgs|actionlib_msgs|bond|dynamic_reconfigure"
    r"|diagnostic_msgs)/\w+|.*Action(Goal|Result|Feedback)"
)
"""Matches offers that no skill can use, such as the parameter services of every node."""

COMMON_PACKAGES = ("geometry_msgs", "nav_msgs", "robot_actions_pkg", "sensor_msgs", "std_msgs", "std_srvs")
"""Packages that CodeBotler's ROS 2 includes or builds, so that the draft need not list them."""

NOT_SKILLS = ("pose", "velocity")
EXPECTED_KEYS = {
    "places": "places (name a file of them)",
    "pose": "pose (a topic that says where the robot is)",
    **{skill: skill for skill in SKILLS if skill not in {"get_all_rooms", "get_current_location"}},
}


def discover_offers(robot: str, address: str, python: Path) -> list[str]:
    """List the offers of a robot's nodes as strings "KIND NAME TYPE" (KIND: action, service, hears or sends).

    Args:
        robot: the version of ROS, ros1 or ros2.
        address: the URI of a ROS 1 master or a ROS 2 domain number, or "" for the default.
        python: the Python interpreter of the robot's ROS installation.

    Raises:
        UserError: the kind of robot or the address is invalid.
        NotReadyError: ROS is not installed, or no master or no node was found.
    """
    if robot not in {"ros1", "ros2"}:
        raise UserError(f'"{robot}" does not support discovery; use ros1 or ros2, on a machine with that ROS')
    if robot == "ros1":
        environment = {"ROS_MASTER_URI": master_uri(address)}
    else:
        environment, python = {"ROS_DOMAIN_ID": domain_of(address)}, choose_python(python)
    worker = RosWorker(python, "discovery_worker.py", {"robot": robot}, environment)
    worker.leave()
    if not worker.about["offers"]:
        where = " ".join(*environment.items())
        raise NotReadyError(f"no node was found with {where}; start the robot, or give its --address")
    return [" ".join(offer) for offer in worker.about["offers"]]


def draft_connection(robot: str, offers: Iterable[str]) -> str:
    """Draft a file for `--connect`. Lines that the user must complete and unused offers become comments."""
    by_form = {re.sub("/(action|srv|msg)/", "/", offer): offer for offer in sorted(offers)}
    forms = [
        form
        for form in by_form
        if re.fullmatch(r"\w+ [\w/]+ [\w/]+", form) and not INTERNAL_OFFERS.fullmatch(form)
    ]
    rest = {by_form[form].partition(" ")[2] for form in forms}
    ready: set[str] = set()
    packages: set[str] = set()
    lines: list[tuple[bool, str]] = []  # the lines of the draft, and whether each defines a skill
    for pattern, use, text, first in MAPPINGS:
        for form in (form for form in forms if re.fullmatch(pattern, form)):
            _, name, kind = by_form[form].split()
            key = use or "_".join(reversed(name.strip("/").lower().split("/")))
            packages.add(kind.partition("/")[0])
            line = f"{key}: {{{text.replace('TYPE', kind).replace('NAME', name)}}}"
            why = first or "already defined above" * (key in ready)
            ready |= set() if why else {key}
            lines.append((key not in NOT_SKILLS, f"# {line}  # {why}" if why else line))
            rest.discard(f"{name} {kind}")
    if "get_all_rooms" in ready:
        ready.add("places")
    rare = sorted(packages - {*COMMON_PACKAGES}) if robot == "ros2" else []
    lacks = [what for key, what in EXPECTED_KEYS.items() if key not in ready]
    return "".join(
        f"{line}\n"
        for line in (
            "# A draft of `codebotler connect --discover`; read each line before you use it.",
            *([f"# Missing: {', '.join(lacks)}"] if lacks else []),
            f"robot: {robot}",
            *([] if "places" in ready else ["# places: places.yaml"]),
            *([f"# packages: [{', '.join(rare)}]  # where they are not installed"] if rare else []),
            *(line for is_skill, line in lines if not is_skill),
            "skills:",
            *(f"  {line}" for is_skill, line in lines if is_skill),
            *(["# Not mapped:"] if rest else []),
            *(f"#   {offer}" for offer in sorted(rest)),
        )
    )
