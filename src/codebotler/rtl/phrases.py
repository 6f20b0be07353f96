"""Texts that a formula wants, and those that are there, in English."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from codebotler.core.words import listed
from codebotler.rtl.choice import PLAIN, choices
from codebotler.rtl.formula import Regex, Text, Without, Words
from codebotler.rtl.pattern import compile_regex
from codebotler.rtl.text.claims import Claim, Number, Time

if TYPE_CHECKING:
    from collections.abc import Iterable

_END_OF_WORD = r"\b"
_SHOWN = 70


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
    return f'"{either(names)}"' if names else _pattern(pattern)


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
                return [f'not starting with "{either(literals(start.removesuffix(_END_OF_WORD)))}"']
            return [
                f"with {named}" if (named := _named(pattern)) else f"matching the pattern {_pattern(pattern)}"
            ]
        case Number() | Time() | Claim():
            return [f"that {_claimed(text, does=False)}"]


def _named(pattern: str) -> str:
    phrases = [place.format(either(texts)) for place, texts in choices(pattern).items()]
    return listed(phrases, "or")


def _word(pattern: str) -> str:
    names = literals(pattern)
    return f'the word "{either(names)}"' if names else f"words matching the pattern {_pattern(pattern)}"


def _pattern(pattern: str) -> str:
    return f"/{_cut(pattern)}/"


def either(texts: Iterable[str]) -> str:
    """A choice between texts: `5, 6 or seven`.

    Args:
        texts: any texts, shortened to fit.
    """
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
