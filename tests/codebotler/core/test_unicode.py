"""Texts are normalized quickly, even hostile ones."""

import sys
import time
from unicodedata import combining, normalize

import pytest

from codebotler.core.program import Flaw, parse_expression, parse_program
from codebotler.core.text.unicode import MAX_ACCENTS, SHORT_TEXT, compose, long_rows, normalize_text

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


HIDDEN_ACCENTS = "\u0f73\u0f75\u0f81\uff9e\uff9f"
"""All characters that count as letters but become accents in a normal form."""


@pytest.mark.slow
def test_no_other_letter_becomes_an_accent() -> None:
    forms = ((one, normalize("NFKD", one)) for one in map(chr, range(sys.maxunicode + 1)))
    assert "".join(one for one, form in forms if combining(form[0]) and not combining(one)) == HIDDEN_ACCENTS


@pytest.mark.parametrize("sign", HIDDEN_ACCENTS)
def test_signs_that_become_accents_are_counted(sign: str) -> None:
    text = f"{LONG}a{sign * MAX_ACCENTS}"
    assert list(long_rows(text)) == []
    assert list(long_rows(f"{text}{sign}b")) == [(len(LONG), len(text) + 1)]


@pytest.mark.parametrize("row", [ROW, "a" + "\uff9e\u0334" * 50])
def test_no_name_with_a_long_row_of_accents_reaches_the_parser(row: str) -> None:
    flaw = parse_program(f"def task_program():\n    {row} = 1\n")
    assert isinstance(flaw, Flaw)
    assert (flaw.line, flaw.kind) == (2, "SyntaxError")
    with pytest.raises(SyntaxError):
        parse_expression(row)
