"""The syntax tree of a Python source, read by one thread at a time."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import contextmanager

from codebotler.core.unwarned import unwarned


def parse(source: str, *, compiled: bool = False) -> ast.Module:
    """The syntax tree of a source.

    Args:
        source: any text.
        compiled: whether to look also for errors that the compiler finds, such as a stray `return`.

    Raises:
        SyntaxError: it is no Python.
        ValueError: it holds what is no text, such as half a character.
        RecursionError, MemoryError: it is nested too deeply.
    """
    with reading():
        tree = ast.parse(source)
        if compiled:
            compile(tree, "<program>", "exec", dont_inherit=True)
        return tree


def parse_expression(source: str) -> ast.expr:
    """The syntax tree of an expression.

    Args:
        source: any text.

    Raises:
        SyntaxError, ValueError, RecursionError, MemoryError: as `parse`.
    """
    with reading():
        return ast.parse(source, mode="eval").body


@contextmanager
def reading() -> Iterator[None]:
    """While a source is read: no other thread reads one, and nobody is warned of odd escapes in it."""
    # CPython before 3.13 counts the depth of all trees that are being made in one place: where two threads
    # read, one of them gets a SystemError. So it matters, too, that no other thread is in there.
    with unwarned():
        yield
