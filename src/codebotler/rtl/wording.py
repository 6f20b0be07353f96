"""Elements of formulas and events of a robot in English, for explanations."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Literal, TypeAlias

from codebotler.core import words
from codebotler.core.skills.declaration import by_event, verb_for
from codebotler.core.skills.verbs import Verb
from codebotler.core.trace import Event
from codebotler.core.words import brief, listed
from codebotler.rtl.formulas import EventPattern, Regex, Text, Without, Words
from codebotler.rtl.text.claims import Claim, Number, Time

Form: TypeAlias = Literal["base", "past", "ing"]

_LOOKS: Mapping[bool, Mapping[Form, str]] = {
    True: {"base": "find", "past": "found", "ing": "finding"},
    False: {"base": "look in vain for", "past": "looked in vain for", "ing": "looking in vain for"},
}
_MOST_LISTED = 5
_TEXT = r"[\w ',;:!%@&/-]+"
_ALTERNATIVES = re.compile(rf"{_TEXT}(?:\|{_TEXT})*")
_EXACT = re.compile(r"\^([\w -]+(?:\\?\.\d+)?)\$")
_PLAIN = re.compile(rf"{_ALTERNATIVES.pattern}|{_EXACT.pattern}")
_WHOLE_WORDS = re.compile(rf"\\b\(?(?:\?:)?({_TEXT}(?:\|{_TEXT})*)\)?\\b")


def deed(element: EventPattern, form: Form, *, negated: bool = False) -> str:
    """What an element asks for, such as `said something with "hello"`; `anything` after a negation."""
    thing = "anything" if negated else "something"
    if element.found is not None and element.kind == "check":
        done = f"{_LOOKS[element.found][form]} {_wanted(element, thing)}"
    elif element.answer is not None:
        got = {"base": "get", "past": "got", "ing": "getting"}[form]
        done = f"{got} an answer {described(element.answer)}"
    elif verb(element.kind).object:
        told = verb(element.kind)
        wanted = [_part(text, thing) for text in (element.text, *element.more)]
        done = told.with_object(getattr(told, form), [*wanted, *[thing] * told.object.count("{")], "")
    else:
        done = f"{getattr(verb(element.kind), form)} {_wanted(element, thing)}"
    if element.mention:
        done += " in the question or an option"
    if element.options is not None and not is_any(element.options):
        done += f" offering an option {described(element.options)}"
    if element.more and not verb(element.kind).object:
        done = f"{done.rstrip()}, {listed([*filter(None, map(described, element.more))])}".rstrip(", ")
    if element.found is not None and element.kind != "check":
        done = f'{done.rstrip()} with the result "{verb(element.kind).results[element.found]}"'
    if element.to is not None:
        done = f"{done.rstrip()} of somebody {described(element.to)}"
    if element.holding is not None:
        done = f"{done.rstrip()} while holding something {described(element.holding)}"
    return done.rstrip() if element.place is None else f"{done.rstrip()} in {room(Regex(element.place))}"


def _part(text: Text, thing: str) -> str:
    """One of the things that a verb is done to, among other words."""
    match text:
        case Regex(pattern) if exact := _EXACT.fullmatch(pattern):
            return exact[1]
        case Regex(pattern) if _ALTERNATIVES.fullmatch(pattern):
            return named(pattern)
    return f"{thing} {described(text)}".rstrip()


def _wanted(element: EventPattern, thing: str) -> str:
    if not element.has_text:
        return ""
    if element.kind == "goto":
        return room(element.text, "any" if thing == "anything" else "a")
    match element.text:
        case Regex(pattern) if not is_spoken(element.kind) and _PLAIN.fullmatch(pattern):
            return named(pattern)
    return f"{thing} {described(element.text)}".rstrip()


def happening(event: Event, element: EventPattern) -> str:
    """The object of what the robot did, and whatever else an element compares."""
    told = verb(event.kind)
    if told.object:
        thing = told.with_object("", [brief(text) for text in (event.text, *event.more)], "").strip()
    elif takes_nothing(event.kind):
        thing = ""
    else:
        thing = room_name(event.text) if event.kind == "goto" else quoted(event.text)
    if event.options and (element.mention or not is_any(element.options)):
        thing += f" with the options {listed(few([quoted(option.text) for option in event.options]))}"
    if element.answer is not None:
        thing += (
            " and got no answer" if event.answer is None else f" and got the answer {quoted(event.answer)}"
        )
    if event.more and not told.object:
        thing += f", {', '.join(map(quoted, event.more))}"
    if element.found is not None and event.kind != "check":
        thing += "" if event.found is None else f" ({verb(event.kind).results[event.found]})"
    elif element.found is not None:
        thing += " in vain" if event.found is False else " and found it"
    if element.to is not None:
        thing += f" of {quoted(event.to or '')}"
    if element.holding is not None:
        thing += f" while holding {quoted(event.holding) if event.holding else 'nothing'}"
    return thing if element.place is None else f"{thing} in {room_name(event.place)}"


def event_words(event: Event) -> str:
    """What a robot does, such as `driving to "kitchen"`, and what has come of it if that is known."""
    text = words.room_name(event.text) if event.kind == "goto" else event.text
    if event.answer is not None:
        return f"the answer {quoted(event.answer)} to {quoted(text)}"
    doing = verb(event.kind)
    return done_to(event, doing.ing, text) + (
        "" if event.found is None else f" ({doing.results[event.found]})"
    )


def done_to(event: Event, form: str, text: str | None = None) -> str:
    """A form of an event's verb, and to what it is done."""
    return done_with(event.kind, form, [brief(event.text if text is None else text), *map(brief, event.more)])


def done_with(kind: str, form: str, given: Sequence[str], quote: str = '"') -> str:
    """A form of the verb of a kind of event, and what its skill was given."""
    return verb(kind).with_object(form, [] if takes_nothing(kind) else given, quote)


def takes_nothing(kind: str) -> bool:
    """Whether events of a kind have no text, since their skill has no arguments."""
    row = by_event(kind)
    return row is not None and row.recording is not None and not row.recording.text


def verb(kind: str) -> Verb:
    """The verb for a kind of event, also for one of a further skill."""
    other = Verb(f"do {kind}", f"does {kind}", f"did {kind}", f"doing {kind}", f"did {kind}")
    return verb_for(kind) or other


def is_spoken(kind: str) -> bool:
    """Whether the text of an event is said aloud."""
    row = by_event(kind)
    return row is not None and row.recording is not None and row.recording.is_spoken


def room(text: Text, article: str = "a") -> str:
    """The room that a text names, such as `the lobby`, `bob's office` or `a room with /[12]/`."""
    match text:
        case Regex(pattern) if _ALTERNATIVES.fullmatch(pattern):
            return listed(few([room_name(name) for name in pattern.split("|")]), "or")
    return f"{article} room {described(text)}".rstrip()


def room_name(name: str) -> str:
    """The name of a room, with an article if it is a common noun."""
    short = brief(name)
    return f"the {short}" if re.fullmatch(r"(?!the |an? )[a-z]+( [a-z]+)*", name) else short or '""'


def described(text: Text) -> str:
    """What a text must be like, such as `with "5 or five" and "lobby"`; empty if any text matches."""
    found = [*_qualities(text)]
    parts = (
        (head, [q.removeprefix(head) for q in found if q.startswith(head)]) for head in ("with ", "without ")
    )
    return listed([head + listed(few(same)) for head, same in parts if same])


def _qualities(text: Text) -> Iterator[str]:
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(_qualities, parts))
        case Regex(pattern):
            if not is_any(text):
                yield f"with {named(pattern)}"
        case Without(pattern):
            yield f"without the word {named(pattern)}"
        case Number(number, thing, _, other):
            yield f"with {'a number other than' if other else 'the number'} {number} for {named(thing)}"
        case Time(start, end, other):
            yield f"with a time {'outside' if other else 'from'} {start} to {end}"
        case Claim(pattern, denied):
            yield f"with {'a denial' if denied else 'an affirmation'} of {named(pattern)}"


def is_any(text: Text | None) -> bool:
    """Whether a text is written to match every string, or there is none."""
    return text is None or (isinstance(text, Regex) and text.pattern in {"", ".*", "^.*$"})


def named(pattern: str) -> str:
    """A regex as the plain texts it chooses between, or as it is."""
    if exact := _EXACT.fullmatch(pattern):
        return f'"{exact[1]}"'
    if _ALTERNATIVES.fullmatch(pattern):
        return f'"{brief(listed(pattern.split("|"), "or"))}"'
    if whole := _WHOLE_WORDS.fullmatch(pattern):
        return f"the word {named(whole[1])}"
    return f"/{brief(pattern)}/"


def few(parts: Sequence[str]) -> list[str]:
    """The first parts of an enumeration, and how many more there are."""
    more = len(parts) - _MOST_LISTED
    return [*parts[:_MOST_LISTED], f"{more:,} more"] if more > 0 else [*parts]


def quoted(text: str) -> str:
    """A text in quotes, on one line and short enough for a sentence."""
    return f'"{brief(text)}"'
