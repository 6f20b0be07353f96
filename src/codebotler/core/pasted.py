"""Command lines in sentences, for a person to paste into the shell from which this command was called."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from pathlib import Path


def runnable(command: str) -> str:
    """A command by its name, or by its path where a shell would not find it.

    Args:
        command: one that is installed with the command that runs.
    """
    folder, _ = os.path.split(sys.argv[0])
    if folder and shutil.which(command) is None and (beside := Path(folder, command)).is_file():
        return str(beside)
    return command


def mission_command(*arguments: str) -> str:
    """A command line about missions, which names their folder where CODEBOTLER_HOME does.

    Args:
        arguments: what stands behind the command's name.
    """
    named = os.environ.get("CODEBOTLER_HOME")
    where = f"CODEBOTLER_HOME={shlex.quote(named)} " if named else ""
    return where + shlex.join([runnable("codebotler"), *arguments])
