"""Pyrobosim is reported as missing with its fix, or is opened and needs a world."""

import importlib.util
import subprocess
import sys

import pytest

from codebotler.core.errors import UserError
from codebotler.core.world import Room, World
from codebotler.robots.base import Options, Robot
from codebotler.robots.open import list_readiness, open_robot

WORLD = World((Room("hall"), Room("kitchen", ("mug",))), "hall")
INSTALL = "pip install 'codebotler[pyrobosim]'"


def test_missing_installation_is_reported_with_its_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    list_readiness()  # Import the other kinds first, so that they keep the real function.
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    (kind,) = (kind for kind in list_readiness() if kind.name == "pyrobosim")
    assert (kind.works, kind.mend) == (False, INSTALL)
    assert "pyrobosim" in kind.missing
    with pytest.raises(UserError, match="pyrobosim") as error:
        open_robot("pyrobosim", Options(world=WORLD))
    assert INSTALL in error.value.sentence


def test_pyrobosim_is_opened_by_name_and_needs_a_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: object())
    robot: Robot = open_robot("pyrobosim", Options(world=WORLD, speed=3))
    assert (robot.name, robot.address, robot.clock.speed) == ("pyrobosim", "", 3)
    with pytest.raises(UserError, match="--world FILE"):
        open_robot("pyrobosim")
    with pytest.raises(UserError, match=r"0\.000001 to 1,000,000"):
        open_robot("pyrobosim", Options(world=WORLD, speed=-1))


@pytest.mark.slow
def test_nothing_heavy_is_imported_before_it_is_connected() -> None:
    program = (
        "import sys\n"
        "from codebotler.robots.open import list_readiness\n"
        "list_readiness()\n"
        "print(sorted({'numpy', 'pyrobosim', 'scipy', 'shapely'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"
