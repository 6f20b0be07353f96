"""How skills and places are connected to a robot on ROS."""
