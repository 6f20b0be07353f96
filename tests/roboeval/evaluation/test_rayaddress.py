"""RAY_ADDRESS is refused with a sentence where there is no cluster; Ray is not needed for that."""

from __future__ import annotations

import socket
from pathlib import Path
from time import monotonic

import pytest

from codebotler.badinput import BadInput
from roboeval.evaluation import rayaddress
from roboeval.evaluation.rayaddress import (
    LOCKED,
    OUTSIDE,
    SILENT,
    expect_cluster,
    expect_listener,
    is_here_only,
)


@pytest.fixture(autouse=True)
def _no_cluster(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))


def remember(folder: Path) -> Path:
    """Leave the note behind that a cluster which ended with its machine leaves."""
    note = folder / "ray" / "ray_current_cluster"
    note.parent.mkdir()
    note.write_text("127.0.0.1:6379")
    return note


def answering(monkeypatch: pytest.MonkeyPatch, status: int) -> None:
    """Let Ray's client end so."""
    monkeypatch.setattr(rayaddress, "PING", f"import sys; sys.exit({status})")


@pytest.mark.parametrize(
    "address",
    [
        *("nonsense", "http://127.0.0.1:8265", "127.0.0.1:0", "127.0.0.1:65536", "127.0.0.1:six", ":6379"),
        *("::1:6379", "[::1]", "10.0.0.5:6379,10.0.0.6:6379", " 10.0.0.5:6379"),
    ],
)
def test_what_is_no_address_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ADDRESS", address)
    with pytest.raises(BadInput, match=r"^RAY_ADDRESS: .*HOST:PORT"):
        expect_cluster()


def test_ray_client_is_refused_by_its_name() -> None:
    with pytest.raises(BadInput, match=r"Ray Client .*HOST:PORT"):
        expect_listener("ray://127.0.0.1:10001")


def test_where_nothing_listens_a_sentence_says_so_at_once() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        expect_listener(f"127.0.0.1:{port}")
    started = monotonic()
    with pytest.raises(BadInput) as refused:
        expect_listener(f"127.0.0.1:{port}")
    assert monotonic() - started < rayaddress.PATIENCE_S
    for said in (
        "RAY_ADDRESS: ",
        f"127.0.0.1:{port}",
        "Connection refused",
        "`ray start --head`",
        "RAY_ADDRESS=local",
    ):
        assert said in refused.value.sentence


def test_a_host_that_has_no_address_is_no_cluster() -> None:
    with pytest.raises(BadInput, match=r"no Ray cluster .*x\.\.y:6379 "):
        expect_listener("x..y:6379")  # no name at all, so that nobody is asked for it


def test_brackets_around_an_address_of_ipv6_are_none_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def connect(where: tuple[str, int], _timeout: float) -> socket.socket:
        asked.append(where)
        return socket.socket()

    monkeypatch.setattr(socket, "create_connection", connect)
    expect_listener("[::1]:6379")
    assert asked == [("::1", 6379)]


def test_what_listens_and_never_answers_is_waited_for_so_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rayaddress, "PING", "import time; time.sleep(60)")
    monkeypatch.setattr(rayaddress, "PING_PATIENCE_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{server.getsockname()[1]}")
        started = monotonic()
        with pytest.raises(BadInput, match="does not answer"):
            expect_cluster()
    assert monotonic() - started < 30


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        (SILENT, "does not answer"),
        (LOCKED, "RAY_AUTH_MODE=token"),
        (OUTSIDE, "`ray start --address="),
    ],
)
def test_what_a_cluster_answers_is_told(status: int, sentence: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{server.getsockname()[1]}")
        answering(monkeypatch, status)
        with pytest.raises(BadInput, match=sentence):
            expect_cluster()
        for fine in (0, 1):  # 1 is what Python ends with where Ray has changed
            answering(monkeypatch, fine)
            expect_cluster()


def test_a_cluster_that_is_only_remembered_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answering(monkeypatch, SILENT)
    expect_cluster()  # nothing to ask
    note = remember(tmp_path)
    with pytest.raises(BadInput) as refused:
        expect_cluster()
    assert str(refused.value).startswith(f"{note}: ")
    assert "`ray stop`" in refused.value.sentence
    answering(monkeypatch, LOCKED)
    expect_cluster()  # Ray looks for the token of this machine's cluster itself
    answering(monkeypatch, SILENT)
    monkeypatch.setenv("RAY_ADDRESS", "local")
    expect_cluster()


def test_what_only_this_machine_reaches(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    addresses = ["local", "127.0.0.1:6379", "localhost:6379", "[::1]:6379", "", "auto", "10.0.0.5:6379"]

    def here_only() -> list[str]:
        found = []
        for address in addresses:
            monkeypatch.setenv("RAY_ADDRESS", address)
            found += [address] if is_here_only() else []
        return found

    assert here_only() == addresses[:6]
    remember(tmp_path)
    assert here_only() == addresses[:4]
