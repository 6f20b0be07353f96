"""Texts, elements and events of RTL in English, for explanations."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal, TypeAlias

from codebotler.rtl.choice import PLAIN, choices
from codebotler.rtl.claims import Claim, Number, Time
from codebotler.rtl.formula import Element, Regex, Text, Without, Words
from codebotler.rtl.pattern import compile_regex

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from codebotler.trace import Event

Form: TypeAlias = Literal["base", "past", "ing"]
Deed: TypeAlias = tuple[Element, ...]
"""What one robot may do: any of these elements. Two of them are one text, in a question or in its options."""

# The kinds of the paper read best with verbs of their own; further skills are told by their names.
_VERBS: dict[str, dict[Form, str]] = {
    "goto": {"base": "go", "past": "went", "ing": "going"},
    "say": {"base": "say", "past": "said", "ing": "saying"},
    "ask": {"base": "ask", "past": "asked", "ing": "asking"},
    "check": {"base": "look for", "past": "looked for", "ing": "looking for"},
    "pick": {"base": "pick up", "past": "picked up", "ing": "picking up"},
    "place": {"base": "put down", "past": "put down", "ing": "putting down"},
}
_OTHER_VERB: dict[Form, str] = {"base": "do", "past": "did", "ing": "doing"}
_MENTION: dict[Form, str] = {"base": "mention", "past": "mentioned", "ing": "mentioning"}
_PASTIMES = {
    "say": "spoke",
    "ask": "asked something",
    "check": "looked around",
    "pick": "picked something up",
    "place": "put something down",
}
_END_OF_WORD = r"\b"
_SHOWN = 70
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
    verb = _VERBS.get(element.kind, _OTHER_VERB)[form]
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
            return f"{verb} {_destination(element.text, 'anywhere' if never else 'somewhere')}"
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
    verb = _VERBS.get(event.kind, _OTHER_VERB)[form]
    if event.kind == "goto":
        return f"{verb} to {room_name(event.text)}"
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
    return listed([_PASTIMES.get(kind, f"did a {kind}") for kind in kinds])


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


def lacks(text: Text, actual: str) -> list[str]:
    """What keeps a text from matching: `lacks "good"`, `has the word "no"`.

    Args:
        text: what it should match.
        actual: the text.
    """
    match text:
        case Words(parts):
            absent = [lack for part in parts for lack in lacks(part, actual)]
            return _merged(absent, "lacks ")
        case Without():
            return [f"has the word {quoted(found[0])}"] if (found := text.compiled.search(actual)) else []
        case Regex(pattern):
            if text.matches(actual):
                return []
            if (start := _forbidden_start(pattern)) and (found := compile_regex(start).match(actual)):
                return [f"starts with {quoted(found[0])}"]
            return [f"lacks {named}" if (named := _named(pattern)) else f"does not match {_pattern(pattern)}"]
        case Number() | Time() | Claim():
            return [] if text.matches(actual) else [f"does not {_claimed(text, does=True)}"]


def _claimed(text: Number | Time | Claim, *, does: bool) -> str:
    """What a text claims, after `does not` or after `that`."""
    ending = "" if does else "s"
    match text:
        case Number(number, thing, _, other):
            given = f"another number than {number} for" if other else f"{number} as the number of"
            return f"give{ending} {given} {_plainly(thing)}"
        case Time(start, end, other):
            return f"name{ending} a time {'not ' * other}from {start} to {end}"
        case Claim(pattern, denied):
            verb = ("deny" if does else "denies") if denied else f"affirm{ending}"
            return f"{verb} something of {_plainly(pattern)}"


def _plainly(pattern: str) -> str:
    names = literals(pattern)
    return f'"{_either(names)}"' if names else _pattern(pattern)


def missing(text: Text, actual: str) -> int:
    """How many parts of a text do not match.

    Args:
        text: what should match.
        actual: the text.
    """
    if isinstance(text, Words):
        return sum(missing(part, actual) for part in text.parts)
    return int(not text.matches(actual))


def with_texts(text: Text) -> str:
    """A text as an attribute, such as `with "5 or five" and "lobby"`; empty where any text will do.

    Args:
        text: what is to be matched.
    """
    return listed(_merged(_qualities(text), "with "))


def room(pattern: str) -> str:
    """A place as a formula names it, such as `the lobby` or `bob's office`.

    Args:
        pattern: the regex.
    """
    names = literals(pattern)
    if not names:
        return f"a room matching the pattern {_pattern(pattern)}"
    return listed([room_name(name) for name in names], "or")


def room_name(name: str) -> str:
    """A room, with an article where its name is a common noun.

    Args:
        name: as the robot was told.
    """
    short = shortened(name)
    return f"the {short}" if re.fullmatch(r"(?!the |an? )[a-z]+( [a-z]+)*", name) else short or '""'


def quoted(text: str) -> str:
    """A text in quotes, shortened to fit into a sentence.

    Args:
        text: any text.
    """
    return f'"{shortened(text)}"'


def shortened(text: str) -> str:
    """A text on one line, cut off where it is too long for a sentence.

    Args:
        text: any text.
    """
    return _cut(" ".join(text.split()))


def _cut(text: str) -> str:
    return text if len(text) <= _SHOWN else text[: _SHOWN - 1].rstrip() + "…"


def listed(parts: Sequence[str], last: str = "and") -> str:
    """An enumeration: `a, b and c`.

    Args:
        parts: what to enumerate.
        last: the word before the last part.
    """
    if len(parts) <= 1:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def times(number: int) -> str:
    """How often: `once`, `twice`, `3 times`.

    Args:
        number: 0 or more.
    """
    return {0: "not at all", 1: "once", 2: "twice"}.get(number, f"{number:,} times")


def is_any(text: Text) -> bool:
    """Whether every text matches.

    Args:
        text: what is to be matched.
    """
    match text:
        case Words(parts):
            return all(map(is_any, parts))
        case Regex(pattern):
            return pattern in {"", ".*", "^.*$"}
        case Without() | Number() | Time() | Claim():
            return False


def literals(pattern: str) -> list[str]:
    """The plain texts between which a regex chooses; none if it is more than such a choice.

    Args:
        pattern: the regex.
    """
    found = choices(pattern)
    return [*found[PLAIN]] if [*found] == [PLAIN] else []


def _qualities(text: Text) -> list[str]:
    match text:
        case Words(parts):
            return [quality for part in parts for quality in _qualities(part)]
        case Without(pattern):
            return [f"without {_word(pattern)}"]
        case Regex(pattern):
            if is_any(text):
                return []
            if start := _forbidden_start(pattern):
                return [f'not starting with "{_either(literals(start.removesuffix(_END_OF_WORD)))}"']
            return [
                f"with {named}" if (named := _named(pattern)) else f"matching the pattern {_pattern(pattern)}"
            ]
        case Number() | Time() | Claim():
            return [f"that {_claimed(text, does=False)}"]


def _named(pattern: str) -> str:
    phrases = [place.format(_either(texts)) for place, texts in choices(pattern).items()]
    return listed(phrases, "or")


def _word(pattern: str) -> str:
    names = literals(pattern)
    return f'the word "{_either(names)}"' if names else f"words matching the pattern {_pattern(pattern)}"


def _pattern(pattern: str) -> str:
    return f"/{_cut(pattern)}/"


def _either(texts: Iterable[str]) -> str:
    return listed([*map(_cut, texts)], "or")


def _forbidden_start(pattern: str) -> str:
    """What a text must not start with, as a regex, where a pattern says nothing else."""
    inner = re.fullmatch(r"\^\(\?!((.*)\\b)\)", pattern)
    return inner[1] if inner and literals(inner[2]) else ""


def _merged(parts: list[str], head: str) -> list[str]:
    """The same parts with those that begin with one word in front, told as one enumeration."""
    same = [part.removeprefix(head) for part in parts if part.startswith(head)]
    others = [part for part in parts if not part.startswith(head)]
    return [head + listed(same), *others] if same else others


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
            return f'"{_either(names)}"'
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


def _question(element: Element, question: str) -> str:
    text, options = element.text, element.options
    offered = "" if options is None or is_any(options) else f"with an option {with_texts(options)}"
    if is_any(text):
        return f"{question} {offered}".rstrip()
    return f"{_topic(text, question)} {offered}".rstrip()


def _topic(text: Text, question: str) -> str:
    match text:
        case Regex(pattern) if names := literals(pattern):
            return f"about {_either(names)}"
        case _:
            return f"{question} {with_texts(text)}"
