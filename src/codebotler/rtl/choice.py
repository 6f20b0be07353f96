"""The plain texts between which a regex chooses, for explanations: `7[3-9]|80` means 73 to 80."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from itertools import product
from typing import TYPE_CHECKING, Any

from codebotler.core.unwarned import unwarned

if TYPE_CHECKING:
    from collections.abc import Iterable

_MOST = 200  # texts that are spelled out, and of these:
_MOST_TOLD = 20
_RUN = 3  # numbers in a row, at least, that are told as a range

_FLAGS = re.IGNORECASE | re.DOTALL
_NUMERAL = re.compile("0|[1-9][0-9]{0,8}")

# Stand for themselves in what is spelled out; no formula holds these characters.
_MARKS = {"AT_BOUNDARY": "\ue000", "AT_BEGINNING": "\ue001", "AT_END": "\ue002"}
_MARKED = re.compile("([\ue000\ue001]?)( ?)([^\ue000-\ue002]+?)( ?)([\ue000\ue002]?)")
PLAIN, _WORD, _NUMBER = '"{}"', 'the word "{}"', "a number from {} as a word of its own"
_PLACES: dict[tuple[str, ...], str] = {
    ("", "", "", ""): PLAIN,
    ("\ue000", "", "", "\ue000"): _WORD,
    ("\ue000", "", "", ""): 'a word starting with "{}"',
    ("", "", "", "\ue000"): 'a word ending with "{}"',
    ("\ue001", "", "", ""): '"{}" at the start',
    ("\ue001", "", "", "\ue000"): 'the word "{}" at the start',
    ("", "", "", "\ue002"): '"{}" at the end',
    ("\ue000", "", "", "\ue002"): 'the word "{}" at the end',
    ("", " ", "", ""): '"{}" after a space',
    ("", "", " ", ""): '"{}" before a space',
}


@cache
def choices(pattern: str) -> dict[str, tuple[str, ...]]:
    """What a text must hold so that a regex is found in it, in words; empty where that is no choice of texts.

    Words that are numbers in a row, and nothing else, are told as a range.

    Args:
        pattern: the regex.

    Returns:
        how the texts must stand, as a phrase with `{}` where they go, and the texts; the plain ones first.
    """
    try:
        tree = _parsed(pattern)
        texts = () if tree.state.flags & ~(_FLAGS | re.UNICODE) else _spelled(tree) or ()
    except (re.error, RecursionError, OverflowError):
        return {}
    told: dict[str, dict[str, None]] = {PLAIN: {}}
    for text in texts:
        marked = _MARKED.fullmatch(text)
        if marked is None or (place := _PLACES.get(marked.group(1, 2, 4, 5))) is None:
            return {}
        plain = marked[3]
        if plain != plain.strip() or ("word" in place and not (plain[0].isalnum() and plain[-1].isalnum())):
            return {}  # of what is no word, a boundary tells something else
        told.setdefault(place, {})[plain] = None
    phrases = dict(_phrase(place, tuple(plain)) for place, plain in told.items() if plain)
    return phrases if sum(map(len, phrases.values())) <= _MOST_TOLD else {}


def _phrase(place: str, texts: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    if place == _WORD and len(texts) >= _RUN and all(map(_is_next, texts, texts[1:])):
        return _NUMBER, (f"{texts[0]} to {texts[-1]}",)
    return place, texts


def _is_next(one: str, other: str) -> bool:
    return all(map(_NUMERAL.fullmatch, (one, other))) and int(other) == int(one) + 1


def _parsed(pattern: str) -> Any:  # noqa: ANN401 - the tree of a private module of Python's
    with unwarned():
        return import_module("re._parser").parse(pattern, _FLAGS)


def _spelled(items: Any) -> list[str] | None:  # noqa: ANN401 - the same
    """All texts that a part of a regex stands for; None if they are too many, or more than texts."""
    texts = [""]
    for op, value in items:
        parts = _spelled_one(str(op), value)
        if parts is None or len(texts) * len(parts) > _MOST:
            return None
        texts = ["".join(both) for both in product(texts, parts)]
    return texts


def _spelled_one(op: str, value: Any) -> list[str] | None:  # noqa: ANN401, PLR0911 - one for each node
    match op, value:
        case "LITERAL", code:
            return None if chr(code) in _MARKS.values() else [chr(code)]
        case "AT", where:
            return [_MARKS[str(where)]] if str(where) in _MARKS else None
        case "IN", members:
            return _each([_range(str(kind), codes) for kind, codes in members])
        case "BRANCH", (_, branches):
            return _each(map(_spelled, branches))
        case "SUBPATTERN", (_, 0, 0, inner):
            return _spelled(inner)
        case "MAX_REPEAT", (0, 1, inner):
            return _each([[""], _spelled(inner)])
    return None


def _range(kind: str, codes: Any) -> list[str] | None:  # noqa: ANN401 - the same
    ends = {"LITERAL": (codes, codes), "RANGE": codes}.get(kind)
    return None if ends is None or ends[1] - ends[0] >= _MOST else [*map(chr, range(ends[0], ends[1] + 1))]


def _each(several: Iterable[list[str] | None]) -> list[str] | None:
    found = [*several]
    return None if None in found else [text for texts in found if texts is not None for text in texts]
