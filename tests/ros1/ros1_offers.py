"""A robot's topics and service on ROS 1, which do nothing; it says when they are there."""

import os
import sys

import rospy
from std_msgs.msg import String


def named(kind: str) -> type[String]:
    """A message with the name of a type whose package may not be installed."""
    return type(kind.rpartition("/")[2], (String,), {"_type": kind})


rospy.init_node("robot")
rospy.Publisher("/amcl_pose", named("geometry_msgs/PoseWithCovarianceStamped"), queue_size=1)
rospy.Subscriber("/speech", String, lambda _: None)
rospy.Publisher("/battery", String, queue_size=1)
rospy.Subscriber("/move_base/goal", named("move_base_msgs/MoveBaseActionGoal"), lambda _: None)
rospy.Publisher("/elsewhere/goal", named("move_base_msgs/MoveBaseActionGoal"), queue_size=1)
sys.stdout.write('["ready"]\n')
sys.stdout.flush()
sys.stdin.read()
os._exit(0)
