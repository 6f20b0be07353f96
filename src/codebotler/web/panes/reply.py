"""The reply of a model, as text: while it arrives, and where it holds no program."""

from __future__ import annotations

from nicegui import html

from codebotler.missions.view import SessionView
from codebotler.web.frame import PlainText

MOST_TEXT = 6_000
"""Characters of a reply that are shown: the last ones while it arrives, and then the first."""


class ReplyPane:
    """Shows what a model says besides a program, and why there is no program."""

    def __init__(self) -> None:
        self._why = PlainText("p", "", "trouble").props("role=alert")
        self._text = _Folded("What the model says", is_open=True)
        self._reasoning = _Folded("What the model thought before", is_open=False)

    def show(self, view: SessionView) -> None:
        """Show a view."""
        none = None if view.is_over or view.is_written else view.programless
        self._why.say("" if none is None else none.sentence)
        arrived = view.arriving.text if view.is_written else ""
        self._text.say(_end_of(arrived) if none is None else _start_of(none.text))
        self._reasoning.say("" if none is None else _start_of(none.reasoning))


class _Folded:
    """A text below a line that folds it."""

    def __init__(self, title: str, *, is_open: bool) -> None:
        self._box = html.details().classes("reply").props("open" if is_open else "")
        with self._box:
            PlainText("summary", title)
            self._text = PlainText("div", "", "text").props("tabindex=0")

    def say(self, text: str) -> None:
        """Show a text; an empty one hides all."""
        self._box.set_visibility(bool(text.strip()))
        self._text.say(text.strip())


def _start_of(text: str) -> str:
    return text if len(text) <= MOST_TEXT else f"{text[:MOST_TEXT]} …"


def _end_of(text: str) -> str:
    return text if len(text) <= MOST_TEXT else f"… {text[-MOST_TEXT:]}"
