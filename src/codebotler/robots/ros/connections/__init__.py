"""Map skills and places to the actions, services and topics of a robot on ROS."""
