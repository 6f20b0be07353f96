"""Pictures of a camera."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from channel import Message, SetupError


class Camera:
    """A topic with pictures, which is listened to only while one is awaited, since they are large.

    Args:
        topic: its name.
        listen: calls a function with each message of a topic; it returns what ends that, or None if the
            topic is not there.
    """

    def __init__(self, topic: str, listen: Callable[..., Callable[[], object] | None]) -> None:
        self._topic, self._listen = topic, listen
        self._ignore: Callable[[], object] | None = None
        self._seen: Message | None = None

    def look(self, *, is_new: bool) -> Message:
        """The first picture since a look began that `is_new`, or `none` with the reason why there is none."""
        if is_new:
            self._end()  # a look that was cancelled
        try:
            if self._ignore is None:
                self._ignore = self._listen(self._topic, self._keep, is_needed=False)
        except SetupError as error:
            return {"none": str(error)}
        seen = self._seen
        if seen is None:
            return {"none": f"no picture has arrived on {self._topic}; is the camera's node running?"}
        self._end()
        return seen

    def _keep(self, message: Any) -> None:
        self._seen = message

    def _end(self) -> None:
        if self._ignore is not None:
            self._ignore()
        self._ignore = self._seen = None
