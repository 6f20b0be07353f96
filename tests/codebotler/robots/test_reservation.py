"""A lock reserves a robot for one tool, however its address is written, safe from other users."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from codebotler.robots.base import NotReadyError, Options
from codebotler.robots.open import open_robot
from codebotler.robots.reservation import Reservation, lock_folder, normalize_address
from doubles import FakeRobot


def robot_at(address: str) -> FakeRobot:
    robot = FakeRobot()
    robot.address = address
    return robot


@pytest.mark.parametrize(
    "address",
    [
        *("ws://robot:9090", "WS://Robot:9090/", "ws://robot:9090//", "ws://robot.:9090", " ws://robot:9090"),
        "ws://ann:secret@robot:9090",
    ],
)
def test_addresses_of_one_robot_are_one(address: str) -> None:
    assert normalize_address(address) == "ws://robot:9090"


@pytest.mark.parametrize(
    "host",
    [
        *("localhost", "LOCALHOST", "127.0.0.1", "127.0.1.1", "0.0.0.0"),
        *("[::1]", "[0:0:0:0:0:0:0:1]", "[::]", "[::ffff:127.0.0.1]", socket.gethostname()),
    ],
)
def test_names_of_this_machine_are_one(host: str) -> None:
    assert (
        normalize_address(open_robot("ros1", Options(address=f"http://{host}:11311/")).address)
        == "http://127.0.0.1:11311"
    )
    assert (
        normalize_address(open_robot("rosbridge", Options(address=f"ws://{host}")).address)
        == "ws://127.0.0.1:80"
    )
    assert normalize_address(open_robot("rosbridge").address) == "ws://127.0.0.1:9090"


@pytest.mark.parametrize("address", ["nonsense", "", "ws://", "ws://robot:a", "ws://[::1", "ftp://robot"])
def test_invalid_address_is_unchanged(address: str) -> None:
    assert normalize_address(address) == address


def test_addresses_of_other_robots_stay_different() -> None:
    others = (
        "ws://a:1",
        "ws://a:2",
        "ws://b:1",
        "wss://a:1",
        "ws://a:1/x",
        "ws://a:1/x?y",
        "ws://[fe80::1]:1",
        "ws://10.0.0.1:1",
    )
    assert len({normalize_address(address) for address in others}) == len(others)


def test_robot_with_an_address_is_reserved_across_homes(tmp_path: Path) -> None:
    with (
        Reservation(robot_at("ws://robot:9090"), tmp_path / "one"),
        pytest.raises(NotReadyError, match="another tool"),
    ):
        Reservation(robot_at("ws://robot:9090"), tmp_path / "two").__enter__()
    with Reservation(FakeRobot(), tmp_path / "one"), Reservation(FakeRobot(), tmp_path / "two"):
        assert [file.name for file in (tmp_path / "one" / "robots").iterdir()] == ["answering.lock"]


@pytest.mark.parametrize("address", [f"ws://{'x' * 5_000}:9090", "\ud800", "ws://../../robot:9090"])
def test_any_address_can_be_locked(address: str, tmp_path: Path) -> None:
    with Reservation(robot_at(address), tmp_path), pytest.raises(NotReadyError, match="another tool"):
        Reservation(robot_at(address), tmp_path).__enter__()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put the folder of locks elsewhere than in /tmp."""
    monkeypatch.setattr("codebotler.robots.reservation.LOCKS_IN", tmp_path)
    return tmp_path / f"codebotler-{os.getuid()}"


def test_only_the_user_can_write_into_the_folder_of_locks(folder: Path) -> None:
    assert lock_folder() == folder
    assert folder.stat().st_mode & 0o777 == 0o700


def test_no_variable_moves_the_locks(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("XDG_RUNTIME_DIR", "TMPDIR", "HOME"):
        monkeypatch.setenv(variable, str(folder.parent))
    assert lock_folder() == folder


@pytest.mark.parametrize("what", ["link", "file", "open", "somebody else's"])
def test_folder_of_locks_that_is_not_ours_is_refused(
    what: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    match what:
        case "link":
            folder.symlink_to(tmp_path)
        case "file":
            folder.touch()
        case "open":
            folder.mkdir()
            folder.chmod(0o777)
        case _:
            folder.mkdir(0o700)
            uid = os.getuid()
            monkeypatch.setattr("os.getuid", lambda: uid + 1)
            folder.rename(tmp_path / f"codebotler-{uid + 1}")
    with pytest.raises(NotReadyError, match=f"{folder.parent}/codebotler-.*remove"):
        Reservation(robot_at("ws://robot:9090"), tmp_path).__enter__()
