"""Events in English: what a robot does, to what, and with which result."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from codebotler.core.skills.declaration import by_event, verb_for
from codebotler.core.skills.table import Recording
from codebotler.core.skills.verbs import Verb, VerbForm
from codebotler.core.terminal import visible
from codebotler.core.trace import Event, Option
from codebotler.core.words import brief

NO_ANSWER = "no answer"
MOST_BRACKETED = 20  # options


def phrase(event: Event, form: VerbForm, *, show: Callable[[str], str] = brief, quote: str = '"') -> str:
    """An event, such as `looked for "mug": found`, `picking up "mug"` or `asked "Tea?" [yes | no] → yes`.

    The result is added if there is one: to a verb in a sentence's middle (`base`, `ing`) in parentheses.

    Args:
        event: what the robot did or is doing.
        form: of the verb.
        show: cuts texts and makes them fit for where they are shown.
        quote: the mark around texts.
    """
    answer = None if event.answer is None else show(event.answer)
    if form == "ing" and answer is not None:
        return f"the answer {quote}{answer}{quote} to {quote}{show(event.text)}{quote}"
    words = verb_phrase(event.kind, form, [*map(show, (event.text, *event.more))], quote)
    if form in {"base", "ing"}:
        result = f"answer {quote}{answer}{quote}" if answer is not None else result_words(event)
        return f"{words} ({result})" if result else words
    if event.options:
        words += f" {bracketed(event.options, show)}"
    if form == "past" and (answer is not None or is_question(event.kind)):
        return f"{words} → {NO_ANSWER if answer is None else answer}"
    return f"{words}: {result}" if (result := result_words(event)) else words


def verb_phrase(kind: str, form: VerbForm, given: Sequence[str], quote: str = '"') -> str:
    """A form of the verb of a kind of event, and what its skill was given."""
    is_bare = not given or (not given[0] and by_event(kind) is None) or takes_nothing(kind)
    return verb(kind).with_object(getattr(verb(kind), form), [] if is_bare else given, quote)


def result_words(event: Event) -> str:
    """The yes or no of an event in the words of its skill, such as `not found`; empty if it has none."""
    return "" if event.found is None else verb(event.kind).results[event.found]


def bracketed(options: Sequence[Option], show: Callable[[str], str] = brief) -> str:
    """The options of a question, such as `[yes | no]`."""
    shown = [f"{show(one.text)}{'' if one.is_text else ' (no text)'}" for one in options[:MOST_BRACKETED]]
    more = len(options) - MOST_BRACKETED
    return f"[{' | '.join(shown + [f'{more:,} more'] * (more > 0))}]"


def verb(kind: str) -> Verb:
    """The verb for a kind of event, also for one that no skill of this process leaves."""
    if (known := verb_for(kind)) is not None:
        return known
    shown = visible(kind)
    return Verb(f"do {shown}", f"does {shown}", f"did {shown}", f"doing {shown}", f"did {shown}")


def takes_nothing(kind: str) -> bool:
    """Whether events of a kind have no text, since their skill has no arguments."""
    recording = _recording(kind)
    return recording is not None and not recording.text


def is_spoken(kind: str) -> bool:
    """Whether the text of an event is said aloud."""
    recording = _recording(kind)
    return recording is not None and recording.is_spoken


def is_question(kind: str) -> bool:
    """Whether an event offers options."""
    recording = _recording(kind)
    return recording is not None and recording.options is not None


def _recording(kind: str) -> Recording | None:
    row = by_event(kind)
    return None if row is None else row.recording
