"""What runs under the robot's own Python: scripts, and what they share.

Nothing here may import codebotler or, but for the worker of a rosbridge, need more than Python 3.8.
"""
