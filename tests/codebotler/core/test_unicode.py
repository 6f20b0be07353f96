"""Texts are normalized quickly, whatever somebody sends."""

import time
from unicodedata import normalize

import pytest

from codebotler.core.unicode import MAX_ACCENTS, SHORT_TEXT, compose, normalize_text

LONG = "e\u0301" * SHORT_TEXT
ROW = "a" + "\u0315\u0300" * 50


@pytest.mark.parametrize("text", ["cafe\u0301", LONG, f"{LONG}a" + "\u0301" * MAX_ACCENTS, "x" * 5_000])
def test_ordinary_texts_are_composed(text: str) -> None:
    assert compose(text) == normalize("NFC", text)
    assert normalize_text("NFD", compose(text)) == normalize("NFD", text)


@pytest.mark.parametrize("before", [LONG, ""])
def test_a_long_row_of_accents_is_kept_and_the_rest_is_composed(before: str) -> None:
    text = f"{before}{ROW}{LONG}"
    assert compose(text) == normalize("NFC", before) + ROW + normalize("NFC", LONG)


@pytest.mark.parametrize(("size", "count"), [(100_000, 1), (998, 200)])
def test_hostile_texts_take_no_longer_than_others(size: int, count: int) -> None:
    hostile = ["a" + "\u0315" * (size // 2) + "\u0300" * (size // 2)] * count
    ordinary, spent = ["\u0301a" * (size // 2)] * count, []
    for text in (ordinary, hostile):
        began = time.process_time()
        compose(text)
        spent.append(time.process_time() - began)
    assert spent[1] < 5 * spent[0] + 0.05
