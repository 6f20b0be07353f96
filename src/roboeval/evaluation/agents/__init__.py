"""Lets agents carry out the tasks of a suite by calling skills, one at a time, instead of writing a program.

Start with `mission.py`. The calls of a mission become a program without branches. It is judged like any
other program, but only in the world in which the agent acted.
"""
