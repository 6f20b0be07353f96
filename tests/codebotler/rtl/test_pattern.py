"""Matchers remember short texts, and not too many of them."""

from __future__ import annotations

from codebotler.rtl.pattern import MAX_CACHED_LENGTH, MAX_CACHED_TEXTS, Matcher


class Longer(Matcher):
    """A string of more than three characters; keeps what it had to look at."""

    def __init__(self) -> None:
        self.seen: list[str] = []

    def _matches(self, text: str) -> bool:
        self.seen.append(text)
        return len(text) > 3


def test_a_short_text_is_looked_at_once_and_a_long_one_each_time() -> None:
    matcher, long = Longer(), "x" * (MAX_CACHED_LENGTH + 1)
    for _ in range(2):
        assert [matcher.matches(text) for text in ("abc", "abcd", long)] == [False, True, True]
    assert matcher.seen == ["abc", "abcd", long, long]


def test_what_is_remembered_has_an_end() -> None:
    matcher = Longer()
    for number in range(2 * MAX_CACHED_TEXTS):
        matcher.matches(str(number))
    assert len(matcher._known) <= MAX_CACHED_TEXTS
    assert matcher.matches("0") is False
    assert matcher.seen.count("0") == 2
