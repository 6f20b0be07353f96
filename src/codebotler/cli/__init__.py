"""The command line of CodeBotler.

Start with `app.py`, which declares the commands. RoboEval also uses `run_command_line` and the options.
"""

import sys

from codebotler.core.terminal import note

if sys.flags.optimize > 1:  # importing the commands would fail
    note("Skills need docstrings: leave out -OO, or set PYTHONOPTIMIZE to 0 or 1.")
    raise SystemExit(2)
