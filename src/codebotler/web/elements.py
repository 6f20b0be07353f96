"""Text and buttons on a page, as plain elements; what they are given is shown as text, never as markup.

Characters that nobody sees, or that turn others round, are written out as escapes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from codebotler.core.terminal import visible_lines


class Words(TextElement):
    """An element that holds a text.

    Args:
        tag: of HTML, such as `p`.
        text: which it holds at first.
        kind: its CSS classes.
    """

    def __init__(self, tag: str, text: str = "", kind: str = "") -> None:
        super().__init__(tag=tag, text=visible_lines(text))
        self.classes(kind)
        self.props("dir=auto")

    def say(self, text: str) -> None:
        """Hold another text; without one, it is not to be seen."""
        shown = visible_lines(text)
        if shown != self.text:
            self.text = shown
        self.set_visibility(bool(text))


def scroll_up() -> None:
    """Where the panes stand below each other, show the first one; that is the one that matters now."""
    ui.run_javascript("matchMedia('(max-width: 1180px)').matches && scrollTo(0, 0)")


def warn(sentence: str, seconds: float = 5.0) -> None:
    """Say beside all else that something cannot be done.

    Args:
        sentence: why.
        seconds: for which it stands there.
    """
    ui.notify(visible_lines(sentence), type="warning", position="top", timeout=1000 * seconds)


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
