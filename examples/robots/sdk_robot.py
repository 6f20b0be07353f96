"""A robot whose vendor has an SDK: one method for each skill.

    codebotler run "..." --skills examples/skills/tidy_arm/skills.py --robot examples/robots/sdk_robot.py:Arm

ARM_ADDRESS is its controller's address, such as 127.0.0.1:7000.
"""

import os
import sys
from pathlib import Path

from codebotler import RobotError

sys.path.insert(0, str(Path(__file__).parent))
from vendor_sdk import Connection


class Arm:
    """An arm at a table."""

    def connect(self) -> None:
        """Connect to the controller; a second connection stays free for stopping."""
        host, _, port = os.environ.get("ARM_ADDRESS", "127.0.0.1:7000").partition(":")
        self.arm, self.emergency = Connection(host, int(port)), Connection(host, int(port))

    def disconnect(self) -> None:
        """Close both connections."""
        self.arm.close()
        self.emergency.close()

    def stop(self) -> None:
        """Stop at once, even during a command."""
        self.emergency.command("halt")

    def rooms(self) -> list[str]:
        """List the places where it can be."""
        return ["table"]

    def get_current_location(self) -> str:
        """Return its only place; the arm never moves."""
        return "table"

    def say(self, message: str) -> None:
        """Speak."""
        self.arm.command("speak", message)

    def seen_on_table(self) -> object:
        """List what lies on the table."""
        return self.arm.command("detect")

    def open_receptacle(self, receptacle: str) -> None:
        """Open a receptacle."""
        self.arm.command("open", receptacle)

    def tidy(self, item: str, receptacle: str) -> None:
        """Put a thing into a receptacle."""
        try:
            self.arm.command("move", item, receptacle)
        except RuntimeError as error:
            if "full" in str(error):
                raise RobotError("ReceptacleFull", str(error)) from error
            raise
