"""Texts in which the regexes of formulas are found, or not found: what a program could say, ask or visit.

They are spelled out from the parsed regex, put together in many ways, and each is tried. Where none is found
there may still be one, so "no text was found" is as much as can be said.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import import_module
from itertools import chain, combinations, islice, permutations, product, zip_longest
from random import Random
from typing import Any

from codebotler.rtl import Claim, Number, Regex, Text, Time, Without, Words
from codebotler.simulator.robot import found_in
from codebotler.unwarned import unwarned

_MOST_SAMPLES = 4
_MOST_SUBSETS = 400
_MOST_ALIKE = 2
_LONGEST = 10_000


@cache
def representative_texts(wanted: tuple[Text, ...], *, outer: bool = False) -> tuple[str, ...]:
    """Texts that match in different combinations; one, and a short one, for each combination that was found.

    Args:
        wanted: what the texts are to be told apart by.
        outer: whether they may begin or end with spaces, as options may and texts of events may not.
    """
    found: dict[tuple[bool, ...], str] = {}
    for candidate in _candidates(wanted, outer=outer):
        found.setdefault(tuple([text.matches(candidate) for text in wanted]), candidate)
    return tuple(found.values())


@cache
def can_match(text: Text, *, outer: bool = False) -> bool:
    """Whether a text was found that matches.

    Args:
        text: what it is to match.
        outer: whether the text that was found may begin or end with spaces.
    """
    return any(text.matches(candidate) for candidate in _candidates((text,), outer=outer))


@cache
def _candidates(texts: tuple[Text, ...], *, outer: bool) -> tuple[str, ...]:
    groups = [
        group
        for pattern in dict.fromkeys(chain.from_iterable(map(patterns, texts)))
        for group in (samples(pattern, outer=outer), _forbidden(pattern))
        if group
    ]
    claims = [*dict.fromkeys(chain.from_iterable(map(claimed, texts)))]
    words = [*dict.fromkeys([*chain.from_iterable(groups), *claims])]
    whole = [word for word in words if word]
    hidden = [f"x{word}x" for word in whole]
    paired = _told_apart(whole, texts)
    pairs = (
        f"{one} {other}" for one, other in product([*paired, *(f"x{word}x" for word in paired)], repeat=2)
    )
    sizes = range(3, len(groups) + 1)
    subsets = chain.from_iterable(
        combinations([group[0] for group in groups], size) for size in reversed(sizes)
    )
    several = (
        " ".join(order) for subset in islice(subsets, _MOST_SUBSETS) for order in (subset, subset[::-1])
    )
    joined = chain.from_iterable(
        _joined(text.parts, outer=outer) for text in texts if isinstance(text, Words)
    )
    spaced = (form for word in whole for form in (f"x {word}", f"{word} x"))
    wide = (form for word in words for form in (f" {word}", f"{word} ", f" {word} "))
    every = chain(["", "x"], words, hidden, spaced, pairs, several, joined, wide)
    return tuple(dict.fromkeys(text for text in every if outer or text == text.strip()))


def _told_apart(words: Iterable[str], texts: Sequence[Text]) -> list[str]:
    """Of words that match alike, the texts and all that stands in these, only a few."""
    regexes = (Regex(pattern) for text in texts for pattern in patterns(text))
    wanted = [*dict.fromkeys([*chain.from_iterable(map(_parts, texts)), *regexes])]
    alike: defaultdict[tuple[bool, ...], list[str]] = defaultdict(list)
    for word in words:
        alike[tuple([text.matches(word) for text in wanted])].append(word)
    return [word for several in alike.values() for word in several[:_MOST_ALIKE]]


def _parts(text: Text) -> Sequence[Text]:
    return text.parts if isinstance(text, Words) else (text,)


def _joined(parts: Sequence[Text], *, outer: bool) -> Iterator[str]:
    """Texts made of a sample for each part, in several orders."""
    groups = [
        [word for pattern in patterns(part) for word in samples(pattern, outer=outer)] or [""]
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
        case Regex(pattern) | Without(pattern) | Claim(pattern):
            yield pattern
        case Number(_, thing, others):
            yield from (thing, *others)
        case Time():
            return


def claimed(text: Text) -> Iterator[str]:
    """Texts that claim what a text of RTL is about, rightly or wrongly."""
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(claimed, parts))
        case Number(number, thing, _):
            for one, how_many in product(samples(thing), (number, number + 1)):
                yield f"{how_many} {one}"
        case Time(start, end):
            yield from (start, end, "03:07", f"{start} or 03:07")
        case Claim(pattern):
            for one in samples(pattern):
                yield from (f"there is {one}", f"there is no {one}")
        case Regex() | Without():
            return


def alternatives(pattern: str) -> list[str]:
    """A regex once for each of the words that it leaves the choice of, at its top or in a group.

    Args:
        pattern: the regex; alone in the answer where it leaves no choice, or refers back to a group.
    """
    if re.search(r"\\\d|\(\?P=|\(\?\(", pattern):
        return [pattern]
    branches = _branches(pattern)
    return [one for branch in branches for one in _without_choice(branch)]


def _branches(pattern: str) -> list[str]:
    """What stands between the bars outside of groups and sets."""
    pieces = re.findall(r"\\.|\[\^?\]?(?:\\.|[^\]\\])*\]|.", pattern, re.DOTALL)
    branches, depth = [""], 0
    for piece in pieces:
        depth += (piece == "(") - (piece == ")")
        if piece == "|" and depth == 0:
            branches.append("")
        else:
            branches[-1] += piece
    return branches if all(branches) else [pattern]


_CHOICE = re.compile(r"(?<!\\)\((?:\?:)?([\w' ]+(?:\|[\w' ]+)+)\)(?![?*+{])")


def _without_choice(pattern: str) -> list[str]:
    one_less = (
        pattern[: group.start()] + word + pattern[group.end() :]
        for group in _CHOICE.finditer(pattern)
        for word in group[1].split("|")
    )
    return [*one_less] or [pattern]


def spelled_out(pattern: str) -> Iterator[str]:
    """The plain texts in a regex, such as names, as they stand there.

    Args:
        pattern: the regex.
    """
    yield from _literals(parsed(pattern))


def _literals(items: Any) -> Iterator[str]:  # noqa: ANN401 - the tree of a private module of Python's
    text = ""
    for op, value in items:
        if str(op) == "LITERAL":
            text += chr(value)
            continue
        yield text
        text = ""
        for inner in inner_parts(str(op), value):
            yield from _literals(inner)
    yield text


def inner_parts(op: str, value: Any) -> list[Any]:  # noqa: ANN401 - the same
    """The parts within one node of the tree of a regex."""
    match op:
        case "BRANCH":
            return list(value[1])
        case "SUBPATTERN" | "ASSERT" | "ASSERT_NOT":
            return [value[-1]]
        case "ATOMIC_GROUP":
            return [value]
        case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
            return [value[2]]
    return []


def is_among(pattern: str, labels: Iterable[str]) -> bool:
    """Whether something may be meant by a regex; true also of one that means anything, or nothing.

    Args:
        pattern: the regex.
        labels: what things are called.
    """
    wanted = Regex(pattern)
    texts = samples(pattern)
    return (
        not texts
        or wanted.matches("")
        or any(wanted.matches(label) or any(found_in(label, text) for text in texts) for label in labels)
    )


@cache
def samples(pattern: str, *, outer: bool = False) -> tuple[str, ...]:
    """Texts in which a regex is found; none where none was thought of.

    Args:
        pattern: the regex.
        outer: whether they may begin or end with spaces.
    """
    matches = Regex(pattern).matches
    texts = _spelled_in_all_ways(parsed(pattern))
    whole = [form.replace("{}", word) for form in ("{}", "x {}", "x {} x", "x{}x") for word in texts]
    forms = [*(form.strip() for form in whole), *(whole if outer else ())]
    found = dict.fromkeys(form for form in forms if matches(form))
    return tuple(islice(found or _guessed(pattern, outer=outer), _MOST_SAMPLES))


def _guessed(pattern: str, *, outer: bool) -> Iterator[str]:
    random, letters = Random(pattern), f"{pattern}x1 "  # noqa: S311 - no secret
    drawn = ("".join(random.choices(letters, k=random.randint(0, 8))) for _ in range(3_000))
    guesses = (guess if outer else guess.strip() for guess in drawn)
    return (guess for guess in guesses if Regex(pattern).matches(guess))


def _forbidden(pattern: str) -> tuple[str, ...]:
    """What stands in the negative lookaheads of a regex: what a text must hold not to match."""
    inner = (value[1] for op, value in parsed(pattern) if str(op) == "ASSERT_NOT")
    words = (word.strip() for items in inner for word in _spelled_in_all_ways(items)[: 4 * _MOST_SAMPLES])
    return tuple(dict.fromkeys(word for word in words if word))


def parsed(pattern: str) -> Any:  # noqa: ANN401 - the tree of a private module of Python's
    """The tree of a regex, as Python parses it."""
    with unwarned():
        return import_module("re._parser").parse(pattern, re.IGNORECASE | re.DOTALL)


def _spelled_in_all_ways(items: Any) -> list[str]:  # noqa: ANN401 - the same
    """Spelled close together and apart, and with what is looked ahead for behind all else."""
    behind = sorted(items, key=lambda item: str(item[0]) == "ASSERT")
    ways = zip_longest(spelled(items), spelled(items, " "), spelled(behind, " "))
    return [*dict.fromkeys(text for way in ways for text in way if text is not None)]


def spelled(items: Any, gap: str = "") -> list[str]:  # noqa: ANN401 - the same
    """Some texts for which a part of a regex stands.

    Args:
        items: the part, as `parsed` tells it.
        gap: what stands where anything may.
    """
    texts = [""]
    for op, value in items:
        parts = _spelled_one(str(op), value, gap)
        texts = [*dict.fromkeys(text + part for part in parts for text in texts)][: 4 * _MOST_SAMPLES]
    return texts


def _spelled_one(op: str, value: Any, gap: str) -> list[str]:  # noqa: ANN401, PLR0911 - one for each node
    match op:
        case "LITERAL":
            return [chr(value)]
        case "NOT_LITERAL":
            return [char for char in (*gap, "a", "b") if ord(char) != value][:1]
        case "ANY":
            return [gap or "a"]
        case "IN":
            return _spelled_set(value, gap)
        case "BRANCH":
            return [text for branch in value[1] for text in spelled(branch, gap)[:_MOST_SAMPLES]]
        case "SUBPATTERN":
            return spelled(value[-1], gap)
        case "ASSERT":
            return [text + gap for text in spelled(value[-1], gap)]
        case "ATOMIC_GROUP":
            return spelled(value, gap)
        case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
            least, _, items = value
            repeated = [text * max(least, 1) for text in spelled(items, gap) if len(text) * least <= _LONGEST]
            none = [] if least else [""]
            return [*repeated, *none] if gap else [*none, *repeated]
    return [""]


def _spelled_set(members: Any, gap: str) -> list[str]:  # noqa: ANN401 - the same
    ends = [end for op, value in members for end in _ends(str(op), value)]
    return [char for char in dict.fromkeys([*gap, *ends, *"a1 _-.'z"]) if _is_in(char, members)][
        :_MOST_SAMPLES
    ]


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
