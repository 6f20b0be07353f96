"""What all tests share: the corpus of real programs, where it is at hand, and the paper's suite."""

import os
from pathlib import Path

import pytest

from roboeval.suite import Suite, load_suite


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real programs and published results; without it, tests over it are skipped."""
    folder = os.environ.get("CODEBOTLER_CORPUS")
    if not folder:
        pytest.skip("CODEBOTLER_CORPUS is not set: the corpus of real programs is not at hand")
    return Path(folder)


@pytest.fixture(scope="session")
def paper() -> Suite:
    return load_suite("paper")
