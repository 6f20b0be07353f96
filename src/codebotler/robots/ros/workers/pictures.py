"""The last picture of a camera, on ROS 1 and behind a rosbridge."""

from __future__ import annotations

import time
from typing import Any

from message_types import BUFFER, in_base64, picture_types

FIELDS = ("height", "width", "encoding", "is_bigendian", "step", "format")  # of both types of pictures


class Camera:
    """The last message of a topic, raw or compressed; it is unpacked only when asked for."""

    def __init__(self, topic: str, types: dict[str, Any]) -> None:
        self.topic, self.types = topic, types
        self.kind = ""  # of the messages, as far as it is known
        self._last: Any = None

    def look(self, oldest: float) -> dict[str, Any]:
        """The last picture as fields of its message, or `none` with the reason why there is none.

        It must have come within the last `oldest` seconds.
        """
        if self.kind and self.kind not in self.types:
            known = " or ".join(self.types)
            return {"none": f"{self.topic} has messages of {self.kind}; name one of {known}"}
        if self._last is None:
            return {"none": f"no picture has arrived on {self.topic} yet; is the camera's node running?"}
        came, message = self._last
        age = time.monotonic() - came
        if age > oldest:
            late = f"the last picture on {self.topic} came {age:.0f} s ago"
            return {"none": f"{late}; has the camera's node stopped?"}
        return self.fields(message)

    def fields(self, message: Any) -> dict[str, Any]:
        """The fields of a message, as JSON has them."""
        picture = self.unpacked(message)
        fields = {name: getattr(picture, name) for name in FIELDS if hasattr(picture, name)}
        return {**fields, "data": in_base64(picture.data)}

    def unpacked(self, message: Any) -> Any:
        """The picture in a message."""
        raise NotImplementedError

    def keep(self, message: Any) -> None:
        """Note the last message."""
        self._last = time.monotonic(), message


class Ros1Camera(Camera):
    """A camera on ROS 1."""

    def __init__(self, topic: str) -> None:
        import rospy

        super().__init__(topic, picture_types())
        rospy.Subscriber(topic, rospy.AnyMsg, self.keep, queue_size=1, buff_size=BUFFER)

    def keep(self, message: Any) -> None:
        """Note the last message, and its type."""
        super().keep(message)
        self.kind = message._connection_header["type"]

    def unpacked(self, message: Any) -> Any:
        """The picture in a message."""
        return self.types[message._connection_header["type"]]().deserialize(message._buff)


class RosbridgeCamera(Camera):
    """A camera behind a rosbridge, which sends pictures only while one is awaited, since they are large."""

    def __init__(self, connection: Any, topic: str) -> None:
        super().__init__(topic, {})
        self._connection, self._is_awaited = connection, False

    def look(self, oldest: float) -> dict[str, Any]:
        """The next picture as fields of its message, or `none` with the reason why there is none."""
        if not self._is_awaited:
            self._last, self._is_awaited = None, True
            self._connection.listen(self.topic, self.keep)
        seen = super().look(oldest)
        if "none" not in seen:
            self._connection.ignore(self.topic)
            self._is_awaited = False
        return seen

    def fields(self, message: Any) -> dict[str, Any]:
        """The fields of a message, as they are."""
        return {name: message[name] for name in (*FIELDS, "data") if name in message}
