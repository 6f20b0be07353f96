"""Robots on ROS: `robot` has what they share; each kind, and its readiness, has a module of its own."""
