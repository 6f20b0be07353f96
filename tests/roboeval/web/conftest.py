"""Real runs that tests of the pages share and copy."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from command_line import roboeval

TASKS = "SayGoodDay,LunchBreak,StaplerSupply"


@pytest.fixture(scope="session")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run a model on three tasks: most of its 45 programs fail, in all ways."""
    path = tmp_path_factory.mktemp("real") / "hasty"
    made = roboeval(
        *("run", "--model", "recorded:hasty", "--num-completions", "3", "--tasks", TASKS),
        *("--no-report", "--out", path),
    )
    assert made.status == 0, made.err
    return path


@pytest.fixture
def runs(tmp_path: Path, hasty: Path) -> Path:
    """Copy that run into a folder of runs, where tests may damage it."""
    folder = tmp_path / "runs"
    shutil.copytree(hasty, folder / "hasty")
    return folder
