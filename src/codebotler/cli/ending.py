"""Run a command line, and convert errors to one sentence and an exit status."""

from __future__ import annotations

import atexit
import errno
import gc
import os
import sys
from functools import cache
from typing import TYPE_CHECKING, Any, NoReturn

import typer
from typer.main import get_command

from codebotler.core.errors import UserError, installed
from codebotler.core.terminal import (
    DISK_FULL,
    drop_output,
    flush_output,
    note,
    open_streams,
    shortened,
    system_sentence,
)

if TYPE_CHECKING:
    from codebotler.models.recorded import UnknownInstructionError

IS_WINDOWS = "this runs on Linux and macOS; on Windows, use it inside WSL"
STOPPED = 130  # the exit status after Ctrl-C, by the convention of shells
USAGE: Any = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this version of typer keeps it
ENVIRONMENT = (*DISK_FULL, errno.EIO)  # errors in writing that a different path would not fix

_command = cache(get_command)


def run_command_line(app: typer.Typer, name: str) -> NoReturn:
    """Run a command line and end the process.

    Errors that a user can cause are printed as one sentence. The exit status is 2 for incorrect input and 1
    for failures of the machine, a model or a robot.
    """
    if sys.platform == "win32":
        note(f"{name}: {IS_WINDOWS}")
        raise SystemExit(1)
    atexit.register(gc.freeze)  # the final garbage collection would take a tenth of a long command's time
    open_streams()
    if not os.environ.get("COLUMNS", "1").strip("0"):  # empty or 0 means that the width is unknown
        del os.environ["COLUMNS"]
    try:
        with installed():
            status = _command(app)(standalone_mode=False, prog_name=name)
        flush_output()
    except KeyboardInterrupt:
        status = STOPPED
    except BrokenPipeError:  # the reader of the output, such as `head`, has exited
        drop_output()
        status = 1
    except Exception as error:
        ending = _ending(error)
        if ending is None:
            raise
        status, sentence = ending
        note(f"{name}: {sentence}")
        if isinstance(error, OSError) and error.filename is None:  # the output itself cannot be written
            drop_output()
    if status == STOPPED:
        note(f"{name}: stopped")
    raise SystemExit(status if isinstance(status, int) else 0)


def _ending(error: Exception) -> tuple[int, str] | None:
    """Return the exit status and the sentence for an error, or None if the error is a bug."""
    from codebotler.models.base import BudgetSpentError, ModelError
    from codebotler.models.recorded import UnknownInstructionError
    from codebotler.robots.base import NotReadyError, RobotLostError
    from codebotler.simulator.worker import EngineError

    if isinstance(error, USAGE | UserError):
        return 2, str(error) if isinstance(error, UserError) else _usage_sentence(error)
    if isinstance(error, EngineError | BudgetSpentError | NotReadyError | RobotLostError):
        return 1, str(error)
    if isinstance(error, UnknownInstructionError):
        return 2, _unknown_instruction(error)
    if isinstance(error, ModelError):
        return (1 if error.is_temporary else 2), error.sentence
    if isinstance(error, OSError) and (error.filename is not None or error.errno in ENVIRONMENT):
        return (1 if error.errno in ENVIRONMENT else 2), system_sentence(error)
    return None


def _unknown_instruction(error: UnknownInstructionError) -> str:
    """Return the message for an unknown instruction, with similar ones in full, ready to copy."""
    from codebotler.models.usable import suggest_model

    sentence = f'{error.model} has no program for "{shortened(error.instruction, 200)}"'
    if error.closest:
        sentence += "; the closest known instructions are:"
    closest = (f"  {instruction}" for instruction in error.closest)
    return "\n".join([sentence, *closest, f"for other instructions, {suggest_model()}"])


def _usage_sentence(error: Any) -> str:  # noqa: ANN401 - the class may be typer's or click's
    message = " ".join(error.format_message().split()).rstrip(".")
    message = message[:1].lower() + message[1:]
    if error.ctx is None:
        return message
    see = " See" if message.endswith("?") else "; see"
    return f"{message}{see} `{error.ctx.command_path} --help`"
