"""Scripts that run under the robot's own Python (3.8 or later), and must therefore not import codebotler.

The scripts for rosbridge, however, always run under CodeBotler's Python.
"""
