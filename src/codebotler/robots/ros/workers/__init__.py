"""Scripts for the robot's own Python, which must not import codebotler.

All of them run on Python 3.8, except those for a rosbridge.
"""
