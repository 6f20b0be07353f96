"""The last picture of a camera on ROS 2."""

from __future__ import annotations

from typing import Any

from pictures import Camera
from ros2_graph import Ros2Graph


class Ros2Camera(Camera):
    """A camera on ROS 2; what it publishes is known only when it has been discovered."""

    def __init__(self, graph: Ros2Graph, topic: str) -> None:
        from sensor_msgs.msg import CompressedImage, Image

        types = {"sensor_msgs/msg/Image": Image, "sensor_msgs/msg/CompressedImage": CompressedImage}
        super().__init__(topic, types)
        self._graph = graph

    def look(self, oldest: float) -> dict[str, Any]:
        """The last picture as fields of its message, or `none` with the reason why there is none."""
        if self.kind not in self.types:
            self.kind = next(iter(self._graph.types_of(self.topic)), "")
            if self.kind in self.types:
                self._graph.soon(self._subscribe)
        return super().look(oldest)

    def unpacked(self, message: bytes) -> Any:
        """The picture in a message."""
        from rclpy.serialization import deserialize_message

        return deserialize_message(message, self.types[self.kind])

    def _subscribe(self) -> None:
        from rclpy.qos import QoSPresetProfiles

        qos = QoSPresetProfiles.SENSOR_DATA.value  # also hears those that publish reliably
        self._graph.ours.create_subscription(self.types[self.kind], self.topic, self.keep, qos, raw=True)
