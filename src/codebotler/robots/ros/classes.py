"""Choose the class for a robot on ROS."""

from __future__ import annotations

from codebotler.robots.base import Options
from codebotler.robots.ros.robot import RosRobot


def class_for(options: Options) -> type[RosRobot]:
    """Return ConnectedRobot if the options contain a connection, otherwise RosRobot with default actions."""
    if options.connection is None:
        return RosRobot
    from codebotler.robots.ros.connected import ConnectedRobot  # noqa: PLC0415 - imports slowly

    return ConnectedRobot
