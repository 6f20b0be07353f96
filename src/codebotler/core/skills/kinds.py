"""The kinds of events that the paper's skills record, and one for the robot's pose."""

from __future__ import annotations

from typing import Final

GOTO: Final = "goto"
SAY: Final = "say"
ASK: Final = "ask"
CHECK: Final = "check"
PICK: Final = "pick"
PLACE: Final = "place"
INSIDE: Final = "inside"
"""The robot's pose has entered a room; only house rules see this event."""
