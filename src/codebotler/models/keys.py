"""Keys of models, which stand in the environment."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from codebotler.core.errors import UserError


def key_in(variable: str) -> str | None:
    """The key that a variable of the environment holds; None if it is not set, or blank.

    Raises:
        UserError: it cannot be sent, because headers hold printable ASCII only.
    """
    key = os.environ.get(variable, "")
    if not key.strip():
        return None
    if not (key.isascii() and key.isprintable() and key == key.strip()):
        raise UserError(
            f"the key in {variable} cannot be sent: it has a line break, a space at an end, or what is no "
            "printable ASCII; set it again"
        )
    return key


@contextmanager
def blank_is_unset(variables: Iterable[str]) -> Iterator[None]:
    """Take blank variables out of the environment meanwhile, for libraries that ask only if one is there."""
    blank = {name: os.environ.pop(name) for name in variables if not os.environ.get(name, "x").strip()}
    try:
        yield
    finally:
        os.environ.update(blank)
