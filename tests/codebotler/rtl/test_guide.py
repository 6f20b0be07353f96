"""The examples of the guide work unchanged."""

import doctest
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize("page", ["rtl.md", "reasoning.md", "monitor.md"])
def test_examples_of_the_guide_work(page: str) -> None:
    results = doctest.testfile(str(DOCS / page), module_relative=False, encoding="utf-8")
    assert results.attempted > 10
    assert results.failed == 0
