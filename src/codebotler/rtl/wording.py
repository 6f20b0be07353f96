"""Describe event patterns and events in English, for explanations."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import chain

from codebotler.core.skills.kinds import CHECK, GOTO, INSIDE
from codebotler.core.skills.verbs import VerbForm
from codebotler.core.text.phrases import is_spoken, phrase, verb
from codebotler.core.text.words import brief, elide_list, listed
from codebotler.core.trace import Event
from codebotler.rtl.formulas import EventPattern, Regex, TextPattern, Without, Words
from codebotler.rtl.regex_words import MATCH_ALL_PATTERNS, choices, one_of
from codebotler.rtl.text.claims import Claim, Number, Time

_LOOKS: Mapping[bool, Mapping[VerbForm, str]] = {
    True: {"base": "find", "past": "found", "ing": "finding"},
    False: {"base": "look in vain for", "past": "looked in vain for", "ing": "looking in vain for"},
}
_MENTIONS: Mapping[VerbForm, str] = {"base": "mention", "past": "mentioned", "ing": "mentioning"}
_ANSWERS: Mapping[VerbForm, str] = {"base": "get", "past": "got", "ing": "getting"}
_CLAUSES = ("that ", "to ", "whether ", "what ", "in one ")
_UNCLEAR = "that fits the requirement"  # for a regex whose words cannot be determined


def describe_action(
    element: EventPattern, form: VerbForm, *, negated: bool = False, when: str = "", where: str = ""
) -> str:
    """Describe what an event must do, such as `said something with "hello"`.

    Args:
        element: the pattern that an event must match.
        form: the form of the verb: `base`, `past` or `ing`.
        negated: whether the phrase follows a negation, and so needs `anything`.
        when: a phrase with a leading space; it comes before a clause such as `that nobody is in`.
        where: a phrase after that, such as ` after going to the lobby (step 1)`.
    """
    thing = "anything" if negated else "something"
    is_open = is_any(element.text) and is_any(element.options)
    means = None if is_open and element.answer is None else element.means
    if element.place is not None:
        when = f" in {room(Regex(element.place))}{when}"
    if means is not None and means.startswith(_CLAUSES):
        return f"{getattr(verb(element.kind), form)}{when}{where and f',{where},'} {means}"
    if means is not None and negated:
        means = re.sub("^something", "anything", means)
    if element.found is not None and element.kind == CHECK:
        done = f"{_LOOKS[element.found][form]} {means or _describe_object(element, thing)}"
    elif element.answer is not None:
        done = f"{_ANSWERS[form]} {means or _describe_thing(element.answer, 'an answer')}"
    elif means is not None:
        done = f"{getattr(verb(element.kind), form)} {means}"
    elif element.mention and not is_open:
        done = f"{_MENTIONS[form]} {_name_or_describe(element.text, thing)} in a question"
    else:
        doing = verb(element.kind)
        more = [_name_or_describe(text, thing) for text in element.more]
        wanted = [_describe_object(element, thing), *more, *[thing] * doing.object.count("{")]
        done = doing.with_object(getattr(doing, form), wanted, "")
    return f"{done.rstrip()}{_describe_details(element, means)}{when}{where}"


def _describe_details(element: EventPattern, means: str | None) -> str:
    more = ""
    if element.options is not None and means is None and not is_any(element.options):
        more += f" offering an option {describe_text(element.options)}"
    if element.found is not None and element.kind != CHECK:
        more += f' with the result "{verb(element.kind).results[element.found]}"'
    if element.to is not None:
        more += f" of somebody {describe_text(element.to)}".rstrip()
    if element.holding is not None:
        more += f" while holding something {describe_text(element.holding)}".rstrip()
    return more


def is_clear(element: EventPattern) -> bool:
    """Whether words can describe the whole pattern: no regex in the pattern is too complex for words."""
    texts = [element.text, element.options, element.answer, element.holding, element.to, *element.more]
    needed = texts[3:] if element.means is not None else texts
    if element.place is not None:
        needed.append(Regex(element.place))
    return all(text is None or _UNCLEAR not in _qualities(text) for text in needed)


def _describe_object(element: EventPattern, thing: str) -> str:
    if not element.has_text:
        return ""
    if element.kind in {GOTO, INSIDE}:
        return room(element.text, "any" if thing == "anything" else "a")
    describe = _describe_thing if is_spoken(element.kind) else _name_or_describe
    return describe(element.text, thing)


def _name_or_describe(text: TextPattern, thing: str) -> str:
    """Quote the texts that a regex finds, or describe the thing if they are unlimited or unknown."""
    names = _words_of(text.pattern) if isinstance(text, Regex) and not is_any(text) else ""
    return names or _describe_thing(text, thing)


def _describe_thing(text: TextPattern, thing: str) -> str:
    """Describe a thing by its text, such as `something with "hello"`, or a number or time on its own."""
    if isinstance(text, Number | Time):
        return describe_text(text).removeprefix("with ")
    return f"{thing} {describe_text(text)}".rstrip()


def _words_of(pattern: str) -> str:
    return one_of(choices(pattern) or ())


def describe_event(event: Event, element: EventPattern, form: VerbForm = "past") -> str:
    """Describe an event. Include its room, addressee and held object only if `element` compares them."""
    if event.kind in {GOTO, INSIDE}:
        done = f"{getattr(verb(event.kind), form)} {room_name(event.text)}"
    else:
        done = phrase(event, form)
    if element.to is not None:
        done += f" of {quoted(event.to or '')}"
    if element.holding is not None:
        done += f" while holding {quoted(event.holding) if event.holding else 'nothing'}"
    return f"{done} in {room_name(event.place)}" if element.place is not None and event.place else done


def room(text: TextPattern, article: str = "a") -> str:
    """Describe a room, such as `the lobby`, `bob's office` or `a room other than the lobby`."""
    match text:
        case Regex(pattern) | Without(pattern) if names := choices(pattern):
            rooms = listed(elide_list([*map(room_name, names)]), "or")
            return rooms if isinstance(text, Regex) else f"{article} room other than {rooms}"
    return f"{article} room {describe_text(text)}".rstrip()


def room_name(name: str) -> str:
    """Return the name of a room, with an article if it is a common noun."""
    short = brief(name)
    return f"the {short}" if re.fullmatch(r"(?!the |an? )[a-z]+( [a-z]+)*", short) else short or '""'


def describe_text(text: TextPattern) -> str:
    """Describe a text pattern, such as `with "5" and without "no"`, or return "" if any text matches."""
    return listed(elide_list([*dict.fromkeys(_qualities(text))]))


def _qualities(text: TextPattern) -> Iterator[str]:
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(_qualities, parts))
        case Regex(pattern):
            if not is_any(text):
                yield f"with {named}" if (named := _words_of(pattern)) else _UNCLEAR
        case Without(pattern):
            yield f"without {named}" if (named := _words_of(pattern)) else _UNCLEAR
        case Number(number, thing, _, other):
            things = choices(thing)
            of = f' for "{brief(things[0])}"' if things else ""
            yield f"with {'a number other than' if other else 'the number'} {number}{of}"
        case Time(start, end, other) if start == end:
            yield f"with {'a time other than' if other else 'the time'} {start}"
        case Time("0:00", "24:00", False):
            yield "with a time of day"
        case Time(start, end, other):
            yield f"with a time {'outside' if other else 'from'} {start} to {end}"
        case Claim(pattern, denied):
            does = "denies" if denied else "affirms"
            named = "something" if is_any(Regex(pattern)) else _words_of(pattern)
            yield f"that {does} {named}" if named else _UNCLEAR


def is_any(text: TextPattern | None) -> bool:
    """Whether there is no pattern, or a regex such as `.*` that matches every string."""
    return text is None or (isinstance(text, Regex) and text.pattern in MATCH_ALL_PATTERNS)


def quoted(text: str) -> str:
    """Put a string in quotes, on one line and shortened for a sentence."""
    return f'"{brief(text)}"'
