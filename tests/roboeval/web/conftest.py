"""Real runs, made on the spot, that tests of the pages share and copy."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from command_line import roboeval

TASKS = "SayGoodDay,LunchBreak,StaplerSupply"


@pytest.fixture(scope="session")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of three tasks: most of its 45 programs fail, by all kinds."""
    path = tmp_path_factory.mktemp("real") / "hasty"
    made = roboeval(
        *("run", "--model", "recorded:hasty", "--num-completions", "3", "--tasks", TASKS),
        *("--no-report", "--out", path),
    )
    assert made.status == 0, made.err
    return path


@pytest.fixture
def runs(tmp_path: Path, hasty: Path) -> Path:
    """A folder of runs with a copy of that one, to be damaged at will."""
    folder = tmp_path / "runs"
    shutil.copytree(hasty, folder / "hasty")
    return folder
