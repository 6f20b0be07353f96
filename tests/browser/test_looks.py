"""Every page is accessible at every size, light and dark; screenshots are taken for the guide."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from pageserver import PageServer
from viewing import SCREENS, OpenPage, Screen, Shoot, expect_no_grave_fault

OFFICE = (Path(__file__).parents[2] / "examples" / "office.yaml").read_text()
PROBLEMS = """def task_program():
    for room in ["printer room 1", "printer room 2"]:
        go_to(room)
        if not is_in_room("stapler"):
            say("There is no stapler in " + room)
    go_to("alice office")
    answer = ask("alice", "Shall I order one?", ["Yes", "No"])
    say("You said " + answer)
"""


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("office"), "--speed", "3", world=OFFICE) as server:
        yield server


@pytest.mark.parametrize("screen", SCREENS, ids=lambda screen: screen[0])
def test_pages(
    office: PageServer,
    open_page: OpenPage,
    shoot: Shoot,
    screen: Screen,
) -> None:
    which, size, dark = screen
    page = open_page(office, size=size, dark=dark)

    def look(name: str) -> None:
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(400)
        shoot(page, f"{name}-{which}")
        expect_no_grave_fault(page)

    expect(page.locator(".picks .pick").first).to_be_visible()
    look("empty")
    page.locator(".picks .pick").first.click()
    page.get_by_role("button", name="Write the program").click()
    expect(page.get_by_role("button", name="Run it on the robot")).to_be_enabled()
    look("checked")
    page.get_by_role("button", name="Run it on the robot").click()
    expect(page.locator(".moment", has_text="→ found")).to_be_visible()
    expect(page.locator(".strip:not(.other) .reached").nth(2)).to_be_visible()
    look("running")
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("The robot has stopped.")
    look("stopped")
    mission = office.call("POST", "/api/missions", {"program": PROBLEMS}).data["id"]
    expect(page.locator(".problem-line")).to_be_visible()
    look("problems")
    office.rest()
    for name, path in (("missions", "missions"), ("mission", f"missions/{mission}")):
        page.goto(f"{office.inside}/{path}")
        expect(page.locator("h1")).to_be_visible()
        look(name)
