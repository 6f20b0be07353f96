"""The command line of CodeBotler, and what all command lines of this package share."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import Annotated, Any, NoReturn

import typer

from codebotler import __version__

ON_WINDOWS = "this runs on Linux and macOS; on Windows, use it inside WSL"
STOPPED = 130  # the status after Ctrl-C, as shells have it
USAGE: Any = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this version of typer keeps click
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
ENVIRONMENT = (*FULL, errno.EIO)  # of all that can go wrong in writing, what no other path would mend

app = typer.Typer(rich_markup_mode=None, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def codebotler(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Robot programs from plain words; so far a library, and the engine of `roboeval`."""
    print(f"codebotler {__version__}" if version else context.get_help())


def obey(app: typer.Typer, name: str) -> NoReturn:
    """Run a command line and end the process; what a user can cause ends in one sentence.

    The status is 2 for what was asked wrongly, 1 for what the machine could not do.

    Args:
        app: its commands.
        name: how a user calls it.
    """
    if sys.platform == "win32":
        print(f"{name}: {ON_WINDOWS}", file=sys.stderr)
        raise SystemExit(1)
    if isinstance(sys.stdout, io.TextIOWrapper):  # what a terminal cannot show must not end a command
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = app(standalone_mode=False, prog_name=name)
        sys.stdout.flush()
    except KeyboardInterrupt:
        status = STOPPED
    except BrokenPipeError:  # whoever read the results has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    except Exception as error:
        ending = _ending(error)
        if ending is None:
            raise
        status, sentence = ending
        print(f"{name}: {sentence}", file=sys.stderr)
        if isinstance(error, OSError) and error.filename is None:  # what is left of the output
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if status == STOPPED:
        print(f"{name}: stopped", file=sys.stderr)
    raise SystemExit(status if isinstance(status, int) else 0)


def _ending(error: Exception) -> tuple[int, str] | None:
    """The status and the sentence for an error; None for one that a user cannot cause."""
    from codebotler.badinput import BadInput
    from codebotler.models.base import BudgetSpentError, ModelError
    from codebotler.simulator.engine import EngineError

    if isinstance(error, USAGE):
        message = " ".join(error.format_message().split()).rstrip(".")
        where = "" if error.ctx is None else f"; `{error.ctx.command_path} --help` lists what there is"
        return 2, message[:1].lower() + message[1:] + where
    if isinstance(error, BadInput):
        return 2, str(error)
    if isinstance(error, EngineError | BudgetSpentError):
        return 1, str(error)
    if isinstance(error, ModelError):
        return (1 if error.may_pass else 2), error.sentence
    if isinstance(error, OSError) and (error.filename is not None or error.errno in ENVIRONMENT):
        return (1 if error.errno in ENVIRONMENT else 2), _system_sentence(error)
    return None


def _system_sentence(error: OSError) -> str:
    where = "the output" if error.filename is None else os.fsdecode(error.filename)
    mend = "; make room and give the same command again" if error.errno in FULL else ""
    return f"{where}: {error.strerror}{mend}"


def main() -> None:
    """Run the command line."""
    obey(app, "codebotler")


if __name__ == "__main__":
    main()
