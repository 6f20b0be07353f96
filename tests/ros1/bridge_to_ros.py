"""The ROS side of a double of rosbridge: its operations for topics, line by line, on a real graph.

What is published right after it was advertised may be lost, as rosbridge itself loses it.
"""

import json
import os
import sys
import threading
from typing import Any

sys.path.insert(0, sys.argv[1])

import actionlib_msgs.msg
import genpy.message
import rospy

from message_types import message_types

LOCK = threading.Lock()


def tell(**message: Any) -> None:
    with LOCK:
        print(json.dumps(message), flush=True)


def plain(value: Any) -> Any:
    """A message as JSON."""
    if hasattr(value, "__slots__") and not isinstance(value, str):
        return {field: plain(getattr(value, field)) for field in value.__slots__}
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def known_types() -> dict[str, Any]:
    specs = message_types(json.loads(sys.argv[2])).values()
    made = [spec() for spec in specs]
    parts = [type(part) for a in made for part in (a.action_goal, a.action_result, a.action_feedback)]
    return {
        part._type: part for part in (*parts, actionlib_msgs.msg.GoalID, actionlib_msgs.msg.GoalStatusArray)
    }


def obey(message: dict[str, Any], types: dict[str, Any], published: dict[str, Any]) -> None:
    operation = message["op"]
    if operation == "call_service":
        tell(op="service_response", id=message["id"], result=False, values="there is no rosapi")
        return
    topic = message["topic"]
    if "type" in message and message["type"] not in types:
        tell(op="status", level="error", msg=f"Unable to import {message['type']}")
    elif operation == "advertise":
        published[topic] = rospy.Publisher(topic, types[message["type"]], queue_size=10)
    elif operation == "subscribe":
        rospy.Subscriber(
            topic,
            types[message["type"]],
            lambda heard: tell(op="publish", topic=topic, msg=plain(heard)),
        )
    elif operation == "publish" and topic in published:
        made = published[topic].data_class()
        genpy.message.fill_message_args(made, [message["msg"]])
        published[topic].publish(made)


def main() -> None:
    rospy.init_node("rosbridge", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
    types = known_types()
    published: dict[str, Any] = {}
    for line in sys.stdin:
        obey(json.loads(line), types, published)
    os._exit(0)


main()
