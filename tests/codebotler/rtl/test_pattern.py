"""Matchers cache the results for short texts, up to a limit."""

from __future__ import annotations

from codebotler.rtl.pattern import MAX_CACHED_LENGTH, MAX_CACHED_TEXTS, Matcher


class Longer(Matcher):
    """Match texts of more than three characters, and list the texts that were not cached."""

    def __init__(self) -> None:
        self.seen: list[str] = []

    def _matches(self, text: str) -> bool:
        self.seen.append(text)
        return len(text) > 3


def test_only_short_texts_are_cached() -> None:
    matcher, long = Longer(), "x" * (MAX_CACHED_LENGTH + 1)
    for _ in range(2):
        assert [matcher.matches(text) for text in ("abc", "abcd", long)] == [False, True, True]
    assert matcher.seen == ["abc", "abcd", long, long]


def test_cache_is_bounded() -> None:
    matcher = Longer()
    for number in range(2 * MAX_CACHED_TEXTS):
        matcher.matches(str(number))
    assert len(matcher._known) <= MAX_CACHED_TEXTS
    assert matcher.matches("0") is False
    assert matcher.seen.count("0") == 2
