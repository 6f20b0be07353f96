"""Tries to learn which files exist."""
# ends: finished
# does: say False False False

import os


def task_program():
    say(" ".join(str(os.path.exists(path)) for path in ("@SECRET_FILE@", "@CANARY_FOLDER@", "/")))
