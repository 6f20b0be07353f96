"""The ROS side of a rosbridge double, which performs operations on topics and services of a real graph.

Like rosbridge, it may lose a message that is published right after its topic was advertised. Subscribing
without a type works only if the topic exists.
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

from channel import SetupError
from message_types import action_types, as_data, import_type

LOCK = threading.Lock()
SUBSCRIBERS: dict[str, Any] = {}


def tell(**message: Any) -> None:
    with LOCK:
        print(json.dumps(message), flush=True)


def known_types() -> dict[str, Any]:
    specs = action_types(json.loads(sys.argv[2])).values()
    made = [spec() for spec in specs]
    parts = [type(part) for a in made for part in (a.action_goal, a.action_result, a.action_feedback)]
    return {
        part._type: part for part in (*parts, actionlib_msgs.msg.GoalID, actionlib_msgs.msg.GoalStatusArray)
    }


def type_of(kind: str, types: dict[str, Any], folder: str = "msg") -> Any:
    if kind in types:
        return types[kind]
    try:
        return import_type(kind, folder)
    except SetupError:
        tell(op="status", level="error", msg=f"Unable to import {kind}")
        return None


def call(message: dict[str, Any]) -> None:
    about = {"op": "service_response", "id": message["id"], "service": message["service"]}
    try:
        rospy.wait_for_service(message["service"], 0.1)
        spec = type_of(message["type"], {}, "srv")
        request = spec._request_class()
        genpy.message.fill_message_args(request, [message["args"]])
        tell(**about, result=True, values=as_data(rospy.ServiceProxy(message["service"], spec)(request)))
    except (rospy.ROSException, rospy.ServiceException) as error:
        tell(**about, result=False, values=str(error))


def obey(message: dict[str, Any], types: dict[str, Any], published: dict[str, Any]) -> None:
    operation = message["op"]
    if operation == "call_service":
        threading.Thread(target=call, args=(message,), daemon=True).start()
        return
    topic = message["topic"]
    if operation == "advertise":
        if (spec := type_of(message["type"], types)) is not None:
            published[topic] = rospy.Publisher(topic, spec, queue_size=10)
    elif operation == "subscribe":
        kind = message.get("type") or dict(rospy.get_published_topics()).get(topic)
        if kind is None:
            tell(op="status", level="error", msg=f"Cannot infer topic type for topic {topic}")
        elif (spec := type_of(kind, types)) is not None:
            SUBSCRIBERS[topic] = rospy.Subscriber(
                topic, spec, lambda data: tell(op="publish", topic=topic, msg=as_data(data))
            )
    elif operation == "unsubscribe":
        if topic in SUBSCRIBERS:
            SUBSCRIBERS.pop(topic).unregister()
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
