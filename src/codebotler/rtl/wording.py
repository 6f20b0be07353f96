"""What a robot may do, and what it did, in English, for explanations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

from codebotler.core.skills import SKILLS, Verb
from codebotler.core.words import listed
from codebotler.rtl.formula import EventPattern, Regex, Text, Without
from codebotler.rtl.phrases import either, is_any, lacks, literals, quoted, room, room_name, with_texts

if TYPE_CHECKING:
    from collections.abc import Iterable

    from codebotler.core.trace import Event

Form: TypeAlias = Literal["base", "past", "ing"]
Deed: TypeAlias = tuple[EventPattern, ...]
"""What one robot may do: any of these elements. Two of them are one text, in a question or in its options."""

_VERBS = SKILLS.verbs
_OTHER_VERB = Verb("do", "does", "did", "doing")
_MENTION: dict[Form, str] = {"base": "mention", "past": "mentioned", "ing": "mentioning"}
_MOST = 5


def did(deed: Deed, form: Form, *, never: bool = False) -> str:
    """A deed as a verb and its object, such as `asked about lunch`.

    Args:
        deed: what may be done.
        form: of the verb.
        never: whether `never` or `not` stands before it, so that it is `anything` rather than `something`.
    """
    done, place = _did(deed, form, never=never), deed[0].place
    return done if place is None else f"{done} in {room(place)}"


def _did(deed: Deed, form: Form, *, never: bool) -> str:  # noqa: PLR0911 - one for each kind
    element = deed[0]
    verb = getattr(_VERBS.get(element.kind, _OTHER_VERB), form)
    if element.answer is not None:
        got = {"base": "get", "past": "got", "ing": "getting"}[form]
        return f"{got} an answer {with_texts(element.answer)}".rstrip()
    if len(deed) > 1 or (element.mention and not is_any(element.text)):
        return _mentioned(deed, form, verb)
    if element.kind == "check" and is_any(element.text):
        return f"{verb.removesuffix(' for')} around"
    thing = "anything" if never else "something"
    match element.kind:
        case "goto":
            anywhere = "anywhere" if never else "somewhere"
            return f"{verb.removesuffix(' to')} {_destination(element.text, anywhere)}"
        case "say":
            return " ".join(filter(None, [verb, thing, with_texts(element.text)]))
        case "ask":
            return f"{verb} {_question(element, 'anything' if never else 'a question')}"
        case "check" | "pick" | "place":
            return f"{verb} {_thing(element.text, thing)}"
        case kind:
            return " ".join(filter(None, [verb, f"a {kind}", with_texts(element.text)]))


def happened(event: Event, form: Form) -> str:
    """An event as a verb and its object, such as `said "hello"`.

    Args:
        event: what the robot did.
        form: of the verb.
    """
    verb = getattr(_VERBS.get(event.kind, _OTHER_VERB), form)
    if event.kind == "goto":
        return f"{verb} {room_name(event.text)}"
    return (
        f"{verb} {quoted(event.text)}"
        if event.kind in _VERBS
        else f"{verb} a {event.kind} {quoted(event.text)}"
    )


def offered(event: Event) -> str:
    """An event in the past, with the options of a question.

    Args:
        event: what the robot did.
    """
    options = f" with the options {_options(event)}" if event.options else ""
    return f"{happened(event, 'past')}{options}"


def pastimes(events: Iterable[Event]) -> str:
    """What the robot did, by kind only: `spoke and looked around`; empty where it did nothing but move.

    Args:
        events: what it did.
    """
    kinds = dict.fromkeys(event.kind for event in events if event.kind != "goto")
    return listed([_VERBS[kind].alone if kind in _VERBS else f"did a {kind}" for kind in kinds])


def lacking(deed: Deed, event: Event) -> str:
    """Why an event of the right kind is not the deed: `which lacks "good"`.

    Args:
        deed: what was wanted.
        event: what happened instead.
    """
    if not deed[0].happens_at(event.place):
        return f"which was in {room_name(event.place)}"
    if deed[0].answer is not None:
        return (
            "which nobody answered" if event.answer is None else f"and the answer was {quoted(event.answer)}"
        )
    absent = next((lack for element in deed if (lack := lacks(element.text, event.text))), [])
    named = len(absent) > 1 or not absent or not absent[0].startswith("does not match")
    reasons = [f"which {listed(absent) if named else 'does not match'}"] if absent else []
    if not event.options and deed[0].options is not None:
        return f"{reasons[0]}, and it had no options" if reasons else "which does not count without options"
    if len(deed) > 1:
        return ", and ".join([*reasons, f"none of its options ({_options(event)}) will do"])
    if not absent and deed[0].options is not None:
        wanted = with_texts(deed[0].options)
        is_one = f"has {wanted.removeprefix('with ')}" if wanted.startswith("with ") else f"is one {wanted}"
        return f"but none of its options ({_options(event)}) {is_one}"
    return reasons[0]


def _options(event: Event) -> str:
    names = [quoted(option.text) for option in event.options]
    return listed(names if len(names) <= _MOST else [*names[:_MOST], f"{len(names) - _MOST:,} more"])


def _destination(text: Text, anywhere: str) -> str:
    if is_any(text):
        return anywhere
    match text:
        case Regex(pattern):
            return f"to {room(pattern)}"
        case Without(pattern):
            return (
                f"{anywhere} but to {room(pattern)}"
                if anywhere == "anywhere"
                else f"elsewhere than to {room(pattern)}"
            )
        case _:
            return f"to a room {with_texts(text)}"


def _thing(text: Text, thing: str) -> str:
    match text:
        case Regex(pattern) if names := literals(pattern):
            return f'"{either(names)}"'
        case _:
            return f"{thing} {with_texts(text)}".rstrip()


def _mentioned(deed: Deed, form: Form, verb: str) -> str:
    """A text in a question or in its options."""
    wanted = with_texts(_wanted(deed))
    if wanted.startswith("with "):
        return f"{_MENTION[form]} {wanted.removeprefix('with ')} in a question or its options"
    return f"{verb} a question or offer{'ed' if form == 'past' else ''} an option {wanted}"


def _wanted(deed: Deed) -> Text:
    options = deed[0].options
    return options if options is not None and is_any(deed[0].text) else deed[0].text


def _question(element: EventPattern, question: str) -> str:
    text, options = element.text, element.options
    offered = "" if options is None or is_any(options) else f"with an option {with_texts(options)}"
    if is_any(text):
        return f"{question} {offered}".rstrip()
    return f"{_topic(text, question)} {offered}".rstrip()


def _topic(text: Text, question: str) -> str:
    match text:
        case Regex(pattern) if names := literals(pattern):
            return f"about {either(names)}"
        case _:
            return f"{question} {with_texts(text)}"
