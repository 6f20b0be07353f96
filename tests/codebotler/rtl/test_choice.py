"""Regexes as choices of plain texts."""

import pytest

from codebotler.rtl.choice import choices
from codebotler.rtl.formula import Regex


@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        ("mid-?day|no{0,1}n", {'"{}"': ("midday", "mid-day", "nn", "non")}),
        ("[1-3]|x|0[1-3]|7|8", {'"{}"': ("1", "2", "3", "x", "01", "02", "03", "7", "8")}),
        (r"\b[1-3]\b", {"a number from {} as a word of its own": ("1 to 3",)}),
        (r"\b([1-3]|7)\b", {'the word "{}"': ("1", "2", "3", "7")}),
        (r"\b1 to 3\b", {'the word "{}"': ("1 to 3",)}),
        (r"\b(5|6|5)\b", {'the word "{}"': ("5", "6")}),
        ("1" * 5_000 + "|a", {'"{}"': ("1" * 5_000, "a")}),
        ("[a-u]", {}),
        ("[a-t]", {'"{}"': tuple("abcdefghijklmnopqrst")}),
        ("[a-z][a-z][a-z]", {}),
        ("[\x00-\U0010ffff]", {}),
        (r"\b:\)", {}),
        (r":\)", {'"{}"': (":)",)}),
        ("[^a]|b", {}),
        (r"\d|b", {}),
        (r"\Ba", {}),
        ("a+|b", {}),
        ("(?i:a)|b", {}),
        ("  a", {}),
        (" ", {}),
        ("\ue000", {}),
        ("a|", {}),
        ("(", {}),
        ("(?i)a|b", {'"{}"': ("a", "b")}),
        ("(?m)^(a|b)", {}),
        (r"(?a)\b(a|b)\b", {}),
    ],
)
def test_a_regex_that_is_a_choice_is_told_as_one(pattern: str, told: dict[str, tuple[str, ...]]) -> None:
    assert choices(pattern) == told
    for text in told.get('"{}"', ()):
        assert Regex(pattern).matches(text)
