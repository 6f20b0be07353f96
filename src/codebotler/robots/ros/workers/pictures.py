"""Pictures on a graph: the last one of a camera, and on ROS 1 a topic that shows what a server saw."""

from __future__ import annotations

import base64
import time
from typing import Any

from message_types import BUFFER, COMPRESSED, in_base64, picture_types

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


class PictureTopic:
    """The topic on which an action server shows what it sees: `SERVER/picture`."""

    def __init__(self, server: str) -> None:
        import rospy

        self._type = picture_types()[COMPRESSED]
        self._publisher = rospy.Publisher(f"{rospy.remap_name(server)}/picture", self._type, queue_size=4)

    def show(self, picture: str) -> None:
        """Publish a JPEG file in base64."""
        import rospy

        message = self._type(format="jpeg", data=base64.b64decode(picture))
        message.header.stamp = rospy.Time.now()
        self._publisher.publish(message)
