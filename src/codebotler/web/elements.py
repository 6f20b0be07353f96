"""Text and buttons on a page: shown as text, never as markup, with hidden characters written out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from codebotler.core.terminal import visible_lines


class PlainText(TextElement):
    """An HTML element with a text; `kind` is its CSS classes."""

    def __init__(self, tag: str, text: str = "", kind: str = "") -> None:
        super().__init__(tag=tag, text=visible_lines(text))
        self.classes(kind)
        self.props("dir=auto")

    def say(self, text: str) -> None:
        """Show another text; an empty one hides the element."""
        shown = visible_lines(text)
        if shown != self.text:
            self.text = shown
        self.set_visibility(bool(text))


def scroll_up() -> None:
    """Show the first pane, where panes stand one below another."""
    ui.run_javascript("matchMedia('(max-width: 1180px)').matches && scrollTo(0, 0)")


def warn(sentence: str, seconds: float = 5.0) -> None:
    """Show a warning for some seconds."""
    ui.notify(visible_lines(sentence), type="warning", position="top", timeout=1000 * seconds)


class Button(PlainText):
    """A button that calls a function when it is pressed."""

    def __init__(self, text: str, pressed: Callable[..., Any], kind: str = "") -> None:
        super().__init__("button", text, kind)
        self.props("type=button")
        self.on("click", pressed)
        self._may = True

    def allow(self, may: bool) -> None:  # noqa: FBT001 - one word after the verb
        """Enable or disable it."""
        if may != self._may:
            self._may = may
            if may:
                self.props(remove="disabled")
            else:
                self.props("disabled")
