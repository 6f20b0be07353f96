"""What commands print, and the only place that writes to a terminal: what that would obey is written out."""

from __future__ import annotations

import errno
import io
import logging
import os
import re
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.progress import Progress, ProgressColumn

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
WIDEST = 10_000
QUIET_S = 2.0  # for so long does a command say nothing at first


def open_streams() -> None:
    """Let standard streams that somebody closed lead nowhere, so that no file of ours takes their place.

    What the output cannot show is written out there, and ends no command.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


@contextmanager
def noting_all() -> Iterator[None]:
    """While a command runs: what Python and libraries say is a note, be it a log, a warning or a traceback.

    An error that nobody foresaw ends it with status 1.
    """
    before = logging.lastResort, warnings.showwarning, threading.excepthook
    logging.lastResort = _Notes(logging.WARNING)
    warnings.showwarning = _note_warning
    threading.excepthook = lambda args: _note_error(args.exc_value)
    try:
        yield
    except Exception as error:  # noqa: BLE001 - whatever it is, it is told
        _note_error(error)
        raise SystemExit(1) from None
    finally:
        logging.lastResort, warnings.showwarning, threading.excepthook = before


class _Notes(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        note(self.format(record))


def _note_warning(  # noqa: PLR0917 - as Python calls it
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,  # noqa: ARG001
    line: str | None = None,
) -> None:
    note(warnings.formatwarning(message, category, filename, lineno, line).rstrip())


def _note_error(error: BaseException | None) -> None:
    note("".join(traceback.format_exception(error)).rstrip())


def flush_output() -> None:
    """Write what is not yet written."""
    sys.stdout.flush()


def drop_output() -> None:
    """Let what is not yet written, and all that follows, go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def console(*, stderr: bool = False, highlight: bool = True) -> Console:
    """Draws on a terminal; the only control characters are those of the drawing itself."""
    from rich.console import Console, ConsoleOptions
    from rich.segment import Segment

    class Drawing(Console):
        def render(
            self, renderable: RenderableType, options: ConsoleOptions | None = None
        ) -> Iterator[Segment]:
            for segment in super().render(renderable, options):
                text, style, control = segment
                yield segment if control else Segment(visible_lines(text), style)

    return Drawing(stderr=stderr, highlight=highlight)


def progress(*columns: ProgressColumn) -> Progress:
    """A bar beside the results, for as long as something goes on; nothing where there is no terminal."""
    from rich.progress import Progress

    where = console(stderr=True)
    return Progress(*columns, console=where, transient=True, disable=not where.is_terminal)


def print_rich(what: RenderableType) -> None:
    """Draw on the terminal; or plainly into a pipe, where no line is broken unless COLUMNS is set."""
    from rich.measure import Measurement

    drawing = console()
    if drawing.is_terminal:
        drawing.print(what, crop=False)
        return
    if "COLUMNS" not in os.environ:
        natural = Measurement.get(drawing, drawing.options.update(max_width=WIDEST), what).maximum
        drawing.width = max(drawing.width, natural)
    with drawing.capture() as drawn:
        drawing.print(what, crop=False)
    print("\n".join(line.rstrip() for line in drawn.get().splitlines()))


@contextmanager
def busy(doing: str) -> Iterator[None]:
    """Show that something goes on: on a terminal how long it has taken, elsewhere one line after a while.

    Args:
        doing: what goes on, such as `checking`.
    """
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    line = Timer(QUIET_S, note, [f"{doing} ..."])
    with progress(SpinnerColumn(), TextColumn(doing, markup=False), TimeElapsedColumn()) as shown:
        shown.add_task(doing)
        if shown.disable:
            line.start()
        try:
            yield
        finally:
            line.cancel()


def print_json(data: object) -> None:
    """Print for machines."""
    import json

    print(json.dumps(data, indent=2))


def print_source(text: str) -> None:
    """Print a text with an end to its last line; into a file or a pipe as it is, for what reads it there."""
    if sys.stdout.isatty():
        text = visible_lines(text)
    print(text, end="" if text.endswith("\n") else "\n")


def print_text(text: str) -> None:
    """Print lines for people, at once."""
    print(visible_lines(text), flush=True)


def note(sentence: str) -> None:
    """Say something beside the results."""
    print(visible_lines(sentence), file=sys.stderr)


def says_yes(question: str) -> bool:
    """Ask the person who reads this; whoever says nothing, or is not there, does not say yes."""
    print(f"{visible(question)} [y/N] ", end="", file=sys.stderr, flush=True)
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
    if text.isprintable():
        return text
    return "\n".join(visible(line.expandtabs(4)) for line in re.split("\r\n?|\n", text))


def shortened(text: str, most: int = 500) -> str:
    """A text made visible, without what is too much to read."""
    left = len(text) - most
    return visible(text) if left <= 0 else f"{visible(text[:most])}... {left:,} more characters"
