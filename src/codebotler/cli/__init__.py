"""The command line of CodeBotler: `app.py` declares the commands, and each larger one has a module.

RoboEval's command line shares `obey` and the options.
"""
