"""The page continues a mission that ended early: it shows the finished steps and repeats none."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from codebotler.core.world import Person, Room, World
from codebotler.missions.storage.log import MissionState, MissionSummary
from ended import cut, failed_mission, line_of
from pageserver import PageServer
from viewing import DESK, PHONE, SCREENS, OpenPage, Screen, Shoot, expect_no_grave_fault, write

STAPLERS = "Check every printer room for a stapler, and come back and tell me which have none."
SMALL = World(
    (Room("hall"), Room("kitchen", ("mug",)), Room("study", people=(Person("ann", ("yes",)),))), "hall"
)
BRING = """def task_program():
    go_to("kitchen")
    say("I take the mug now.")
    pick("mug")
    say("I have the mug.")
    go_to("nowhere")
"""


def press(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


def look(page: Page, shoot: Shoot, name: str) -> None:
    page.evaluate("scrollTo(0, 0)")
    page.wait_for_timeout(400)
    shoot(page, name)
    expect_no_grave_fault(page)


@pytest.mark.parametrize("screen", SCREENS, ids=lambda screen: screen[0])
def test_continue(tmp_path: Path, open_page: OpenPage, shoot: Shoot, screen: Screen) -> None:
    which, size, dark = screen
    with PageServer(tmp_path, "--speed", "3", serve=("codebotler", "serve")) as server:
        page = open_page(server, size=size, dark=dark)
        expect(page.get_by_role("button", name="Continue")).to_be_hidden()
        page.locator("textarea").fill(STAPLERS)
        press(page, "Write the program")
        press(page, "Run it on the robot")
        expect(page.locator(".moment", has_text="→ not found").first).to_be_visible()
        page.locator("#stop").click()
        expect(page.get_by_role("button", name="Continue", exact=True)).to_be_visible()
        expect(page.get_by_role("button", name="Start again from the beginning")).to_be_visible()
        expect(page.locator(".scene.stopped").first).to_be_visible()
        expect(page.locator(".strip .ending.good")).to_have_count(0)
        look(page, shoot, f"continue-offered-{which}")
        press(page, "Continue")
        expect(page.get_by_role("button", name="Run it on the robot")).to_be_enabled()
        expect(page.locator(".done-before li")).to_have_count(2)
        expect(page.locator(".storyboard h3")).to_have_text("What the rest would do")
        expect(page.locator(".repeated")).to_have_count(0)
        expect(page.locator(".scene .room").first).to_have_text("printer room 1")
        look(page, shoot, f"continue-{which}")
        press(page, "Run it on the robot")
        expect(page.locator(".headline")).to_have_text("Done")
        expect(page.get_by_role("button", name="Continue", exact=True)).to_be_hidden()
        expect(page.get_by_role("button", name="Prepare another run")).to_be_hidden()  # It is only the rest.
        page.close()  # The page would reconnect after the server ends.


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_a_person_is_asked_about_an_unsure_step_and_types_the_rest(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot, size: tuple[int, int]
) -> None:
    folder = failed_mission(tmp_path / "home", BRING, SMALL, "")
    cut(folder, line_of(folder, "pick", "skill"), MissionState.RUNNING)
    with PageServer(tmp_path, "--speed", "40") as server:
        page, other = open_page(server, size=size), open_page(server)
        if size == PHONE:
            expect(page.locator(".interrupted .primary")).to_be_in_viewport(ratio=1)
        press(page, f"Continue mission {folder.name}")
        card = page.locator(".q-dialog .pane")
        expect(card).to_contain_text('picked up "mug" in "kitchen"')
        expect(card.locator(".quiet")).to_have_count(2)
        expect(card.locator(".quiet").first).to_contain_text("kitchen")
        press(page, "Cancel")
        expect(card).to_be_hidden()
        press(page, f"Continue mission {folder.name}")
        expect(card).to_be_visible()
        page.wait_for_timeout(400)
        evidence, button = (card.locator(each).bounding_box() for each in (".quiet >> nth=-1", ".word"))
        assert evidence is not None
        assert button is not None
        assert evidence["y"] + evidence["height"] <= button["y"], "the buttons cover what the robot says"
        shoot(page, f"continue-asks-{size[0]}", full_page=False)
        expect_no_grave_fault(page)
        late = open_page(server, f"missions/{folder.name}")
        press(late, "Continue")
        expect(late.get_by_role("button", name="It did not happen", exact=True)).to_be_visible()
        press(page, "It happened")
        expect(page.locator(".done-before li")).to_have_count(3)
        press(late, "It did not happen")
        expect(late.locator(".q-notification")).to_be_visible()
        for operator in (page, other):
            expect(operator.locator(".done-before li")).to_have_count(3)
            expect(operator.locator(".done-before li").last).to_contain_text('picked up "mug"')
            expect(operator.locator(".repeated")).to_have_count(1)
            expect(operator.locator(".origin")).to_contain_text("no instruction")
            expect(operator.locator(".interrupted")).to_be_hidden()
            expect(operator.locator(".floorplan .held")).to_have_count(1)
        look(page, shoot, f"continue-typed-{size[0]}")
        write(page, "def task_program():\n    go_to('study')\n    place('mug')\n")
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        expect(page.locator(".repeated")).to_have_count(0)
        press(page, "Run it on the robot")
        expect(page.locator(".headline")).to_have_text("Done")
        expect(other.locator(".done-before li")).to_have_count(3)
        for operator in (page, other, late):
            operator.close()


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_missions_link_to_those_they_continue(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot, size: tuple[int, int]
) -> None:
    first = failed_mission(tmp_path / "home", BRING, SMALL, "").name
    with PageServer(tmp_path, "--speed", "40") as server:
        second = server.call("POST", f"/api/missions/{first}/continue", {}).data["id"]
        server.rest()
        page = open_page(server, "missions", size=size)
        expect(page.locator(".rows .outcome").first).to_contain_text(f"mission {second}")
        expect(page.locator(".rows .outcome").first).to_contain_text(f"continues mission {first}")
        expect(page.locator(".rows .outcome").last).not_to_contain_text("continued by")  # It did not run.
        look(page, shoot, f"continue-list-{size[0]}")
        page.locator(".rows a").first.click()
        expect(page.locator(".chain")).to_have_count(1)
        look(page, shoot, f"continue-link-{size[0]}")
        page.locator(".chain a", has_text=first).click()
        expect(page.get_by_role("button", name="Continue")).to_be_visible()
        expect(page.locator(".chain")).to_have_count(0)
        folder = tmp_path / "home" / "missions" / second
        summary = MissionSummary.read(folder)
        summary.if_tool_dies = "the robot stops"  # Missions that ran have this field.
        summary.write(folder)
        page.reload()
        expect(page.locator(".chain")).to_contain_text(second)
        summary.if_tool_dies = ""
        summary.write(folder)
        page.close()
        page = open_page(server, f"missions/{first}", size=size)
        press(page, "Continue")
        expect(page.locator(".done-before")).to_be_visible()
        page.close()


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_a_mission_in_another_world_is_not_continued(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot, size: tuple[int, int]
) -> None:
    with PageServer(tmp_path, "--speed", "1") as server:
        server.run("def task_program():\n    go_to('study')\n    go_to('kitchen')\n    go_to('study')\n")
        page = open_page(server)
        expect(page.locator(".doing")).to_be_visible()
        page.close()
        mission = server.call("GET", "/api/robot").data["mission"]
        server.end(signal.SIGKILL)
    with PageServer(tmp_path, world="robot: hall\nrooms: [hall, kitchen]\n") as server:
        page = open_page(server, size=size)
        press(page, f"Continue mission {mission}")
        expect(page.get_by_text("ran on another map")).to_be_visible()
        look(page, shoot, f"other-world-{size[0]}")
        page.goto(f"{server.inside}/missions/{mission}")
        press(page, "Continue")
        expect(page.get_by_text("ran on another map")).to_be_visible()
        look(page, shoot, f"other-world-mission-{size[0]}")
        page.close()


def test_many_steps_are_folded(tmp_path: Path, open_page: OpenPage) -> None:
    words = "def task_program():\n    for n in range(20):\n        say(str(n))\n    go_to('nowhere')\n"
    failed_mission(tmp_path / "home", words, SMALL, "")
    with PageServer(tmp_path, "--speed", "40") as server:
        page = open_page(server)
        server.call("POST", "/api/missions/last/continue", {})
        expect(page.locator(".done-before > ol li")).to_have_count(12)
        expect(page.locator(".done-before details li").first).to_be_hidden()
        page.get_by_text("9 earlier steps").click()
        expect(page.locator(".done-before details li").first).to_have_text('in "hall": said "0"')
        page.close()  # The page would reconnect after the server ends.
