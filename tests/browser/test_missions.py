"""Past missions: a list with a search, which is live in all tabs, and the end of each mission."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from pageserver import PageServer
from viewing import DESK, PHONE, OpenPage, Shoot, expect_no_grave_fault

HELLO = "def task_program():\n    say('Hello')\n"
FAILS = "def task_program():\n    say('Off I go')\n    pick('unicorn')\n"
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"
NO_ARM = """class NoArm:
    def go_to(self, location): pass
    def get_current_location(self): return "hall"
    def rooms(self): return ["hall", "kitchen"]
    def say(self, message): pass
    def stop(self): pass
"""


def run_to_end(server: PageServer, program: str) -> str:
    """Run a program to its end; return the name of its mission."""
    server.run(program, despite_problems=True)
    ended = server.call("GET", "/api/robot?once=over").data
    assert ended["is_over"], ended
    return str(ended["mission"])


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PageServer]:
    with PageServer(tmp_path, "--speed", "50") as server:
        yield server


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_mission_page_starts_with_the_reason_and_the_line_of_its_end(
    server: PageServer, open_page: OpenPage, shoot: Shoot, size: tuple[int, int]
) -> None:
    mission = run_to_end(server, FAILS)
    page = open_page(server, f"missions/{mission}", size=size)
    ending = page.locator(".ending")
    expect(ending.locator(".state")).to_have_text("failed")
    expect(ending.locator(".reason")).to_have_text(re.compile(r"^line 3: .*unicorn"))
    expect(ending.locator("code")).to_have_text("pick('unicorn')")
    expect(page.locator(".source .failed-line")).to_have_text("    pick('unicorn')")
    assert page.locator(".source").inner_text().strip() == FAILS.strip()
    tops = [page.locator(part).bounding_box() for part in (".ending", ".facts", ".timeline")]
    heights = [box["y"] for box in tops if box is not None]
    assert heights == sorted(heights)
    assert len(heights) == len(tops)
    expect_no_grave_fault(page)
    shoot(page, f"mission-failed-{size[0]}")


def test_a_mission_without_a_line_has_no_mark(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server, f"missions/{run_to_end(server, HELLO)}")
    expect(page.locator(".ending .state")).to_have_text("done")
    expect(page.locator(".source")).to_contain_text("say('Hello')")
    expect(page.locator(".ending code, .source mark")).to_have_count(0)


def test_the_page_of_a_mission_follows_it_to_its_end(server: PageServer, open_page: OpenPage) -> None:
    server.run(FAR)
    mission = server.call("GET", "/api/robot").data["mission"]
    page = open_page(server, f"missions/{mission}")
    expect(page.locator(".ending .state")).to_have_text("running")
    events = page.locator(".timeline li")
    known = events.count()
    expect(events.nth(known + 2)).to_be_visible()
    server.rest()
    expect(page.locator(".ending .state")).to_have_text("stopped")
    expect(page.locator(".timeline .text").first).to_have_text("Mission created")
    page.reload()
    expect(page.locator(".ending .state")).to_have_text("stopped")


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_the_list_shows_robot_and_reason_and_can_be_searched(
    server: PageServer, open_page: OpenPage, shoot: Shoot, size: tuple[int, int]
) -> None:
    run_to_end(server, HELLO)
    run_to_end(server, FAILS)
    page = open_page(server, "missions", size=size)
    rows = page.locator(".rows li")
    expect(rows).to_have_count(2)
    expect(rows.first.locator(".outcome")).to_have_text(re.compile("robot: simulated · line 3: .*unicorn"))
    expect(rows.last.locator(".outcome")).to_have_text(re.compile(r"^mission [\d-]+ · robot: simulated$"))
    expect_no_grave_fault(page)
    shoot(page, f"missions-all-{size[0]}")
    page.get_by_label("Search").fill("UNICORN")
    expect(rows).to_have_count(1)
    expect(page.get_by_text("1 of 2 missions")).to_be_visible()
    expect(page).to_have_url(re.compile("text=UNICORN"))
    page.reload()
    expect(rows).to_have_count(1)
    expect(rows.first).to_contain_text("failed")
    page.get_by_label("Search").fill("simulated done")
    expect(rows).to_have_count(1)
    expect(rows.first).to_contain_text("done")
    page.get_by_label("Search").fill("")
    expect(rows).to_have_count(2)
    expect(page).to_have_url(re.compile("/missions$"))


def test_the_list_is_live_in_all_tabs(server: PageServer, open_page: OpenPage) -> None:
    first = open_page(server, "missions")
    stopped = f"{server.inside}/missions?text=stopped"
    second = open_page(server, beside=first, link=stopped)
    expect(first.get_by_text("No missions yet.")).to_be_visible()
    server.run(FAR)
    expect(first.locator(".rows li")).to_have_count(1)
    expect(first.locator(".rows .state")).to_have_text("running")
    expect(second.get_by_text("0 of 1 missions")).to_be_visible()
    server.rest()
    expect(first.locator(".rows .state")).to_have_text("stopped")
    expect(first.locator(".rows .outcome")).to_have_text(re.compile("robot: simulated · .*stopped"))
    expect(second.locator(".rows li")).to_have_count(1)
    run_to_end(server, HELLO)
    expect(first.locator(".rows .state").first).to_have_text("done")
    expect(first.locator(".rows .state").last).to_have_text("stopped")
    expect(second.locator(".rows li")).to_have_count(1)


# --- outdated messages

WITHOUT_TIMEOUT = """const later = setTimeout;
window.setTimeout = (call, wait, ...more) => (wait === 8000 ? 0 : later(call, wait, ...more));"""
"""Keeps the result of STOP, which would otherwise vanish after 8 seconds."""


def test_message_nothing_is_running_ends_with_next_mission(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server, script=WITHOUT_TIMEOUT)
    expect(page.locator(".headline")).to_be_visible()
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("Nothing is running.")
    server.call("POST", "/api/missions", {"program": HELLO})
    expect(page.locator("#stop-told")).to_have_text("")


def test_message_robot_has_stopped_ends_with_next_mission(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server, script=WITHOUT_TIMEOUT)
    server.run(FAR)
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("The robot has stopped.")
    server.call("POST", "/api/missions", {"program": HELLO})
    expect(page.locator("#stop-told")).to_have_text("")


def test_message_about_a_missing_skill_ends_with_its_line(tmp_path: Path, open_page: OpenPage) -> None:
    (tmp_path / "no_arm.py").write_text(NO_ARM)
    with PageServer(tmp_path, "--robot", "no_arm.py:NoArm") as server:
        page = open_page(server)
        server.call("POST", "/api/missions", {"program": FAILS})
        cannot = page.get_by_text(re.compile("has no .pick. skill"))
        expect(cannot.first).to_be_visible()
        expect(page.locator(".headline")).to_have_text("The program has problems")
        server.call("PUT", "/api/missions/current/program", {"program": HELLO})
        expect(page.locator(".verdict")).to_have_text("Checked: no problems.")
        expect(cannot).to_have_count(0)
        server.call("PUT", "/api/missions/current/program", {"program": FAILS})
        expect(cannot.first).to_be_visible()
        page.context.close()
        server.rest()
        mission = run_to_end(server, FAILS)
        events = server.call("GET", f"/api/missions/{mission}/events.jsonl").text
    assert "before the robot moves: line 3: this robot has no `pick`" in events


LOSES = """
class Spot:
    def rooms(self): return ["hall", "lab"]
    def get_current_location(self): return "hall"
    def stop(self): pass
    def go_to(self, location): pass
    def say(self, message): raise ConnectionError("no route")
"""


def test_a_lost_robot_is_not_said_to_have_stopped(tmp_path: Path, open_page: OpenPage) -> None:
    (tmp_path / "loses.py").write_text(LOSES)
    with PageServer(tmp_path, "--robot", "loses.py:Spot") as server:
        page = open_page(server)
        run_to_end(server, "def task_program():\n    say('a')\n")
        expect(page.locator(".headline")).to_have_text("Failed")
        server.call("POST", "/api/missions", {"program": "def task_program():\n    go_to('lab')\n"})
        expect(page.locator(".status .lost")).to_contain_text("no route")
        page.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        expect(page.locator("#stop-told")).to_contain_text("may still move")
        expect(page.locator(".status .lost")).to_contain_text("no route")
        page.context.close()
        server.rest()
