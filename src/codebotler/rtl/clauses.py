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
_ITEM = re.compile(r"\W*(?:\w[\w']*\W+){0,2}(?:\w[\w']*\W*)?")
_VERB = re.compile(
    r"\b(?:is|are|was|were|am|be|has|have|had|will|would|can|could|should|does|do|did|says?|said|wants?|yes"
    r"|accept\w*|agree\w*|join\w*|com(?:es?|ing)|lik(?:es?|ing)|needs?|buy|gave|gives?|please)\b|\w['\u2019](?:re|ll|ve|m|d)\b",
    re.IGNORECASE,
)
_SUBJECT = re.compile(r"\s*(?:he|she|it|they|we|i|you|there)\b", re.IGNORECASE)


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
        lists: whether a clause of a few words and without a verb belongs to the next one that is more, or
            else to the one before: `Alice and Bob are in` says of both the same.
    """
    parts = [part for part in _JOINT.split(sentence) if part.strip()]
    return [*_gathered(parts)] if lists else parts


def _gathered(parts: list[str]) -> Iterator[str]:
    waiting: list[str] = []
    done: list[str] = []
    for part in parts:
        if _is_item(part):
            waiting.append(part)
            continue
        if done and _SUBJECT.match(part):  # the names before it belong to what was said before
            done[-1] = " ".join([done[-1], *waiting])
            done.append(part)
        else:
            done.append(" ".join([*waiting, part]))
        waiting = []
    if done:
        done[-1] = " ".join([done[-1], *waiting])
    yield from done or [" ".join(waiting)]


def _is_item(part: str) -> bool:
    """Whether it is a few words that say nothing by themselves, such as a name."""
    says_something = _SUBJECT.match(part) or _VERB.search(part) or denies_something(part)
    return _ITEM.fullmatch(part) is not None and not says_something


def denies_something(clause: str) -> bool:
    """Whether a clause denies something, by `not`, `nobody`, `declined` and the like.

    Args:
        clause: a clause.
    """
    return _DENIAL.search(clause) is not None
