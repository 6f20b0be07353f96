"""The folder in which missions and what belongs to them lie."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from codebotler.core.errors import UserError


def home() -> Path:
    """What CODEBOTLER_HOME names; without it, a folder among the user's state. It need not exist.

    Raises:
        UserError: nothing says where it is.
    """
    named = os.environ.get("CODEBOTLER_HOME")
    if named:
        return Path(named).absolute()
    state = os.environ.get("XDG_STATE_HOME")
    try:
        return (Path(state) if state else Path.home() / ".local" / "state") / "codebotler"
    except RuntimeError:
        raise UserError("nobody knows where your home is; set CODEBOTLER_HOME to a folder") from None


NOT_ALLOWED = (errno.EACCES, errno.EPERM, errno.EROFS)


def make_folder(folder: Path) -> None:
    """Make a folder there, if it is not there already, to write into.

    Raises:
        UserError: this is not allowed.
        OSError: it cannot be made for another reason.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if error.errno not in NOT_ALLOWED:
            raise
        sentence = f"this cannot be made ({error.strerror}); name another folder by CODEBOTLER_HOME"
        raise UserError(sentence, file=folder) from None
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        sentence = "nothing can be written into this folder; name another by CODEBOTLER_HOME"
        raise UserError(sentence, file=folder)
