"""Find times of day in a string."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TypeAlias

from codebotler.rtl.text.clauses import sentences

TimeOfDay: TypeAlias = int
"""Minutes since midnight."""

_NAMES = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]
_HOURS = {word: number for number, word in enumerate(_NAMES, start=1)}


def _hour(kind: str) -> str:
    return rf"(?P<hour{kind}>\d{{1,2}}|{'|'.join(_NAMES)})"


def _half(kind: str) -> str:
    return rf"(?:\s*(?P<half{kind}>[ap])m\b)"


_START = r"(?<![\w:.])"
_CLOCK = re.compile(
    rf"{_START}{_hour('')}[:.](?P<minute>[0-5]\d)(?!\d|:\d){_half('')}?"
    rf"|{_START}(?P<past>half|(?:a )?quarter) (?P<side>past|to) {_hour('1')}\b{_half('1')}?"
    rf"|{_START}{_hour('2')}[ -](?P<word>thirty|fifteen|forty-five)\b{_half('2')}?"
    rf"|{_START}{_hour('3')}(?:{_half('3')}|\s*o['\u2019]?\s?clock\b{_half('4')}?)"
    rf"|(?:\b(?:at|is|for|around|about|make it)|:)\s+{_hour('4')}(?=\s*(?:[,;!?)]|\.(?!\d)|$))"
    r"|\b(?P<noon>noon|mid-?day)\b|\b(?P<midnight>midnight)\b",
    re.IGNORECASE,
)
_IN_THE = re.compile(
    rf"\b({'|'.join(_NAMES)}|\d{{1,2}})(?: o['\u2019]?clock)? in the (morning|afternoon|evening)\b",
    re.IGNORECASE,
)
_ALONE = re.compile(rf"\s*(?:(?:at|around|about)\s+)?{_hour('')}\s*", re.IGNORECASE)
_EXCLUDED = re.compile(
    r"\b(?:before|after|except|(?:any ?(?:thing|time)|all|everything) but|not)\s+(?:at\s+)?$", re.IGNORECASE
)
_NEAR = 30  # characters before a time that are searched for an exclusion
_DAY = 24 * 60


@lru_cache(maxsize=1024)  # several formulas read the same text
def times_in(text: str) -> tuple[tuple[TimeOfDay, ...], ...]:
    """Return a text's times, in minutes since midnight: `at 3`, which is 3 am or pm, gives `((180, 900),)`.

    `12 pm`, `12:00`, `noon`, `twelve o'clock`, `half past twelve` and `six in the evening` are times, and so
    is a string such as `12` or `at 12` without other words. `before 12 pm` is not a time.
    """
    plain = ". ".join(sentence.rstrip("? ") for sentence in sentences(text))
    plain = _IN_THE.sub(lambda match: f"{match[1]} {'am' if match[2].lower() == 'morning' else 'pm'}", plain)
    if alone := _ALONE.fullmatch(plain):
        return (*_readings(alone["hour"], 0, None),)
    return tuple(
        time
        for match in _CLOCK.finditer(plain)
        if not _EXCLUDED.search(plain, max(0, match.start() - _NEAR), match.start())
        for time in _of(match)
    )


def _of(match: re.Match[str]) -> list[tuple[TimeOfDay, ...]]:
    if match["noon"]:
        return [(_DAY // 2,)]
    if match["midnight"]:
        return [(0, _DAY)]
    hour = next(match[name] for name in ("hour", "hour1", "hour2", "hour3", "hour4") if match[name])
    half = next((match[name] for name in ("half", "half1", "half2", "half3", "half4") if match[name]), None)
    minute = int(match["minute"] or 0)
    if match["past"]:
        minute = 30 if match["past"].lower() == "half" else 15
        minute = -minute if match["side"].lower() == "to" else minute
    if match["word"]:
        minute = {"thirty": 30, "fifteen": 15}.get(match["word"].lower(), 45)
    return _readings(hour, minute, half)


def _readings(hour: str, minute: int, half: str | None) -> list[tuple[TimeOfDay, ...]]:
    number = _HOURS.get(hour.lower()) or int(hour)
    if number > 24:  # noqa: PLR2004 - hours of a day
        return []
    if half is not None:
        return [((number % 12 + (12 if half.lower() == "p" else 0)) * 60 + minute,)]
    is_exact = number > 12 or number == 0 or hour.startswith("0")  # noqa: PLR2004 - half a day
    readings = (number,) if is_exact else (number % 12, number % 12 + 12)
    return [tuple(reading * 60 + minute for reading in readings)]
