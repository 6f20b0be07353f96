"""The command line of CodeBotler, and what all command lines of this package share."""

from __future__ import annotations

import errno
import io
import os
import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from codebotler import __version__

ON_WINDOWS = "this runs on Linux and macOS; on Windows, use it inside WSL"
STOPPED = 130  # the status after Ctrl-C, as shells have it
USAGE: Any = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this version of typer keeps click
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
ENVIRONMENT = (*FULL, errno.EIO)  # of all that can go wrong in writing, what no other path would mend

app = typer.Typer(rich_markup_mode=None, add_completion=False, pretty_exceptions_enable=False)


@app.callback(invoke_without_command=True)
def codebotler(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Robot programs from plain words: checked before a robot moves."""
    if version:
        print(f"codebotler {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def check(
    program: Annotated[str, typer.Argument(help="A file, or - for a program or a reply on standard input.")],
    world: Annotated[
        Path | None, typer.Option(help="The world file that tells which rooms there are.")
    ] = None,
    samples: Annotated[int, typer.Option(min=1, max=10_000, help="How many worlds to imagine.")] = 5,
    seed: Annotated[int, typer.Option(help="From which they are drawn.")] = 0,
    strict: Annotated[
        bool, typer.Option("--strict", help="Draw also what the program never looks for.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="Runs that go on at the same time.")] = 1,
) -> None:
    """Look for problems in a program, in its text and in imagined worlds; status 1 if there are any."""
    from codebotler.check import check as look_for_problems
    from codebotler.checking import check_view, read_program
    from codebotler.terminal import print_json, print_rich
    from codebotler.world import World

    known = None if world is None else World.read(world)
    source = read_program(program)
    found = look_for_problems(
        source,
        rooms=None if known is None else [room.name for room in known.rooms],
        start=None if known is None else known.robot,
        samples=samples,
        seed=seed,
        strict=strict,
        workers=workers,
    )
    if json:
        print_json(found.data())
    else:
        print_rich(check_view(found, source, "the program" if program == "-" else program))
    raise typer.Exit(1 if found.problems else 0)


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
    from codebotler.simulator.engine import EngineError

    if isinstance(error, USAGE):
        message = " ".join(error.format_message().split()).rstrip(".")
        where = "" if error.ctx is None else f"; `{error.ctx.command_path} --help` lists what there is"
        return 2, message[:1].lower() + message[1:] + where
    if isinstance(error, BadInput):
        return 2, str(error)
    if isinstance(error, EngineError):
        return 1, str(error)
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
