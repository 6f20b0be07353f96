"""Chooses the class of a robot that is reached over ROS."""

from __future__ import annotations

from codebotler.robots.base import Options
from codebotler.robots.ros.robot import RosRobot


def class_for(options: Options) -> type[RosRobot]:
    """The class of a robot that offers an action for each skill, or what the options' connection says."""
    if options.connection is None:
        return RosRobot
    from codebotler.robots.ros.connected import ConnectedRobot  # noqa: PLC0415 - needs much more

    return ConnectedRobot
