"""A real camera's node: it publishes one picture, again and again, until its input ends."""

import json
import os
import select
import sys

sys.path.insert(0, sys.argv[1])

import rospy

from message_types import picture_types

topic, kind, fields = sys.argv[2], sys.argv[3], json.loads(sys.argv[4])
rospy.init_node("camera", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
if kind in picture_types():
    fields["data"] = bytes.fromhex(fields["data"])
    message = picture_types()[kind](**fields)
else:
    import std_msgs.msg

    message = std_msgs.msg.String("no picture")
publisher = rospy.Publisher(topic, type(message), queue_size=1, latch=True)
publisher.publish(message)
print('["ready"]', flush=True)
while not select.select([sys.stdin], [], [], 0.05)[0]:
    publisher.publish(message)
os._exit(0)
