"""The pane with a model's reply. It is shown while the reply arrives, and if it has no program."""

from __future__ import annotations

from nicegui import html

from codebotler.missions.display.view import SessionView
from codebotler.web.frame import PlainText

_MAX_CHARACTERS = 6_000
"""Of a longer reply, the pane shows the end while the reply arrives, and the beginning afterwards."""


class ReplyPane:
    """Shows a model's reply, and why it contains no program."""

    def __init__(self) -> None:
        self._why = PlainText("p", "", "programless").props("role=alert")
        self._text = _Folded("The model's reply", is_open=True)
        self._reasoning = _Folded("The model's reasoning", is_open=False)

    def show(self, view: SessionView) -> None:
        """Show the reply while it arrives. Afterwards, say why it contains no program, or hide the pane."""
        why = text = reasoning = ""
        none = view.programless
        if view.is_written:
            text = view.arriving.text
        elif none is not None and (view.may_be_approved or view.waits_for_program):
            why = none.sentence + (" The previous program is kept." if view.program else "")
            text = "" if none.sentence.endswith(none.text.strip()) else none.text  # do not quote it twice
            reasoning = "" if none.reasoning in none.text else none.reasoning
        self._why.show_text(why)
        self._text.show_text(text, is_arriving=view.is_written)
        self._reasoning.show_text(reasoning)


class _Folded:
    """A collapsible text with a title."""

    def __init__(self, title: str, *, is_open: bool) -> None:
        self._box = html.details().classes("reply").props("open" if is_open else "")
        with self._box:
            PlainText("summary", title)
            self._text = PlainText("div", "", "text").props("tabindex=0")

    def show_text(self, text: str, *, is_arriving: bool = False) -> None:
        """Show a text, or hide the element if it is empty. Cut a long text: at the start if `is_arriving`."""
        self._box.set_visibility(bool(text.strip()))
        if len(text) > _MAX_CHARACTERS:
            text = f"… {text[-_MAX_CHARACTERS:]}" if is_arriving else f"{text[:_MAX_CHARACTERS]} …"
        self._text.show_text(text.strip())
