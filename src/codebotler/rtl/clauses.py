"""Sentences and clauses of a text, and whether a clause denies something."""

from __future__ import annotations

import re
from collections.abc import Iterator

_DENIAL = re.compile(
    r"\b(?:no|not|none|nobody|nothing|noone|never|neither|nor|without|cannot|cant|dont|doesnt|wont|isnt"
    r"|declin\w*|refus\w*|reject\w*|turned down|unable|unavailable|absent|missing|lack\w*|busy)\b"
    r"|n['\u2019]t\b",
    re.IGNORECASE,
)
_HALF_DAY = re.compile(r"\b([ap])\.\s?m\.?", re.IGNORECASE)
_END = re.compile(r"[!?;\n]+|\.(?!\d)")
_JOINT = re.compile(r",(?!\d)|(?<!\d),|\b(?:and|but|while|whereas|however|although|though)\b", re.IGNORECASE)
_ITEM = re.compile(
    r"(?:\W|\b(?:the|and|or|both|only|rooms?|printer|offices?)\b)*(?:\w[\w']*\W*)?", re.IGNORECASE
)


def sentences(text: str) -> list[str]:
    """The sentences of a text; `4 p.m.` and `1.5` end none.

    Args:
        text: any text.
    """
    return [part for part in _END.split(_HALF_DAY.sub(r"\1m", text)) if part.strip()]


def clauses(sentence: str, *, lists: bool = False) -> list[str]:
    """The clauses of a sentence: what commas and words such as `but` divide.

    Args:
        sentence: a sentence.
        lists: whether a clause that is one name, or one number, belongs to the next one that is more, or else
            to the one before: `Alice and Bob are in` says of both the same.
    """
    parts = [part for part in _JOINT.split(sentence) if part.strip()]
    return [*_gathered(parts)] if lists else parts


def _gathered(parts: list[str]) -> Iterator[str]:
    waiting: list[str] = []
    done: list[str] = []
    for part in parts:
        if _ITEM.fullmatch(part) and not denies_something(part):
            waiting.append(part)
        else:
            done.append(" ".join([*waiting, part]))
            waiting = []
    if done:
        done[-1] = " ".join([done[-1], *waiting])
    yield from done or [" ".join(waiting)]


def denies_something(clause: str) -> bool:
    """Whether a clause denies something, by `not`, `nobody`, `declined` and the like.

    Args:
        clause: a clause.
    """
    return _DENIAL.search(clause) is not None
