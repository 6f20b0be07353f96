"""The worker for ROS 1, run by the robot's own Python (3.8 or later): `python3 FOLDER`."""

from __future__ import annotations

from channel import main
from goals import Ros1Worker

if __name__ == "__main__":
    main(Ros1Worker)
