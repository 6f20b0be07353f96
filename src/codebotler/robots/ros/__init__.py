"""Robots on ROS; `robot` contains what all kinds share, and each kind has its own module."""
