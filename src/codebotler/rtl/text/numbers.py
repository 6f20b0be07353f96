"""Find numbers in a string, written in digits or in words."""

from __future__ import annotations

import re
from collections.abc import Iterator

_ONES = [
    *("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven"),
    *("twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen"),
]
_TENS = ["twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"]
_WORDS = {word: n for n, word in enumerate(_ONES)} | {word: 20 + 10 * n for n, word in enumerate(_TENS)}
_NOTHING = (
    r"no one|no-one|noone|nobody|nothing|none|neither|not (?:one|a single)|no"
    r"|(?:(?<=\bnot )|(?<=n['\u2019]t ))(?:needed|wanted|chosen|picked)"
)

_NEAR = 60  # characters between words that belong together; the limit keeps long texts fast

# Suffixes of a number; F and C need at least two digits before them, because 3C may be a room.
_GLUED = (
    r"x|[ap]m|h|hrs?|hours?|days?|mins?|minutes?|s|secs?|seconds?|k?g|lbs?|oz|m?l|[kcm]m|m|ft|degrees?|percent"
    r"|pcs?|pieces?|people|(?:deg|\u00ba)[fc]?|fahrenheit|celsius|(?<=\d\d)[fc]"
)
_UNITS = "|".join(_ONES[1:10])
_NUMBER = re.compile(
    rf"(?:(?<![\w.,:/-])|(?<=\bx))(?P<digits>-?\d+(?:\.\d+)?)(?!(?!(?:{_GLUED})\b)[\w:]|\.\d)"
    rf"|\b(?P<tens>{'|'.join(_TENS)})(?:[ -](?P<units>{_UNITS}))?\b"
    rf"|\b(?P<hundred>(?:(?:a|one) )?hundred)\b"
    rf"|\b(?P<nothing>{_NOTHING})\b"
    rf"|\b(?P<dozen>(?:a|one) dozen)\b|\b(?P<single>a single)\b"
    rf"|(?P<negated>(?:\bnot|n['\u2019]t)\b[^.,;!?]{{0,{_NEAR}}}?\bany(?:body|one|thing)?\b)"
    rf"|\b(?P<word>{'|'.join(_ONES)})\b",
    re.IGNORECASE,
)
_PRONOUN = re.compile(
    r"\b(?:any|some|every|each|which|this|that|(?<!just )(?<!only )the|another|other|sweet|savory|savoury"
    r"|right|last|first)[ -]$",
    re.IGNORECASE,
)
_TAKES = re.compile(r"\b(?:takes?|took)[ -]$", re.IGNORECASE)
_LAST = re.compile(r"\s*(?:[.,;!)]|and\b|but\b|$)", re.IGNORECASE)
# "2 of 4" and "a total of 2" both give 2; "2 of a total of 4" does not give 4.
_OF = re.compile(
    r"(?:(?:(?<!\btotal )|(?<=\bof a total )|(?<=\bof the total ))"
    r"\bof(?: the| all| these| those)?(?: other)?\s+|/\s*)$",
    re.IGNORECASE,
)
_NOT = re.compile(r"(?:\bnot|n['\u2019]t|\binstead of|\brather than)\s+$", re.IGNORECASE)
_ROUGHLY = re.compile(
    r"\b(?:at (?:least|most)|(?:more|less|fewer|other) than|almost|nearly|up to"
    r"|(?:do not|don['\u2019]t|never) (?:buy|get|need|bring)(?: \w+)?)\s+$",
    re.IGNORECASE,
)
_MORE = re.compile(r"\s*(?:dozen|hundred|thousand|or (?:so|more|less|fewer))\b", re.IGNORECASE)
_TOGETHER = re.compile(
    r"\s*+(?:(?:or|to|-|\u2013|,|/|maybe|perhaps)\s*+)?(?:(?:or|maybe|perhaps)\s*+)?", re.IGNORECASE
)


def numerals(text: str) -> Iterator[tuple[int, int, tuple[float, ...]]]:
    """Yield the start, end and values of each number in a string, where `2 or 3` is one number.

    Words such as `no` and `nobody` are 0. `x2`, `2x` and `2kg` are 2. `2 of 4` and `a total of 2` give 2, but
    `the one`, `not 3` and `at least 3` give no number.
    """
    together: list[re.Match[str]] = []
    for match in _NUMBER.finditer(text):
        if _is_ignored(match, text):
            continue
        if together and not _TOGETHER.fullmatch(text, together[-1].end(), match.start()):
            yield _alternatives(together)
            together = []
        together.append(match)
    if together:
        yield _alternatives(together)


def _alternatives(matches: list[re.Match[str]]) -> tuple[int, int, tuple[float, ...]]:
    return matches[0].start(), matches[-1].end(), tuple(map(_value, matches))


def _is_ignored(match: re.Match[str], text: str) -> bool:
    before = text[max(0, match.start() - _NEAR) : match.start()]
    if match["word"] and match["word"].lower() == "one" and _is_pronoun(match, before):
        return True
    if _MORE.match(text, match.end()):
        return True
    return not match["nothing"] and any(words.search(before) for words in (_OF, _NOT, _ROUGHLY))


def _is_pronoun(match: re.Match[str], before: str) -> bool:
    """Whether `one` is a pronoun, as in `some one` and `would take one`."""
    is_last = _LAST.match(match.string, match.end()) is not None
    return _PRONOUN.search(before) is not None or (is_last and _TAKES.search(before) is not None)


def _value(match: re.Match[str]) -> float:
    if match["digits"]:
        return float(match["digits"])
    if match["tens"]:
        return _WORDS[match["tens"].lower()] + _WORDS.get((match["units"] or "").lower(), 0)
    if match["hundred"]:
        return 100.0
    if match["dozen"] or match["single"]:
        return 12.0 if match["dozen"] else 1.0
    return 0.0 if match["nothing"] or match["negated"] else float(_WORDS[match["word"].lower()])
