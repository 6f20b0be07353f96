"""The text of a model's reply, while it arrives and if it contains no program."""

from __future__ import annotations

from nicegui import html

from codebotler.generation.no_program import ProgramlessReply
from codebotler.missions.view import SessionView
from codebotler.web.frame import PlainText

_MAX_REPLY_CHARACTERS = 6_000
"""The limit for a reply: its end is shown while it arrives, its beginning afterwards."""


class ReplyPane:
    """Shows a model's text, and why there is no program."""

    def __init__(self) -> None:
        self._why = PlainText("p", "", "programless").props("role=alert")
        self._text = _Folded("The model's reply", is_open=True)
        self._reasoning = _Folded("The model's reasoning", is_open=False)

    def show(self, view: SessionView) -> None:
        """Show a view."""
        waits = (view.may_be_approved or view.waits_for_program) and not view.is_written
        none = view.programless if waits else None
        kept = " The previous program is kept." if view.program else ""
        self._why.say("" if none is None else none.sentence + kept)
        self._text.say(_end_of(view.arriving.text) if view.is_written else _text_of(none))
        self._reasoning.say(_reasoning_of(none))


def _text_of(none: ProgramlessReply | None) -> str:
    """The text of a reply, unless the sentence already quotes it."""
    return "" if none is None or none.sentence.endswith(none.text.strip()) else _start_of(none.text)


def _reasoning_of(none: ProgramlessReply | None) -> str:
    """The reasoning before a reply, unless its text contains it."""
    return "" if none is None or none.reasoning in none.text else _start_of(none.reasoning)


class _Folded:
    """A text that can be folded."""

    def __init__(self, title: str, *, is_open: bool) -> None:
        self._box = html.details().classes("reply").props("open" if is_open else "")
        with self._box:
            PlainText("summary", title)
            self._text = PlainText("div", "", "text").props("tabindex=0")

    def say(self, text: str) -> None:
        """Show a text; an empty one hides the element."""
        self._box.set_visibility(bool(text.strip()))
        self._text.say(text.strip())


def _start_of(text: str) -> str:
    return text if len(text) <= _MAX_REPLY_CHARACTERS else f"{text[:_MAX_REPLY_CHARACTERS]} …"


def _end_of(text: str) -> str:
    return text if len(text) <= _MAX_REPLY_CHARACTERS else f"… {text[-_MAX_REPLY_CHARACTERS:]}"
