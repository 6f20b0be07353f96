"""The worker for ROS 1: `python3 FOLDER`, run by a Python that has rospy."""

from __future__ import annotations

from actions import Ros1Worker
from channel import serve

if __name__ == "__main__":
    serve(Ros1Worker)
