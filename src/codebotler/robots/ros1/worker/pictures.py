"""Pictures on a ROS 1 graph, for action servers in the robot's own Python (3.8 or later)."""

from __future__ import annotations

import base64
import time
from typing import Any

from message_types import BUFFER, COMPRESSED, in_text, picture_types

MOST = 64_000_000  # bytes of a picture that is passed on


class Camera:
    """The last picture of a topic, of whichever type; nothing is unpacked until somebody asks for it.

    Args:
        topic: with messages of sensor_msgs/Image or sensor_msgs/CompressedImage.
    """

    def __init__(self, topic: str) -> None:
        import rospy

        self.topic, self._types = topic, picture_types()
        self._last: Any = None
        rospy.Subscriber(topic, rospy.AnyMsg, self._see, queue_size=1, buff_size=BUFFER)

    def look(self, oldest: float) -> dict[str, Any]:
        """The fields of the last picture, or `none`: why there is none.

        Args:
            oldest: how many seconds ago it may have come.
        """
        if self._last is None:
            return {"none": f"no picture has come on {self.topic} yet; does the camera's node run?"}
        came, message = self._last
        kind, age = message._connection_header["type"], time.monotonic() - came
        if kind not in self._types:
            return {"none": f"{self.topic} has messages of {kind}; name one of {' or '.join(self._types)}"}
        if age > oldest:
            late = f"the last picture on {self.topic} came {age:.0f} s ago"
            return {"none": f"{late}; has the camera's node stopped?"}
        if len(message._buff) > MOST:
            return {"none": f"the picture on {self.topic} is larger than {MOST:,} bytes"}
        try:
            picture = self._types[kind]().deserialize(message._buff)
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it, it is no picture
            return {"none": f"the picture on {self.topic} cannot be unpacked: {error}"}
        names = [name for name in picture.__slots__ if name not in ("header", "data")]
        return {**{name: getattr(picture, name) for name in names}, "data": in_text(picture.data)}

    def _see(self, message: Any) -> None:
        self._last = time.monotonic(), message


class Show:
    """A topic on which an action server shows what it sees.

    Args:
        server: the action server's name.
    """

    def __init__(self, server: str) -> None:
        import rospy

        self._type = picture_types()[COMPRESSED]
        self._publisher = rospy.Publisher(f"{rospy.remap_name(server)}/picture", self._type, queue_size=4)

    def show(self, picture: str) -> None:
        """Publish a JPEG file, given in base64."""
        import rospy

        message = self._type(format="jpeg", data=base64.b64decode(picture))
        message.header.stamp = rospy.Time.now()
        self._publisher.publish(message)
