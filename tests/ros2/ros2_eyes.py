"""An action server of rclpy for `is_in_room`; the label of a goal selects the pictures to show."""

import json
import os
import sys
import threading
import time
from typing import Any

sys.path.insert(0, sys.argv[1])

import rclpy
import rclpy.action
from rclpy.executors import MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CompressedImage

from ros2_types import message_types

KIND = "robot_actions_pkg/action/IsInRoom"


def show(size: int) -> None:
    pictures.publish(CompressedImage(format="jpeg", data=bytes(size)))


def look(handle: Any) -> Any:
    label = handle.request.object
    if label == "late":
        threading.Timer(0.2, show, [8]).start()
    elif label == "three":
        for _ in range(3):
            show(8)
            time.sleep(0.1)
    elif label == "never":
        print('["goal"]', flush=True)
        while not handle.is_cancel_requested:
            show(1_000_000)
            time.sleep(0.1)
        print('["cancel"]', flush=True)
        handle.canceled()
        return spec.Result()
    handle.succeed()
    return spec.Result()


rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node(f"eyes_{os.getpid()}")
spec = message_types([KIND], [], actions={KIND: json.loads(sys.argv[2])})[KIND]
pictures = node.create_publisher(CompressedImage, "/is_in_room_server/picture", 4)
server = rclpy.action.ActionServer(
    node, spec, "/is_in_room_server", look, cancel_callback=lambda _: rclpy.action.CancelResponse.ACCEPT
)
executor = MultiThreadedExecutor()
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()
print('["ready"]', flush=True)
sys.stdin.read()
os._exit(0)
