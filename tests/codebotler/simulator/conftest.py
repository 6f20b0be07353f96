"""Tests of the engine itself start its processes as users do."""

import pytest

from codebotler.simulator.lane import Lane


@pytest.fixture(autouse=True)
def own_lanes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.simulator.engine.Lane", Lane)
