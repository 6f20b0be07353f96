"""Text and buttons on a page, as plain elements; what they are given is shown as text, never as markup."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui.elements.mixins.text_element import TextElement


class Words(TextElement):
    """An element that holds a text.

    Args:
        tag: of HTML, such as `p`.
        text: which it holds at first.
        kind: its CSS classes.
    """

    def __init__(self, tag: str, text: str = "", kind: str = "") -> None:
        super().__init__(tag=tag, text=text)
        self.classes(kind)
        self.props("dir=auto")

    def say(self, text: str) -> None:
        """Hold another text; without one, it is not to be seen."""
        if text != self.text:
            self.text = text
        self.set_visibility(bool(text))


class Press(Words):
    """A button.

    Args:
        text: on it.
        pressed: called when it is pressed.
        kind: its CSS classes.
    """

    def __init__(self, text: str, pressed: Callable[..., Any], kind: str = "") -> None:
        super().__init__("button", text, kind)
        self.props("type=button")
        self.on("click", pressed)
        self._may = True

    def allow(self, may: bool) -> None:  # noqa: FBT001 - one word after the verb
        """Let it be pressed, or not."""
        if may != self._may:
            self._may = may
            if may:
                self.props(remove="disabled")
            else:
                self.props("disabled")
