"""The robot works on when the last operator's page closes, unless it was asked to stop then."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from codebotler.missions.storage.store import read_missions
from pageserver import PageServer
from viewing import PHONE, OpenPage

FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"

GRACE = 10  # Seconds; a page loads slowly while many tests run.


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PageServer]:
    with PageServer(tmp_path, "--face", "--stop-when-alone", str(GRACE)) as server:
        yield server


def state(server: PageServer) -> str:
    return str(server.call("GET", "/api/robot").data["state"])


def wait_until_over(server: PageServer) -> None:
    ends = time.monotonic() + 60
    while not server.call("GET", "/api/robot").data["is_over"]:
        assert time.monotonic() < ends
        time.sleep(0.02)


def test_the_robot_is_stopped_when_the_last_operator_leaves(server: PageServer, open_page: OpenPage) -> None:
    first, second = open_page(server), open_page(server, size=PHONE)
    face = open_page(server, link=server.face_link)
    server.run(FAR)
    for page in (first, second):
        expect(page.locator(".headline")).to_have_text("Running")
    first.context.close()
    second.reload()
    expect(second.locator(".headline")).to_have_text("Running")
    second.goto(f"{server.inside}/missions")
    expect(second.locator("h1")).to_have_text("Missions")
    second.wait_for_timeout(1000 * (GRACE + 1))
    assert state(server) == "running", "an operator is still there"
    second.context.close()
    expect(face.locator("#doing")).to_have_text("I was stopped.")
    wait_until_over(server)
    assert (
        read_missions(server.home)[-1].reason
        == "stopped by CodeBotler, because the last operator closed the page"
    )


def test_operator_who_returns_in_time_keeps_it_running(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    expect(page.locator(".headline")).to_be_visible()
    server.run(FAR)
    page.goto("about:blank")
    page.goto(server.link)
    expect(page.locator(".headline")).to_have_text("Running")
    page.wait_for_timeout(1000 * (GRACE + 1))
    assert state(server) == "running"


def test_a_mission_that_only_waits_is_left_alone(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    expect(page.locator(".headline")).to_be_visible()
    server.call("POST", "/api/missions", {"program": FAR})
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
    page.context.close()
    time.sleep(GRACE + 1)
    assert state(server) == "checked"


def test_disconnected_browser_delays_nobody_and_catches_up(server: PageServer, open_page: OpenPage) -> None:
    away, here = open_page(server, expecting="ERR_INTERNET_DISCONNECTED"), open_page(server)
    expect(away.locator(".headline")).to_be_visible()
    server.run(FAR)
    expect(away.locator(".headline")).to_have_text("Running")
    away.context.set_offline(True)
    here.locator("#stop").click()
    expect(here.locator("#stop-told")).to_have_text("The robot has stopped.")
    away.locator("#stop").click()
    expect(away.locator("#stop-told")).to_contain_text("CodeBotler is not responding.")
    away.context.set_offline(False)
    expect(away.locator(".headline")).to_have_text("Stopped")
