"""Missions turn an instruction into an approved program, run it on a robot, and log every step on disk.

Start with `mission.py`, which defines the states and the stop. `live.py` connects a program to the robot.
"""
