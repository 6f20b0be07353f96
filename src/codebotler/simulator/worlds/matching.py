"""Find out which rooms, things and people of a world a request means."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

from codebotler.core.text.labels import scope_flags
from codebotler.core.world import Trait

Matching: TypeAlias = Literal["label-in-request", "whole-words", "longest-name"]
"""How requests refer to labels.

- `label-in-request`: the first label that matches anywhere in the request, as in the paper.
- `whole-words`: the first label that matches whole words of the request, in the singular or plural.
- `longest-name`: the label that equals the request, or else the one that matches most of its words.
"""

_ARTICLE = re.compile(r"^(?:the|an?|any|some)\s+")
SOMEBODY = "somebody"

WORDS_FOR_PEOPLE = (
    *("person", "people", "human", "someone", "somebody", "anyone", "anybody", "everyone", "everybody"),
    *("visitor", "guest", "employee", "colleague", "coworker", "occupant"),
)
WORDS_FOR_THINGS = ("thing", "object", "item")
_FILLERS = frozenset(
    {
        *("a", "an", "the", "any", "some", "all", "another", "other", "being", "there", "here"),
        *("who", "that", "is", "are", "in", "with", "wearing", "and"),
        *("named", "called", "of", "piece", "pieces"),
    }
)
"""Words of a description that say nothing about a person or thing."""


def is_in_request(label: str, request: str) -> bool:
    """Return whether a world's label, which is a regex, matches anywhere in a program's request."""
    return _pattern(label).search(request) is not None


def finds(request: str, label: str, matching: Matching) -> bool:
    """Return whether a label (a regex) equals a request or matches in it, under the suite's `matching`."""
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
    """Return the label that equals a request, or else those that match the largest number of its words.

    `labels` are regexes, as in world files, or plain names if `plain` is true.
    """
    labels = tuple(labels)
    return [*_meant_by(request, labels, tuple(map(_escaped, labels)) if plain else labels)]


def goals_meant(
    request: str, goals: Sequence[str], around: Mapping[str, str], *, plain: bool = False
) -> list[str]:
    """Return the rooms and places that a request may mean. "The desk in the office" means only the desk.

    `goals` are all rooms and places, as regexes or, if `plain`, names. `around` maps each place to its room.
    """
    if not around:
        return meant_by(request, goals, plain=plain)
    regex = _escaped if plain else str
    inside = {place: _IN.format(regex(place), regex(room)) for place, room in around.items()}
    named = [place for place, label in inside.items() if _longest_match(request, label)[0]]
    rooms = named or meant_by(request, goals, plain=plain)
    return [room for room in rooms if all(around.get(place) != room for place in rooms)]


_IN = r"(?:{})\s+(?:in|of|at|inside|within|from)\s+(?:the\s+|my\s+|our\s+)?(?:{})"


@lru_cache(maxsize=4096)
def _escaped(label: str) -> str:
    return r"\s+".join(map(re.escape, label.split()))


@lru_cache(maxsize=65_536)
def _meant_by(request: str, labels: tuple[str, ...], regexes: tuple[str, ...]) -> tuple[str, ...]:
    request = " ".join(request.split())
    same = tuple(label for label in labels if " ".join(label.casefold().split()) == request.casefold() != "")
    if same:
        return same[:1]
    words = [_longest_match(request, regex)[0] for regex in regexes]
    return tuple(label for label, count in zip(labels, words, strict=True) if count == max(words) > 0)


def _longest_match(request: str, regex: str) -> tuple[int, str]:
    """Return the number of words that a regex matches at most, and the words of the request beside them."""
    whole = rf"(?<!\w[-.'\u2019]){whole_words(regex)}(?![-.'\u2019]\w)"  # "room 2.1" is not room 2
    found = [match for match in _pattern(whole).finditer(request) if match[0].strip()]
    counts = [
        (len(_WORD.findall(one[0])) or 1, f"{request[: one.start()]} {request[one.end() :]}") for one in found
    ]
    return max(counts, default=(0, request), key=lambda each: each[0])


class Entity(NamedTuple):
    """A thing or person that a request may mean.

    Args:
        label: the regex that matches its names.
        traits: words that describe it, such as "red". If it has any, no request with other words means it.
    """

    label: str
    traits: frozenset[str] = frozenset()


def best_fits(request: str, entities: Sequence[Entity], anybody: Sequence[str] = ()) -> list[int]:
    """Return the positions of the entities that a request fits best.

    The result has several positions only if the request contains the names of several entities. If several
    fit only by their traits ("the tall person"), or have equal names, it has only the first one.

    `anybody` contains regexes for words that mean any of the entities, such as "person".
    """
    counts = [_fit(request, *entity, tuple(anybody)) for entity in entities]
    best = [number for number, count in enumerate(counts) if count == max(counts) > 0]
    named = {entities[n].label: n for n in reversed(best) if _longest_match(request, entities[n].label)[0]}
    return sorted(named.values()) or best[:1]


@lru_cache(maxsize=65_536)
def _fit(request: str, label: str, traits: frozenset[str], anybody: tuple[str, ...]) -> int:
    """Return how many words of a request fit an entity, or 0 if it is not meant."""
    request = " ".join(request.split())
    if request.casefold() == " ".join(label.casefold().split()) != "":
        return len(request)
    named, rest = _longest_match(request, label)
    if named and not traits:
        return named
    others = [word for word in content_words(rest) if not means_anybody(word, anybody)]
    if not all({word, word.removesuffix("s"), word.removesuffix("es")} & traits for word in others):
        return 0
    return named + len(others) or bool(anybody and rest.strip())


def trait_words(traits: Iterable[Trait]) -> frozenset[str]:
    """Return the words that describe a thing or person: "red" for `color: red`, "wet" for `wet: true`."""
    words = [key if value is True else value for key, value in traits if value is not False]
    texts = [text for one in words for text in (one if isinstance(one, tuple) else (str(one),))]
    return frozenset(word for text in texts for word in content_words(text))


@lru_cache(maxsize=65_536)
def resolve_room(rooms: tuple[str, ...], request: str, matching: Matching) -> str | None:
    """Return the room that a request means, or None if it means none or could mean several."""
    if matching == "longest-name":
        meant = meant_by(request, rooms)
        return meant[0] if len(meant) == 1 else None
    if matching == "whole-words" and request in rooms:
        return request
    return next((room for room in rooms if finds(request, room, matching)), None)


def means_anybody(request: str, words_for_people: Sequence[str] = WORDS_FOR_PEOPLE) -> bool:
    """Return whether a request consists of words for people only, so that any person is meant."""
    patterns = [_pattern(whole_words(regex)) for regex in words_for_people]
    return all(any(pattern.fullmatch(word) for pattern in patterns) for word in content_words(request))


def contains(request: str, name: str) -> bool:
    """Return whether a request contains a plain name as whole words, as "the red mug" contains "mug"."""
    return bool(meant_by(request, [name], plain=True))


def means_person(request: str) -> bool:
    """Return whether a request refers to a person: it is capitalized, or has a word for people."""
    return request.strip()[:1].isupper() or any(map(means_anybody, content_words(request)))


def content_words(request: str) -> list[str]:
    """Return the lower-case words of a description without fillers: "red", "mug" for "the red mug"."""
    return [word for word in _WORD.findall(request.casefold()) if word not in _FILLERS]


def normalized(request: str) -> str:
    """Return a name in canonical form: "mug" for "the Mug", and "somebody" for any words for people."""
    name = " ".join(request.casefold().split())
    name = _ARTICLE.sub("", name, count=1)
    return SOMEBODY if means_anybody(name) else name
