"""The folder in which missions and what belongs to them lie."""

from __future__ import annotations

import os
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


def make_folder(folder: Path) -> None:
    """Make a folder there, if it is not there already.

    Raises:
        BadInput: this is not allowed.
        OSError: it cannot be made for another reason.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except PermissionError as error:
        sentence = f"this cannot be made ({error.strerror}); name another folder by CODEBOTLER_HOME"
        raise BadInput(sentence, file=folder) from None
