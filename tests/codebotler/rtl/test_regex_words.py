"""The words of a regex: all its texts if they can be listed, otherwise nothing."""

import pytest

from codebotler.rtl.regex_words import choices, first_choice, one_of


@pytest.mark.parametrize(
    ("pattern", "texts"),
    [
        ("bread|toast", ("bread", "toast")),
        (r"\b(?:tea|green tea)\b", ("tea", "green tea")),
        ("staplers?", ("stapler",)),
        ("savou?ry", ("savory",)),
        (r"please\W+follow\W+me", ("please follow me",)),
        (r"^3\.5$", ("3.5",)),
        (r"choco\w*", ("choco…",)),
        ("(?<!grilled )cheese", ("cheese",)),
        ("[Cc]arol", ("carol",)),
        ("n['`]t", ("n't",)),
        (r"\b(7[3-9]|8[0-9])\b", ("73 to 89",)),
        (r"40|forty|^4\b| 4", ("40", "forty", "4")),
        ("bo+b", ("bob",)),
    ],
)
def test_simple_regex_has_words(pattern: str, texts: tuple[str, ...]) -> None:
    assert choices(pattern) == texts


@pytest.mark.parametrize(
    "pattern",
    [
        r"^(?!not\b)",
        "[^a]",
        r"\d+",
        r"(a|b|c|d)(a|b|c|d)(a|b|c|d)",
        r"x(?=\d)",
        r"\W*$",
        ".*",
        r"no(?!.*\d)y",
    ],
)
def test_open_ended_regex_has_no_words(pattern: str) -> None:
    assert choices(pattern) is None


@pytest.mark.parametrize(
    ("pattern", "word"),
    [("2|room two", "2"), (" is out", " is out"), ("", ""), (".*", "anything"), (r"\d+", "(…)")],
)
def test_the_first_choice_is_short(pattern: str, word: str) -> None:
    assert first_choice(pattern) == word


def test_one_of_shows_only_some_of_many_texts() -> None:
    assert one_of(("a", "b")) == '"a" or "b"'
    assert one_of(tuple("abcdefgh")) == '"a", "b", "c", "d", "e" or 3 more'
