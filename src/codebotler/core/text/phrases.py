"""Describe events in English, with objects and results."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.table import Recording
from codebotler.core.skills.verbs import Verb, VerbForm
from codebotler.core.terminal import visible
from codebotler.core.text.words import brief, elide_list
from codebotler.core.trace import Event

NO_ANSWER = "no answer"
MAX_BRACKETED_OPTIONS = 20
UNKNOWN_RECORDING = Recording("", "text", names="thing")  # of a kind that no loaded skill records


def phrase(event: Event, form: VerbForm, *, show: Callable[[str], str] = brief, quote: str = '"') -> str:
    """Describe an event, such as `looked for "mug": found`.

    A result comes last. The forms `base` and `ing` put it in parentheses: `look for "mug" (found)`.

    Args:
        event: the event.
        form: the form of the verb.
        show: shortens and escapes texts for the output.
        quote: the quotation mark around texts. Inside a text, it becomes an apostrophe.
    """
    if quote:
        show = partial(_without_quotes, show, quote)
    answer = None if event.answer is None else show(event.answer)
    if form == "ing" and answer is not None:
        return f"the answer {quote}{answer}{quote} to {quote}{show(event.text)}{quote}"
    given = [*map(show, (event.text, *event.more))]
    is_bare = (not given[0] and by_event(event.kind) is None) or not _recording(event.kind).text
    known = verb(event.kind)
    words = known.with_object(getattr(known, form), [] if is_bare else given, quote)
    if form in {"base", "ing"}:
        result = f"answer {quote}{answer}{quote}" if answer is not None else result_words(event)
        return f"{words} ({result})" if result else words
    words += bracketed(event, show)
    if form == "past" and (answer is not None or is_question(event.kind)):
        return f"{words} → {NO_ANSWER if answer is None else answer}"
    return f"{words}: {result}" if (result := result_words(event)) else words


def bracketed(event: Event, show: Callable[[str], str]) -> str:
    """Return the options of a question, such as ` [yes | no]`, or an empty string if it has none."""
    shown = [f"{show(one.text)}{'' if one.is_text else ' (no text)'}" for one in event.options]
    return f" [{' | '.join(elide_list(shown, MAX_BRACKETED_OPTIONS))}]" if shown else ""


def _without_quotes(show: Callable[[str], str], quote: str, text: str) -> str:
    return show(text).replace(quote, "'")


def result_words(event: Event) -> str:
    """Return the result of an event in words, such as `not found`, or an empty string if it has none."""
    return "" if event.found is None else verb(event.kind).results[event.found]


def verb(kind: str) -> Verb:
    """Return the verb for a kind of event, or a generic verb if no loaded skill records this kind."""
    row = by_event(kind)
    if row is not None and row.verb is not None:
        return row.verb
    shown = visible(kind)
    return Verb(f"do {shown}", f"does {shown}", f"did {shown}", f"doing {shown}", f"did {shown}")


def is_spoken(kind: str) -> bool:
    """Whether the robot speaks the text of events of this kind, such as `say` and `ask`."""
    return _recording(kind).is_spoken


def is_question(kind: str) -> bool:
    """Whether events of this kind offer options, such as `ask`."""
    return _recording(kind).options is not None


def _recording(kind: str) -> Recording:
    row = by_event(kind)
    return UNKNOWN_RECORDING if row is None or row.recording is None else row.recording
