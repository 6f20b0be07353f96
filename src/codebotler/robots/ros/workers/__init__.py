"""Scripts that run under the robot's own Python (3.8 or later), and must therefore not import codebotler.

Only the scripts for rosbridge always run under CodeBotler's Python.
"""
