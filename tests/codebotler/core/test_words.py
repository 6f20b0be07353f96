"""English for messages."""

import pytest

from codebotler.core.text.words import with_sentence


@pytest.mark.parametrize(
    ("text", "whole"), [("Go", "Go. Now"), ("Go! ", "Go! Now"), ("Is it?", "Is it? Now")]
)
def test_sentence_is_added_after_a_full_stop(text: str, whole: str) -> None:
    assert with_sentence(text, "Now") == whole
