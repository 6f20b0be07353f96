"""Texts in which the regexes of formulas are found, or not found: what a program could say, ask or visit.

They are spelled out from the parsed regex, put together in many ways, and each is tried. Where none is found
there may still be one, so "no text was found" is as much as can be said.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from itertools import chain, combinations, islice, permutations, product
from random import Random
from typing import Any

from codebotler.rtl import Regex, Text, Without, Words

_MOST_SAMPLES = 4
_MOST_SUBSETS = 400
_LONGEST = 10_000


@cache
def representative_texts(wanted: tuple[Text, ...]) -> tuple[str, ...]:
    """Texts that match in different combinations; one, and a short one, for each combination that was found.

    Args:
        wanted: what the texts are to be told apart by.
    """
    found: dict[tuple[bool, ...], str] = {}
    for candidate in _candidates(wanted):
        found.setdefault(tuple([text.matches(candidate) for text in wanted]), candidate)
    return tuple(found.values())


@cache
def can_match(text: Text) -> bool:
    """Whether a text was found that matches.

    Args:
        text: what it is to match.
    """
    return any(text.matches(candidate) for candidate in _candidates((text,)))


@cache
def _candidates(texts: tuple[Text, ...]) -> tuple[str, ...]:
    groups = [
        group
        for pattern in dict.fromkeys(chain.from_iterable(map(patterns, texts)))
        for group in (samples(pattern), _forbidden(pattern))
        if group
    ]
    words = [*dict.fromkeys(chain.from_iterable(groups))]
    whole = [word for word in words if word]
    hidden = [f"x{word}x" for word in whole]
    pairs = (f"{one} {other}" for one, other in product([*whole, *hidden], repeat=2))
    sizes = range(3, len(groups) + 1)
    subsets = chain.from_iterable(
        combinations([group[0] for group in groups], size) for size in reversed(sizes)
    )
    several = (
        " ".join(order) for subset in islice(subsets, _MOST_SUBSETS) for order in (subset, subset[::-1])
    )
    joined = chain.from_iterable(_joined(text.parts) for text in texts if isinstance(text, Words))
    spaced = (form for word in whole for form in (f"x {word}", f"{word} x"))
    every = chain(["", "x"], words, hidden, spaced, pairs, several, joined)
    return tuple(dict.fromkeys(text for text in every if text == text.strip()))


def _joined(parts: Sequence[Text]) -> Iterator[str]:
    """Texts made of a sample for each part, in several orders."""
    groups = [
        [word for pattern in patterns(part) for word in samples(pattern)] or [""]
        for part in parts
        if not isinstance(part, Without)
    ]
    for order in islice(permutations(groups), 24):
        for choice in islice(product(*order), 64):
            yield from (joint.join(filter(None, choice)) for joint in (" ", "", "x"))


def patterns(text: Text) -> Iterator[str]:
    """The regexes in a text of RTL."""
    match text:
        case Words(parts):
            for part in parts:
                yield from patterns(part)
        case Regex(pattern) | Without(pattern):
            yield pattern


@cache
def samples(pattern: str) -> tuple[str, ...]:
    """Texts without spaces at their ends in which a regex is found; none where none was thought of.

    Args:
        pattern: the regex.
    """
    matches = Regex(pattern).matches
    spelled = _spelled(_parsed(pattern))
    forms = (form.format(word).strip() for form in ("{}", "x {}", "x {} x", "x{}x") for word in spelled)
    found = dict.fromkeys(form for form in forms if matches(form))
    return tuple(islice(found or _guessed(pattern), _MOST_SAMPLES))


def _guessed(pattern: str) -> Iterator[str]:
    random, letters = Random(pattern), f"{pattern}x1 "  # noqa: S311 - no secret
    guesses = ("".join(random.choices(letters, k=random.randint(0, 8))).strip() for _ in range(3_000))
    return (guess for guess in guesses if Regex(pattern).matches(guess))


def _forbidden(pattern: str) -> tuple[str, ...]:
    """What stands in the negative lookaheads of a regex: what a text must hold not to match."""
    inner = (value[1] for op, value in _parsed(pattern) if str(op) == "ASSERT_NOT")
    return tuple(word.strip() for items in inner for word in _spelled(items) if word.strip())


def _parsed(pattern: str) -> Any:  # noqa: ANN401 - the tree of a private module of Python's
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        return import_module("re._parser").parse(pattern, re.IGNORECASE | re.DOTALL)


def _spelled(items: Any) -> list[str]:  # noqa: ANN401 - the same
    texts = [""]
    for op, value in items:
        parts = _spelled_one(str(op), value)
        texts = [*dict.fromkeys(text + part for part in parts for text in texts)][: 4 * _MOST_SAMPLES]
    return texts


def _spelled_one(op: str, value: Any) -> list[str]:  # noqa: ANN401, PLR0911 - the same, one for each node
    match op:
        case "LITERAL":
            return [chr(value)]
        case "NOT_LITERAL":
            return ["a" if value != ord("a") else "b"]
        case "ANY":
            return ["a"]
        case "IN":
            return _spelled_set(value)
        case "BRANCH":
            return [text for branch in value[1] for text in _spelled(branch)[:_MOST_SAMPLES]]
        case "SUBPATTERN" | "ASSERT":
            return _spelled(value[-1])
        case "ATOMIC_GROUP":
            return _spelled(value)
        case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
            least, _, items = value
            repeated = [text * max(least, 1) for text in _spelled(items) if len(text) * least <= _LONGEST]
            return repeated if least else ["", *repeated]
    return [""]


def _spelled_set(members: Any) -> list[str]:  # noqa: ANN401 - the same
    ends = [end for op, value in members for end in _ends(str(op), value)]
    return [char for char in dict.fromkeys([*ends, *"a1 _-.'z"]) if _is_in(char, members)][:_MOST_SAMPLES]


def _ends(op: str, value: Any) -> list[str]:  # noqa: ANN401 - the same
    return [chr(value)] if op == "LITERAL" else [*map(chr, value)] if op == "RANGE" else []


def _is_in(char: str, members: Any) -> bool:  # noqa: ANN401 - the same
    found = negated = False
    for op, value in members:
        match str(op):
            case "NEGATE":
                negated = True
            case "LITERAL":
                found = found or ord(char) == value
            case "RANGE":
                found = found or value[0] <= ord(char) <= value[1]
            case _:
                found = found or re.match(_CATEGORIES.get(str(value), "."), char) is not None
    return found != negated


_CATEGORIES = {
    "CATEGORY_DIGIT": r"\d",
    "CATEGORY_NOT_DIGIT": r"\D",
    "CATEGORY_SPACE": r"\s",
    "CATEGORY_NOT_SPACE": r"\S",
    "CATEGORY_WORD": r"\w",
    "CATEGORY_NOT_WORD": r"\W",
}
