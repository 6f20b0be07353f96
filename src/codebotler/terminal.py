"""What commands print: drawings, JSON, sentences beside the results, and texts that may hold anything."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import RenderableType

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
WIDEST = 10_000
QUIET_S = 2.0  # for so long does a command say nothing at first


def print_rich(what: RenderableType) -> None:
    """Draw on the terminal; or plainly into a pipe, where no line is broken unless COLUMNS is set."""
    from rich.console import Console
    from rich.measure import Measurement

    console = Console()
    if console.is_terminal:
        console.print(what, crop=False)
        return
    if "COLUMNS" not in os.environ:
        natural = Measurement.get(console, console.options.update(max_width=WIDEST), what).maximum
        console.width = max(console.width, natural)
    with console.capture() as drawn:
        console.print(what, crop=False)
    print("\n".join(line.rstrip() for line in drawn.get().splitlines()))


@contextmanager
def busy(doing: str) -> Iterator[None]:
    """Show that something goes on: on a terminal how long it has taken, elsewhere one line after a while.

    Args:
        doing: what goes on, such as `checking`.
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn(doing, markup=False), TimeElapsedColumn())
    line = Timer(QUIET_S, note, [f"{doing} ..."])
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        progress.add_task(doing)
        if not console.is_terminal:
            line.start()
        try:
            yield
        finally:
            line.cancel()


def print_json(data: object) -> None:
    """Print for machines."""
    import json

    print(json.dumps(data, indent=2))


def print_text(text: str) -> None:
    """Print a text as it is, with an end to its last line."""
    print(text, end="" if text.endswith("\n") else "\n")


def note(sentence: str) -> None:
    """Say something beside the results."""
    print(sentence, file=sys.stderr)


def says_yes(question: str) -> bool:
    """Ask the person who reads this; whoever says nothing, or is not there, does not say yes."""
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def system_sentence(error: OSError) -> str:
    """What the system refuses, of which file, and the mend where there is one for sure."""
    where = "the output" if error.filename is None else visible(os.fsdecode(error.filename))
    mend = "; make room and give the same command again" if error.errno in FULL else ""
    return f"{where}: {error.strerror}{mend}"


def visible(text: str) -> str:
    """A text with whatever a terminal would obey or hide, such as ESC, written out as an escape."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def visible_lines(text: str) -> str:
    """A text made visible, but for the ends of its lines, where programs and people end them, and tabs."""
    return "\n".join(visible(line.expandtabs(4)) for line in re.split("\r\n?|\n", text))


def shortened(text: str, most: int = 500) -> str:
    """A text made visible, without what is too much to read."""
    left = len(text) - most
    return visible(text) if left <= 0 else f"{visible(text[:most])}... {left:,} more characters"
