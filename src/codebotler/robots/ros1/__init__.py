"""Robots on ROS 1. `robot.py` is the tool's side; `worker/` runs under the robot's own Python.

Nothing in `worker/` may import codebotler, or need more than Python 3.8.
"""
