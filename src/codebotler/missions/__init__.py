"""Missions: an instruction's life from its program to the end of the robot's work, and its log on the disk.

Start with `mission.py`, the states and the stop; `live.py` is the robot as a running program meets it.
"""
