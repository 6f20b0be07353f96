"""Pictures on a ROS 1 graph: the last one of a camera, and a topic that shows what a server saw."""

from __future__ import annotations

import base64
import time
from typing import Any

from message_types import BUFFER, COMPRESSED, in_base64, picture_types


class Camera:
    """The last message of a topic, raw or compressed; it is unpacked only when asked for."""

    def __init__(self, topic: str) -> None:
        import rospy

        self.topic, self._types = topic, picture_types()
        self._last: Any = None
        rospy.Subscriber(topic, rospy.AnyMsg, self._keep, queue_size=1, buff_size=BUFFER)

    def look(self, oldest: float) -> dict[str, Any]:
        """The last picture as fields of its message, or `none` with the reason why there is none.

        It must have come within the last `oldest` seconds.
        """
        if self._last is None:
            return {"none": f"no picture has arrived on {self.topic} yet; is the camera's node running?"}
        came, message = self._last
        kind, age = message._connection_header["type"], time.monotonic() - came
        if kind not in self._types:
            return {"none": f"{self.topic} has messages of {kind}; name one of {' or '.join(self._types)}"}
        if age > oldest:
            late = f"the last picture on {self.topic} came {age:.0f} s ago"
            return {"none": f"{late}; has the camera's node stopped?"}
        picture = self._types[kind]().deserialize(message._buff)
        names = [name for name in picture.__slots__ if name not in ("header", "data")]
        return {**{name: getattr(picture, name) for name in names}, "data": in_base64(picture.data)}

    def _keep(self, message: Any) -> None:
        self._last = time.monotonic(), message


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
