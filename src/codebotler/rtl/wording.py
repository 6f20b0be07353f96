"""Elements of formulas and events of a robot in English, for explanations."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

from codebotler.core import words
from codebotler.core.phrases import is_spoken, result_words, takes_nothing, verb
from codebotler.core.skills.kinds import CHECK, GOTO, INSIDE
from codebotler.core.skills.verbs import VerbForm
from codebotler.core.trace import Event
from codebotler.core.words import brief, listed
from codebotler.rtl.formulas import EventPattern, Regex, Text, Without, Words
from codebotler.rtl.regex_words import MATCH_ALL_PATTERNS, choices, one_of
from codebotler.rtl.text.claims import Claim, Number, Time

_LOOKS: Mapping[bool, Mapping[VerbForm, str]] = {
    True: {"base": "find", "past": "found", "ing": "finding"},
    False: {"base": "look in vain for", "past": "looked in vain for", "ing": "looking in vain for"},
}
_MENTIONS: Mapping[VerbForm, str] = {"base": "mention", "past": "mentioned", "ing": "mentioning"}
_OFFERS: Mapping[VerbForm, str] = {"base": "offer", "past": "offered", "ing": "offering"}
_ANSWERS: Mapping[VerbForm, str] = {"base": "get", "past": "got", "ing": "getting"}
_CLAUSES = ("that ", "to ", "whether ", "what ", "in one ")
_MOST_LISTED = 5
_UNCLEAR = "that fits the requirement"  # in the place of a regex that has no certain words


def deed(
    element: EventPattern, form: VerbForm, *, negated: bool = False, when: str = "", where: str = ""
) -> str:
    """What an element asks for, such as `said something with "hello"`; `anything` after a negation.

    Args:
        element: what an event must match.
        form: of the verb.
        negated: whether a negation comes before it.
        when: what follows, with a space at its start; it comes before a clause such as `that nobody is in`.
        where: what follows after that, such as ` after going to the lobby (step 1)`.
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
        done = f"{_LOOKS[element.found][form]} {means or _wanted(element, thing)}"
    elif element.answer is not None:
        answer = (
            f"the answer {named}" if (named := _named(element.answer)) else _like(element.answer, "an answer")
        )
        done = f"{_ANSWERS[form]} {means or answer}"
    elif means is not None:
        done = f"{getattr(verb(element.kind), form)} {means}"
    elif element.mention and not is_open:
        done = f"{_MENTIONS[form]} {_named(element.text) or _like(element.text, thing)} in a question"
    elif element.options is not None and is_any(element.text) and not is_open and element.offers is None:
        return f"{_OFFERS[form]} an option {described(element.options)}{when}{where}"
    elif verb(element.kind).object:
        doing = verb(element.kind)
        wanted = [_part(text, thing) for text in (element.text, *element.more)]
        done = doing.with_object(getattr(doing, form), [*wanted, *[thing] * doing.object.count("{")], "")
    else:
        done = f"{getattr(verb(element.kind), form)} {_wanted(element, thing)}"
    return f"{done.rstrip()}{_further(element, means)}{when}{where}"


def _further(element: EventPattern, means: str | None) -> str:
    """What else an event must be like, apart from its text."""
    more = ""
    if element.options is not None and means is None and not is_any(element.options):
        more += f" offering an option {described(element.options)}"
    if element.offers is not None:
        least, most = element.offers
        number = f"{least} or more" if most is None else f"{least} to {most}" if most > least else f"{least}"
        more += f" with {number} option{'s' * (number != '1')}"
    if element.more and not verb(element.kind).object:
        more += f", {listed([*filter(None, map(described, element.more))])}".rstrip(", ")
    if element.found is not None and element.kind != CHECK:
        more += f' with the result "{verb(element.kind).results[element.found]}"'
    if element.to is not None:
        more += f" of somebody {described(element.to)}".rstrip()
    if element.holding is not None:
        more += f" while holding something {described(element.holding)}".rstrip()
    return more


def is_plain(element: EventPattern) -> bool:
    """Whether what an event was says all that matters about it, so that no other words are needed."""
    if element.is_about_more or not isinstance(element.text, Regex):
        return False
    return (is_any(element.text) and is_any(element.options)) or not is_spoken(element.kind)


def is_clear(element: EventPattern) -> bool:
    """Whether all that an element asks for can be said in words."""
    texts = [element.text, element.options, element.answer, element.holding, element.to, *element.more]
    needed = texts[3:] if element.means is not None else texts
    if element.place is not None:
        needed.append(Regex(element.place))
    return all(text is None or _UNCLEAR not in _qualities(text) for text in needed)


def _part(text: Text, thing: str) -> str:
    """One of the things that a verb is done to, among other words."""
    named = _named(text)
    if isinstance(text, Regex) and named and text.pattern.startswith("^"):
        return named.strip('"')
    return named or _like(text, thing)


def _wanted(element: EventPattern, thing: str) -> str:
    if not element.has_text:
        return ""
    if element.kind in {GOTO, INSIDE}:
        return room(element.text, "any" if thing == "anything" else "a")
    named = "" if is_spoken(element.kind) else _named(element.text)
    return named or _like(element.text, thing)


def _like(text: Text, thing: str) -> str:
    """Something that is like a text, such as `something with "hello"`, or a number or time itself."""
    if isinstance(text, Number | Time):
        return described(text).removeprefix("with ")
    return f"{thing} {described(text)}".rstrip()


def _named(text: Text) -> str:
    """The plain texts that a regex finds, in quotes; empty if it finds any, or has no certain words."""
    return _words_of(text.pattern) if isinstance(text, Regex) and not is_any(text) else ""


def _words_of(pattern: str) -> str:
    return one_of(choices(pattern) or ())


def happening(event: Event, element: EventPattern) -> str:
    """The object of what the robot did, and whatever else an element compares."""
    doing = verb(event.kind)
    if doing.object:
        thing = doing.with_object("", [brief(text) for text in (event.text, *event.more)], "").strip()
    elif takes_nothing(event.kind):
        thing = ""
    else:
        thing = room_name(event.text) if event.kind in {GOTO, INSIDE} else quoted(event.text)
    thing += _offered(event, element)
    if element.answer is not None:
        thing += (
            " and got no answer" if event.answer is None else f" and got the answer {quoted(event.answer)}"
        )
    if event.more and not doing.object:
        thing += f", {', '.join(map(quoted, event.more))}"
    if element.found is not None and event.kind != CHECK:
        thing += f" ({result})" if (result := result_words(event)) else ""
    elif element.found is not None:
        thing += " in vain" if event.found is False else " and found it"
    if element.to is not None:
        thing += f" of {quoted(event.to or '')}"
    if element.holding is not None:
        thing += f" while holding {quoted(event.holding) if event.holding else 'nothing'}"
    return f"{thing} in {room_name(event.place)}" if element.place is not None and event.place else thing


def _offered(event: Event, element: EventPattern) -> str:
    """The options of a question, or their number, as far as an element compares them."""
    if event.options and (element.mention or not is_any(element.options)):
        return f" with the options {listed(few([quoted(option.text) for option in event.options]))}"
    return "" if element.offers is None else f" with {words.counted(len(event.options), 'option')}"


def room(text: Text, article: str = "a") -> str:
    """The room that a text names, such as `the lobby`, `bob's office` or `a room other than the lobby`."""
    match text:
        case Regex(pattern) | Without(pattern) if names := choices(pattern):
            rooms = listed(few([*map(room_name, names)]), "or")
            return rooms if isinstance(text, Regex) else f"{article} room other than {rooms}"
    return f"{article} room {described(text)}".rstrip()


def room_name(name: str) -> str:
    """The name of a room, with an article if it is a common noun."""
    short = brief(name)
    return f"the {short}" if re.fullmatch(r"(?!the |an? )[a-z]+( [a-z]+)*", short) else short or '""'


def described(text: Text) -> str:
    """What a text must be like, such as `with "5" or "five" and without "no"`; empty if any text matches."""
    return listed(few([*dict.fromkeys(_qualities(text))]))


def _qualities(text: Text) -> Iterator[str]:
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


def is_any(text: Text | None) -> bool:
    """Whether a text is written to match every string, or there is none."""
    return text is None or (isinstance(text, Regex) and text.pattern in MATCH_ALL_PATTERNS)


def few(parts: Sequence[str], most: int = _MOST_LISTED) -> list[str]:
    """The first parts of an enumeration, and how many more there are."""
    more = len(parts) - most
    return [*parts[:most], f"{more:,} more"] if more > 0 else [*parts]


def quoted(text: str) -> str:
    """A text in quotes, on one line and short enough for a sentence."""
    return f'"{brief(text)}"'
