"""Robots on ROS: `robot` contains the code that all kinds share, and each kind has its own module."""
