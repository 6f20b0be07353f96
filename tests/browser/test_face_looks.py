"""The face is accessible and complete at every size, light and dark; screenshots are taken."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from faces import HEARING, SPEAKING
from pageserver import PageServer
from viewing import SCREENS, OpenPage, Screen, Shoot, expect_no_grave_fault

OFFICE = (Path(__file__).parents[2] / "examples" / "office.yaml").read_text()
LONG = (
    "Good afternoon. The elevator on the third floor is being repaired until four o'clock. If you need to go "
    "upstairs, please take the one beside the supply room, or ask me to carry something for you."
)
VISIT = f"""def task_program():
    say("Good morning!")
    go_to("alice's office")
    answer = ask("alice", "Shall I bring you a stapler?", ["Yes, please", "No, thank you", "Ask me later"])
    say("I will see to it: " + answer)
    ask("alice", "{LONG} Which of these would help you?", ["Choice " + str(n) for n in range(14)])
    say("{LONG}")
"""


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("office"), "--face", "--speed", "4", world=OFFICE) as server:
        yield server


def expect_in_sight(page: Page) -> None:
    """Expect STOP in its place, nothing wider than the screen, and no covered answer."""
    size = page.viewport_size
    assert size is not None
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    box = page.locator("#stop").bounding_box()
    assert box is not None
    assert (box["y"], box["x"] + box["width"] <= size["width"]) == (7, True)
    for button in page.locator("#options button").all():
        button.click(trial=True)
        told = button.bounding_box()
        assert told is not None
        assert told["height"] >= 44
        assert button.evaluate("e => e.scrollWidth <= e.clientWidth")


def expect_names_beside_stop(page: Page) -> None:
    """Expect the names of all pages and parts to be readable, each in one line."""
    stop, size = page.locator("#stop").bounding_box(), page.viewport_size
    assert stop is not None
    assert size is not None
    for link in page.locator("nav a:visible").all():
        box = link.bounding_box()
        assert box is not None
        is_above = box["y"] < 60
        assert box["x"] + box["width"] <= (stop["x"] if is_above else size["width"])
        assert box["y"] + box["height"] <= (60 if is_above else size["height"])
        assert link.evaluate(
            "e => { const r = document.createRange(); r.selectNodeContents(e); "
            "return r.getClientRects().length === 1 && e.scrollWidth <= e.clientWidth; }"
        )


@pytest.mark.parametrize("screen", SCREENS, ids=lambda screen: screen[0])
def test_face(office: PageServer, open_page: OpenPage, shoot: Shoot, screen: Screen) -> None:
    which, size, dark = screen
    office.rest()
    page = open_page(office, size=size, dark=dark, link=office.face_link, script=SPEAKING + HEARING)
    operator = open_page(office, size=size, dark=dark)

    def look(name: str, at: Page = page) -> None:
        at.wait_for_timeout(500)
        shoot(at, f"{name}-{which}", full_page=False)
        expect_no_grave_fault(at)
        if at is page:
            expect_in_sight(page)
        else:
            expect_names_beside_stop(at)

    expect(page.locator("#doing")).not_to_be_empty()
    look("face-idle")
    office.run(VISIT, despite_problems=True)
    expect(page.locator("#said p").last).to_have_text("Good morning!")
    look("face-says")
    expect(page.locator("body[data-doing=moving]")).to_be_visible()
    look("face-moves")
    expect(page.locator("#options button")).to_have_count(3)
    look("face-asks")
    expect(operator.locator(".asking")).to_be_visible()
    operator.locator(".asking").scroll_into_view_if_needed()
    look("operator-asked", operator)
    page.get_by_role("switch", name="Answer by voice").click()
    ends = time.monotonic() + 60
    while not page.evaluate("window.listening.length"):
        assert time.monotonic() < ends
    page.evaluate("hear('yes please')")
    expect(page.locator("#take")).to_be_visible()
    look("face-heard")
    page.locator("#take").click()
    expect(page.locator("#options button")).to_have_count(14)
    page.evaluate("hear('none of these')")
    look("face-asks-much")
    page.locator("#options button").nth(2).click()
    expect(page.locator("#said p").last).to_have_text(LONG)
    expect(page.locator("body[data-doing=idle]")).to_be_visible()
    look("face-ended")
