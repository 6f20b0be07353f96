"""A robot's topics and services on ROS 1, which do nothing; it says when they are there."""

import os
import sys

import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_msgs.msg import String

rospy.init_node("robot")
rospy.Publisher("/amcl_pose", PoseWithCovarianceStamped, queue_size=1)
rospy.Subscriber("/speech", String, lambda _: None)
rospy.Publisher("/battery", String, queue_size=1)
sys.stdout.write('["ready"]\n')
sys.stdout.flush()
sys.stdin.read()
os._exit(0)
