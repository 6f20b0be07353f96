"""What commands print: drawings, JSON, sentences beside the results, and texts that may hold anything."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import RenderableType


def print_rich(what: RenderableType) -> None:
    """Draw on the terminal, or plainly into a pipe."""
    from rich.console import Console

    console = Console()
    if console.is_terminal:
        console.print(what, crop=False)
        return
    with console.capture() as drawn:
        console.print(what, crop=False)
    print("\n".join(line.rstrip() for line in drawn.get().splitlines()))


def print_json(data: object) -> None:
    """Print for machines."""
    import json

    print(json.dumps(data, indent=2))


def note(sentence: str) -> None:
    """Say something beside the results."""
    print(sentence, file=sys.stderr)


def says_yes(question: str) -> bool:
    """Ask the person who reads this; whoever says nothing, or is not there, does not say yes."""
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def visible(text: str) -> str:
    """A text with whatever a terminal would obey or hide, such as ESC, written out as an escape."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, most: int = 500) -> str:
    """A text made visible, without what is too much to read."""
    left = len(text) - most
    return visible(text) if left <= 0 else f"{visible(text[:most])}... {left:,} more characters"
