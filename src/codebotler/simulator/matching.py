"""Find out which rooms, things and people of a world a request means."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Literal, TypeAlias

from codebotler.core.regex_flags import scope_flags

Matching: TypeAlias = Literal["label-in-request", "whole-words", "longest-name"]
"""How requests refer to labels.

- `label-in-request`: the first label that matches anywhere in the request, as in the paper.
- `whole-words`: the first one that matches whole words of it, in the singular or plural.
- `longest-name`: the label that equals it, else the one that matches most of its words.
"""

WORDS_FOR_PEOPLE = (
    *("person", "people", "human", "someone", "somebody", "anyone", "anybody", "everyone", "everybody"),
    *("visitor", "guest", "employee", "colleague", "coworker", "occupant"),
)
_FILLERS = frozenset(
    {
        *("a", "an", "the", "any", "some", "all", "another", "other", "being", "there", "here"),
        *("who", "that", "is", "are", "in", "with", "wearing", "and"),
    }
)
"""Words of a description that tell nothing about a person or thing."""


def is_in_request(label: str, request: str) -> bool:
    """Return whether a world's label, which is a regex, matches in a program's request."""
    return _pattern(label).search(request) is not None


def finds(request: str, label: str, matching: Matching) -> bool:
    """Return whether a world's label, which is a regex, matches in a program's request or equals it."""
    pattern = label if matching == "label-in-request" else whole_words(label)
    return is_in_request(pattern, request) or request.lower() == label.lower()


@lru_cache(maxsize=4096)
def whole_words(label: str) -> str:
    """Return a regex that matches a label as whole words only, in the singular or the plural."""
    return rf"(?<!\w)(?:{_anchored(scope_flags(label))})(?:e?s)?(?!\w)"


@lru_cache(maxsize=4096)
def _pattern(label: str) -> re.Pattern[str]:
    return re.compile(_anchored(label), re.IGNORECASE | re.DOTALL)


_ANYTHING_FIRST = re.compile(r"(?:^|(?<=(?<!\\)\|))\.\*")


def _anchored(label: str) -> str:
    """Anchor alternatives with a leading `.*` to the start, so that a label matches in linear time.

    The label matches the same requests, since `.*` can match everything before the rest of the alternative.
    """
    return label if set("([") & set(label) else _ANYTHING_FIRST.sub(r"^.*", label)


_WORD = re.compile(r"[\w'\u2019-]+")


def meant_by(request: str, labels: Iterable[str], *, plain: bool = False) -> list[str]:
    """Return the label that equals a request, else those that match most of its words, as whole words.

    Args:
        request: the words of a program.
        labels: regexes, as in world files.
        plain: whether the labels are plain names instead.
    """
    labels = tuple(labels)
    return [*_meant_by(request, labels, tuple(map(_escaped, labels)) if plain else labels)]


@lru_cache(maxsize=4096)
def _escaped(label: str) -> str:
    return r"\s+".join(map(re.escape, label.split()))


@lru_cache(maxsize=65_536)
def _meant_by(request: str, labels: tuple[str, ...], regexes: tuple[str, ...]) -> tuple[str, ...]:
    request = " ".join(request.split())
    same = tuple(label for label in labels if " ".join(label.casefold().split()) == request.casefold() != "")
    if same:
        return same[:1]
    words = [_matched_words(request, regex) for regex in regexes]
    return tuple(label for label, count in zip(labels, words, strict=True) if count == max(words) > 0)


def _matched_words(request: str, regex: str) -> int:
    """Return how many words of a request a regex matches at most."""
    found = _pattern(whole_words(regex)).finditer(request)
    return max((len(_WORD.findall(match[0])) or 1 for match in found if match[0].strip()), default=0)


def resolve_room(rooms: Sequence[str], request: str, matching: Matching = "label-in-request") -> str | None:
    """Return the room that a request means, or None if it means none or could mean several."""
    return _resolve_room(tuple(rooms), request, matching)


@lru_cache(maxsize=65_536)
def _resolve_room(rooms: tuple[str, ...], request: str, matching: Matching) -> str | None:
    if matching == "longest-name":
        meant = meant_by(request, rooms)
        return meant[0] if len(meant) == 1 else None
    if matching == "whole-words" and request in rooms:
        return request
    return next((room for room in rooms if finds(request, room, matching)), None)


def means_anybody(request: str, words_for_people: Sequence[str] = WORDS_FOR_PEOPLE) -> bool:
    """Return whether a request consists of words for people only, so that any person is meant."""
    return all(
        any(_pattern(whole_words(any_one)).fullmatch(word) for any_one in words_for_people)
        for word in content_words(request)
    )


def content_words(request: str) -> list[str]:
    """Return the words of a description without articles and the like, in lower case."""
    return [word for word in _WORD.findall(request.casefold()) if word not in _FILLERS]
