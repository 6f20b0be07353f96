"""Runs a command line, and turns its errors into one sentence and an exit status."""

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

ON_WINDOWS = "this runs on Linux and macOS; on Windows, use it inside WSL"
STOPPED = 130  # the status after Ctrl-C, as shells have it
USAGE: Any = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this version of typer keeps click
ENVIRONMENT = (*DISK_FULL, errno.EIO)  # of all that can go wrong in writing, what no other path would mend

_command = cache(get_command)


def obey(app: typer.Typer, name: str) -> NoReturn:
    """Run a command line and end the process; what a user can cause ends in one sentence.

    The status is 2 for what was asked wrongly, 1 for what the machine could not do.
    """
    if sys.platform == "win32":
        note(f"{name}: {ON_WINDOWS}")
        raise SystemExit(1)
    atexit.register(gc.freeze)  # to look for garbage at the end takes a tenth of the time of a long command
    open_streams()
    if not os.environ.get("COLUMNS", "1").strip("0"):  # no columns at all: what asked does not know how many
        del os.environ["COLUMNS"]
    try:
        with installed():
            status = _command(app)(standalone_mode=False, prog_name=name)
        flush_output()
    except KeyboardInterrupt:
        status = STOPPED
    except BrokenPipeError:  # whoever read the results has read enough
        drop_output()
        status = 1
    except Exception as error:
        ending = _ending(error)
        if ending is None:
            raise
        status, sentence = ending
        note(f"{name}: {sentence}")
        if isinstance(error, OSError) and error.filename is None:  # what is left of the output
            drop_output()
    if status == STOPPED:
        note(f"{name}: stopped")
    raise SystemExit(status if isinstance(status, int) else 0)


def _ending(error: Exception) -> tuple[int, str] | None:
    """The status and the sentence for an error; None for a fault of ours."""
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
        return (1 if error.may_pass else 2), error.sentence
    if isinstance(error, OSError) and (error.filename is not None or error.errno in ENVIRONMENT):
        return (1 if error.errno in ENVIRONMENT else 2), system_sentence(error)
    return None


def _unknown_instruction(error: UnknownInstructionError) -> str:
    """The closest instructions are whole, to be copied."""
    from codebotler.models.usable import suggest_model

    told = f'{error.model} has no program for "{shortened(error.instruction, 200)}"'
    if error.closest:
        told += "; the closest that it knows here:"
    return "\n".join(
        [
            told,
            *(f"  {closest}" for closest in error.closest),
            f"for other instructions, {suggest_model()}",
        ]
    )


def _usage_sentence(error: Any) -> str:  # noqa: ANN401 - one of two libraries' own
    message = " ".join(error.format_message().split()).rstrip(".")
    message = message[:1].lower() + message[1:]
    if error.ctx is None:
        return message
    see = " See" if message.endswith("?") else "; see"
    return f"{message}{see} `{error.ctx.command_path} --help`"
