"""The command line of CodeBotler: `app.py` declares the commands, and each larger one has a module.

RoboEval's command line shares `obey` and the options.
"""

import sys

from codebotler.core.terminal import note

if sys.flags.optimize > 1:  # found here, since the commands cannot even be imported
    note("Skills need docstrings: leave out -OO, or set PYTHONOPTIMIZE to 0 or 1.")
    raise SystemExit(2)
