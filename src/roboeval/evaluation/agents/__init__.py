"""Lets agents carry out the tasks of a suite by calling skills, one at a time, instead of writing a program.

Start with `mission.py`. The calls of a mission become a program without branches, which is judged like any
other, in the one world in which the agent acted.
"""
