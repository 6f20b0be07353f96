"""Print the output of all commands, with control characters escaped."""

from __future__ import annotations

import errno
import io
import logging
import os
import re
import sys
import termios
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.progress import Progress, ProgressColumn

LEAST_CUT = 30  # shorter ends of texts are shown, since the note about them would be as long
DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
MAX_PIPE_WIDTH = 10_000


@contextmanager
def report_problems() -> Iterator[None]:
    """In a `with` block, print logs and warnings to stderr, and exit with status 1 on an unexpected error."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # for terminals without Unicode
    before = logging.lastResort, warnings.showwarning, threading.excepthook
    logging.lastResort = _Notes(logging.WARNING)
    warnings.showwarning = _note_warning
    threading.excepthook = lambda args: _note_error(args.exc_value)
    try:
        yield
    except Exception as error:  # noqa: BLE001 - a last resort
        _note_error(error)
        raise SystemExit(1) from None
    finally:
        logging.lastResort, warnings.showwarning, threading.excepthook = before


class _Notes(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        note(self.format(record))


def _note_warning(*warning: Any, **_: object) -> None:  # noqa: ANN401 - as Python calls it
    note(warnings.formatwarning(*warning[:4]).rstrip())


def _note_error(error: BaseException | None) -> None:
    note("".join(traceback.format_exception(error)).rstrip())


def open_streams() -> None:
    """Open /dev/null for each closed standard stream, so that no other file gets its descriptor."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def flush_output() -> None:
    """Flush stdout now, so that an error such as a full disk can be reported."""
    sys.stdout.flush()


def drop_output() -> None:
    """Discard all further output to stdout, for example because its reader has exited."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def console(*, stderr: bool = False, highlight: bool = True) -> Console:
    """Return a rich console that escapes control characters. `highlight` colours numbers and strings."""
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
    """Return a progress bar with these columns on stderr. It shows nothing if stderr is not a terminal."""
    from rich.progress import Progress

    where = console(stderr=True)
    return Progress(*columns, console=where, transient=True, disable=not where.is_terminal)


def print_rich(what: RenderableType) -> None:
    """Print a rich table or text. A pipe or file gets plain text, whose lines wrap only if COLUMNS is set."""
    from rich.measure import Measurement

    drawing = console()
    if drawing.is_terminal:
        drawing.print(what, crop=False)
        return
    if "COLUMNS" not in os.environ:
        natural = Measurement.get(drawing, drawing.options.update(max_width=MAX_PIPE_WIDTH), what).maximum
        drawing.width = max(drawing.width, natural)
    with drawing.capture() as drawn:
        drawing.print(what, crop=False)
    print("\n".join(line.rstrip() for line in drawn.get().splitlines()))


@contextmanager
def busy(doing: str) -> Iterator[None]:
    """During a `with` block, show a spinner, the elapsed time and a text such as `asking the model`."""
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    with progress(SpinnerColumn(), TextColumn(doing, markup=False), TimeElapsedColumn()) as shown:
        shown.add_task(doing)
        yield


def print_found(view: Callable[[], RenderableType], data: Callable[[], object], *, as_json: bool) -> None:
    """Print the result of `view()` for a person or, if `as_json`, the result of `data()` as JSON."""
    if as_json:
        print_json(data())
    else:
        print_rich(view())


def print_json(data: object) -> None:
    """Print data as indented JSON."""
    import json

    print(json.dumps(data, indent=2))


def print_source(text: str) -> None:
    """Print a program to stdout: with control characters escaped on a terminal, else unchanged."""
    if sys.stdout.isatty():
        text = visible_lines(text)
    print(text, end="" if text.endswith("\n") else "\n")


def print_text(text: str) -> None:
    """Print text to stdout with control characters escaped."""
    print(visible_lines(text), flush=True)


def note(sentence: str) -> None:
    """Print a message to stderr, since stdout is for results."""
    print(visible_lines(sentence), file=sys.stderr)


def confirm(question: str) -> bool:
    """Ask a question on stderr, and return True only if the person types `y` or `yes`."""
    return read_line(f"{question} [y/N] ").strip().lower() in {"y", "yes"}


def read_line(question: str) -> str:
    """Ask a question on stderr, and return the typed line with its line break, or `""` at the end of input.

    On a terminal, text that was typed before the question appeared is discarded.
    """
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
    print(visible(question), end="", file=sys.stderr, flush=True)
    return sys.stdin.readline()


def is_interactive() -> bool:
    """Whether stdin and stderr are terminals, so that a person can read a question and answer it."""
    return sys.stdin.isatty() and sys.stderr.isatty()


def system_sentence(error: OSError) -> str:
    """Return a sentence about a system error that names the file and, for a full disk, the fix."""
    where = "the output" if error.filename is None else visible(os.fsdecode(error.filename))
    mend = "; free some disk space and try again" if error.errno in DISK_FULL else ""
    return f"{where}: {error.strerror}{mend}"


def visible(text: str) -> str:
    """Return a text with its unprintable characters escaped, such as ESC and line breaks."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def visible_lines(text: str) -> str:
    """Return a text with its unprintable characters escaped, but keep line breaks and expand tabs."""
    if text.isprintable():
        return text
    return "\n".join(visible(line.expandtabs(4)) for line in re.split("\r\n?|\n", text))


def shortened(text: str, most: int = 500, shown: Callable[[str], str] = visible) -> str:
    """Escape a string with `shown`, and shorten it after `most` characters: `abc... 99 more characters`."""
    left = len(text) - most
    return shown(text) if left <= LEAST_CUT else f"{shown(text[:most])}... {left:,} more characters"
