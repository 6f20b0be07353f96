"""A robot with an HTTP interface.

    codebotler run "..." --robot examples/robots/http_robot.py:Cart

CART_URL is its address, such as http://127.0.0.1:8000.
"""

import json
import os
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from codebotler import RobotError

URL = os.environ.get("CART_URL", "http://127.0.0.1:8000")


class Cart:
    """A cart that drives, looks and speaks."""

    def rooms(self) -> list[str]:
        """Ask for the rooms."""
        rooms: list[str] = post("rooms")
        return rooms

    def get_current_location(self) -> str:
        """Ask for its room."""
        return str(post("where"))

    def go_to(self, location: str) -> None:
        """Drive; the request ends when the cart is there."""
        post("drive", to=location)

    def is_in_room(self, entity: str) -> bool:
        """Look for something."""
        return bool(post("look", what=entity))

    def say(self, message: str) -> None:
        """Speak."""
        post("say", text=message)

    def stop(self) -> None:
        """Stop at once; the current drive then ends with an error."""
        post("stop", timeout=5)


def post(path: str, *, timeout: float = 600, **values: str):  # type: ignore[no-untyped-def]  # any JSON # noqa: ANN201 - the same
    """Send a request, and return its answer; raise a RobotError if the cart refuses."""
    body = json.dumps(values).encode()
    request = Request(f"{URL}/{path}", body, {"Content-Type": "application/json"})  # noqa: S310 - the robot's own
    try:
        with urlopen(request, timeout=timeout) as answer:  # noqa: S310 - the same
            return json.load(answer)
    except HTTPError as error:
        if error.code == 409:  # noqa: PLR2004 - conflict: it cannot do that
            raise RobotError("GoToInvalidLocation", error.read().decode()) from error
        raise
