"""The guide's examples run as they stand."""

import doctest
from pathlib import Path

GUIDE = Path(__file__).parents[2] / "docs" / "rtl.md"


def test_the_examples_of_the_guide() -> None:
    results = doctest.testfile(str(GUIDE), module_relative=False, encoding="utf-8")
    assert results.attempted > 20
    assert results.failed == 0
