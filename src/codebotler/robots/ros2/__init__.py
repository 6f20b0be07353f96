"""Robots on ROS 2. `robot.py` is the tool's side; `worker.py` runs under the robot's own Python.

It shares the parts of `ros1/worker/` that do not depend on the version of ROS.
"""
