"""Prints the progress and the errors of commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import NoReturn, TypeVar

from codebotler.cli.ending import STOPPED
from codebotler.core.terminal import note, print_json, print_rich, print_text, progress

__all__ = [
    "fail",
    "note",
    "print_json",
    "print_rich",
    "print_text",
    "progress_meter",
    "show_progress",
    "stoppable",
]

QUIET_S = 2.0  # seconds before a command says what it is doing
Watched = TypeVar("Watched")


def show_progress(items: Iterable[Watched], doing: str, total: int) -> Iterator[Watched]:
    """Yield the items, and show progress such as `reading: 12 of 80` (or a bar in a terminal)."""
    with progress_meter(doing, total) as update:
        for done, item in enumerate(items, 1):
            yield item
            update(done, "")  # the consumer has processed the item


@contextmanager
def progress_meter(doing: str, total: int, before: int = 0) -> Iterator[Callable[[int, str], None]]:
    """Show progress from `before` to `total`. Yield a function that takes the number done and a remark."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    more_column = TextColumn("{task.fields[more]}", markup=False)
    columns = TextColumn(doing), BarColumn(), MofNCompleteColumn(), more_column, TimeRemainingColumn()
    started = monotonic()
    next_line = started + QUIET_S
    with progress(*columns) as shown:
        job = shown.add_task(doing, total=total, completed=before, more="")

        def update(done: int, more: str) -> None:
            nonlocal next_line
            shown.update(job, completed=done, more=more)
            if shown.disable and monotonic() >= next_line:
                note(", ".join(filter(None, (f"{doing}: {done:,} of {total:,}", more))))
                next_line = monotonic() + max(QUIET_S, (monotonic() - started) / 10)

        yield update


@contextmanager
def stoppable(sentence: str = "the same command continues where it stopped") -> Iterator[None]:
    """On Ctrl-C in the `with` block, print `sentence`, which says how to continue, and exit."""
    try:
        yield
    except KeyboardInterrupt:
        note(f"roboeval: stopped; {sentence}")
        raise SystemExit(STOPPED) from None


def fail(sentence: str) -> NoReturn:
    """Print a sentence about the user's input, and exit with status 2."""
    note(f"roboeval: {sentence}")
    raise SystemExit(2)
