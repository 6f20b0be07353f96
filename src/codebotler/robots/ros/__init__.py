"""Robots on ROS: `robot.py` has the code of all kinds, `kinds.py` opens each, and `workers/` talks to ROS."""
