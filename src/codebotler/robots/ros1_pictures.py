"""Pictures on a ROS 1 graph, for the workers of the robot's own Python (3.8 or later)."""

from __future__ import annotations

import base64
import time
import types
from functools import lru_cache
from typing import Any

MOST = 64_000_000  # bytes of a picture that is passed on
BUFFER = 1 << 24  # bytes; with less, rospy lags behind a camera
DEFINITIONS = {
    "sensor_msgs/Image": "Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
    "uint32 step\nuint8[] data\n",
    "sensor_msgs/CompressedImage": "Header header\nstring format\nuint8[] data\n",
}
COMPRESSED = "sensor_msgs/CompressedImage"


@lru_cache(maxsize=None)
def picture_types() -> dict[str, Any]:
    """The types of messages with pictures, by name; they are made here where sensor_msgs is not installed."""
    try:
        import sensor_msgs.msg
    except ImportError:
        return made_types()
    return {name: getattr(sensor_msgs.msg, name.partition("/")[2]) for name in DEFINITIONS}


def made_types() -> dict[str, Any]:
    """The types as the code generator of ROS makes them from their definitions."""
    import genmsg.msg_loader
    import genpy.generator
    import std_msgs.msg

    context = genmsg.msg_loader.MsgContext.create_default()
    header = std_msgs.msg.Header._full_text.partition("=" * 80)[0]
    genmsg.msg_loader.load_msg_from_string(context, header, "std_msgs/Header")
    module = types.ModuleType("sensor_msgs.msg")
    for name, text in DEFINITIONS.items():
        spec = genmsg.msg_loader.load_msg_from_string(context, text, name)
        code = "\n".join(genpy.generator.msg_generator(context, spec, {}))
        exec(compile(code, f"<{name}>", "exec"), module.__dict__)  # noqa: S102 - genpy's own code
    return {name: getattr(module, name.partition("/")[2]) for name in DEFINITIONS}


def in_text(data: Any) -> str:
    """The bytes of a message's field, as a line of JSON can hold them."""
    return base64.b64encode(bytes(data)).decode()


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
