"""The folder in which missions and what belongs to them lie."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from pathlib import Path

from codebotler.badinput import BadInput


def home() -> Path:
    """What CODEBOTLER_HOME names; without it, a folder among the user's state. It need not exist.

    Raises:
        BadInput: nothing says where it is.
    """
    named = os.environ.get("CODEBOTLER_HOME")
    if named:
        return Path(named).absolute()
    state = os.environ.get("XDG_STATE_HOME")
    try:
        return (Path(state) if state else Path.home() / ".local" / "state") / "codebotler"
    except RuntimeError:
        raise BadInput("nobody knows where your home is; set CODEBOTLER_HOME to a folder") from None


def pasted(*words: str) -> str:
    """A command line about what lies there, to be pasted into a shell in the current folder.

    It names the folder where CODEBOTLER_HOME does, and a command by its path where a shell would not find it.

    Args:
        words: the command and its arguments.
    """
    command, *arguments = words
    folder, _ = os.path.split(sys.argv[0])
    if folder and shutil.which(command) is None and (beside := Path(folder, command)).is_file():
        command = str(beside)
    named = os.environ.get("CODEBOTLER_HOME")
    where = f"CODEBOTLER_HOME={shlex.quote(named)} " if named else ""
    return where + shlex.join([command, *arguments])
