"""What commands print: drawings, JSON, sentences beside the results, and texts that may hold anything."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import RenderableType

WIDEST = 10_000


def print_rich(what: RenderableType) -> None:
    """Draw on the terminal; or plainly into a pipe, where no line is broken unless COLUMNS is set."""
    from rich.console import Console
    from rich.measure import Measurement

    console = Console()
    if console.is_terminal:
        console.print(what)
        return
    if "COLUMNS" not in os.environ:
        natural = Measurement.get(console, console.options.update(max_width=WIDEST), what).maximum
        console.width = max(console.width, natural)
    with console.capture() as drawn:
        console.print(what)
    print("\n".join(line.rstrip() for line in drawn.get().splitlines()))


def print_json(data: object) -> None:
    """Print for machines."""
    import json

    print(json.dumps(data, indent=2))


def note(sentence: str) -> None:
    """Say something beside the results."""
    print(sentence, file=sys.stderr)


def visible(text: str) -> str:
    """A text with whatever a terminal would obey or hide, such as ESC, written out as an escape."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, most: int = 500) -> str:
    """A text made visible, without what is too much to read."""
    left = len(text) - most
    return visible(text) if left <= 0 else f"{visible(text[:most])}... {left:,} more characters"
