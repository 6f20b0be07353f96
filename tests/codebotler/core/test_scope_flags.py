"""`scope_flags` lets a regex with leading flags be part of another one."""

import re

import pytest

from codebotler.core.text.labels import scope_flags

PLAIN = ("yes", "(?:yes|no)", "(?i:yes)", r"a\(?i\)", "")


@pytest.mark.parametrize("pattern", PLAIN)
def test_a_regex_without_flags_stays_as_it_is(pattern: str) -> None:
    assert scope_flags(pattern) == pattern


@pytest.mark.parametrize(
    "pattern", ["(?i)yes", "(?is)y.s|no", "(?i)(?s)Y.S", "(?x) yes # or no", "(?ax) y\\ws"]
)
@pytest.mark.parametrize("text", ["yes", "YES", "y\ns", "maybe"])
def test_embedded_regex_with_flags_matches_the_same_texts(pattern: str, text: str) -> None:
    within = re.compile(f"^(?:{scope_flags(pattern)})")
    assert (within.match(text) is None) == (re.match(pattern, text) is None)
