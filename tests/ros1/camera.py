"""A real camera node, which publishes one picture repeatedly until its input ends."""

import json
import os
import select
import sys

import rospy
import sensor_msgs.msg
import std_msgs.msg

topic, kind, fields = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
rospy.init_node("camera", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
if fields:
    fields["data"] = bytes.fromhex(fields["data"])
    message = getattr(sensor_msgs.msg, kind)(**fields)
else:
    message = std_msgs.msg.String("no picture")
publisher = rospy.Publisher(topic, type(message), queue_size=1, latch=True)
publisher.publish(message)
print('["ready"]', flush=True)
while not select.select([sys.stdin], [], [], 0.05)[0]:
    publisher.publish(message)
os._exit(0)
