"""Topics and services of a robot on ROS 2 that do nothing; prints "ready" when they exist."""

import os
import sys

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_msgs.msg import String
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node("robot")
node.create_publisher(PoseWithCovarianceStamped, "/amcl_pose", 1)
node.create_subscription(String, "/speech", lambda _: None, 1)
node.create_publisher(String, "/battery", 1)
node.create_service(Trigger, "/door/open", lambda _, answer: answer)
sys.stdout.write('["ready"]\n')
sys.stdout.flush()
sys.stdin.read()
os._exit(0)
