"""A person can operate a robot from a browser, without a terminal."""

from __future__ import annotations

import itertools
import json
import re
import signal
import time
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from pageserver import PageServer
from server import Fault, Server
from viewing import DESK, PATIENCE, PHONE, TABLET, OpenPage, wait_until

TEA = """def task_program():
    get_all_rooms()
    go_to("study")
    answer = ask("ann", "Would you like tea?", ["Yes", "No"])
    if answer == "Yes":
        go_to("kitchen")
        say("Tea for ann, please")
"""
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"
BAD = "def task_program():\n    go_to('hall')\n    go_to('cellar')\n"
OFFICE = (Path(__file__).parents[2] / "examples" / "office.yaml").read_text()
NUMBERS = itertools.count(1)
STALL = """() => {
    const connection = window.socket.io.engine.transport.ws;
    const [receive, held] = [connection.onmessage, []];
    connection.onmessage = (message) => held.push(message);
    window.release = () => { connection.onmessage = receive; held.forEach((each) => receive(each)); };
}"""
"""Holds back all that the server sends, until `release` is called."""
STALL_SENDING = """() => {
    const connection = window.socket.io.engine.transport.ws;
    const [send, held] = [connection.send.bind(connection), []];
    connection.send = (message) => held.push(message);
    window.release = () => { connection.send = send; held.forEach((each) => send(each)); };
}"""
"""Holds back all that the page sends over its websocket, until `release` is called."""


def write(page: Page, program: str) -> None:
    """Replace the program in the editor, once the editor has started."""
    expect(page.locator("[data-started] .cm-content")).to_be_visible()
    page.locator(".cm-content").click()
    page.keyboard.press("Control+a")
    page.keyboard.insert_text(program)


def type_and_check(page: Page, program: str) -> None:
    """Type a program that no earlier test has typed, and wait for its check."""
    mark = f"# {next(NUMBERS)}"
    write(page, f"{program}{mark}\n")
    wait_until(
        page,
        """async (mark) => {
            const now = await (await fetch("api/missions/current")).json();
            return now.program.includes(mark) && now.state === "checked" && !now.busy;
        }""",
        mark,
    )
    expect(page.locator(".cm-content")).to_contain_text(mark)
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()


def run(page: Page, program: str) -> None:
    type_and_check(page, program)
    page.get_by_role("button", name="Run it on the robot").click()
    expect(page.locator(".headline")).to_have_text("Running")


def text_of(page: Page) -> str:
    """Return the text in the editor."""
    return "\n".join(page.locator(".cm-line").all_inner_texts())


@pytest.fixture(autouse=True)
def stop_robot(server: PageServer) -> None:
    """Start every test with a robot that does nothing."""
    server.rest()


def test_from_an_instruction_to_the_end(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, "--speed", "40", world=OFFICE) as server:
        page = open_page(server)
        page.locator(".picks .pick").first.click()
        page.get_by_role("button", name="Write the program").click()
        expect(page.get_by_text("A recorded program, not written by a language model.")).to_be_visible()
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        assert page.locator(".strip .scene").count() > 3
        assert "def task_program" in text_of(page)
        assert page.locator(".cm-content .skill").count() > 2
        expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
        page.get_by_role("button", name="Run it on the robot").click()
        expect(page.locator(".headline")).to_have_text("Done")
        assert page.locator(".moment").count() > 5
        page.context.close()


def test_a_program_is_seen_while_it_is_written(tmp_path: Path, open_page: OpenPage) -> None:
    with (
        Server(fault=lambda _: Fault.DRIP) as model,
        PageServer(tmp_path, "--model", "completions:slow", "--base-url", model.url) as server,
    ):
        page = open_page(server)
        page.locator("textarea").fill("Say hello")
        page.locator("textarea").press("Control+Enter")
        expect(page.get_by_role("button", name="Writing …")).to_be_disabled()
        expect(page.locator(".cm-line").first).not_to_be_empty()
        before = len(text_of(page))
        page.wait_for_function(f"document.querySelector('.cm-content').innerText.length > {before}")
        other = open_page(server)
        expect(other.locator(".cm-line").first).not_to_be_empty()
        other.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        expect(page.get_by_role("button", name="Write the program")).to_be_enabled()
        page.context.close()
        other.context.close()


def test_page_shows_speech_questions_and_answers(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    run(page, TEA)
    expect(page.locator(".doing")).to_have_text(re.compile("Drives to"))
    expect(page.get_by_text("line 3", exact=False)).to_be_visible()
    expect(page.locator(".headline")).to_have_text("Done")
    expect(page.locator(".moment-ask")).to_contain_text("Would you like tea?")
    expect(page.locator(".moment-answer .text")).to_have_text("Yes")
    expect(page.locator(".moment-say .text")).to_have_text("Tea for ann, please")
    expect(page.locator(".floorplan .here")).to_have_count(1)


def test_every_tab_and_every_reload_shows_the_same(server: PageServer, open_page: OpenPage) -> None:
    first = open_page(server)
    type_and_check(first, TEA)
    second, elsewhere = open_page(server, beside=first), open_page(server, size=PHONE)
    for page in (second, elsewhere):
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        expect(page.locator(".cm-content")).to_contain_text("Tea for ann, please")
        assert TEA in text_of(page)
    write(elsewhere, FAR)
    for page in (first, second):
        expect(page.locator(".cm-content")).to_contain_text("range(50)")
    first.reload()
    expect(first.locator(".cm-content")).to_contain_text("range(50)")
    expect(first.get_by_role("button", name="Run it on the robot")).to_be_enabled()
    first.get_by_role("button", name="Run it on the robot").click()
    for page in (first, second, elsewhere):
        expect(page.locator(".headline")).to_have_text("Running")


def test_edit_is_checked_and_problems_stand_at_their_lines(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    write(page, BAD)
    page.wait_for_selector(".cm-line.problem-line")
    expect(page.locator(".cm-line.problem-line")).to_contain_text('there is no room "cellar"')
    assert page.locator(".cm-line.problem-line").evaluate("e => [...e.parentNode.children].indexOf(e)") == 2
    for width, height in (DESK, TABLET, PHONE):
        page.set_viewport_size({"width": width, "height": height})
        box, editor = (page.locator(part).bounding_box() for part in (".problem-words", ".editor"))
        assert box is not None
        assert editor is not None
        assert box["x"] + box["width"] <= editor["x"] + editor["width"]
    page.set_viewport_size({"width": DESK[0], "height": DESK[1]})
    page.reload()
    expect(page.locator(".cm-line.problem-line")).to_have_count(1)
    button = page.get_by_role("button", name="Run it on the robot")
    expect(button).to_be_disabled()
    page.get_by_text("Run it despite the problems").click()
    expect(button).to_be_enabled()
    write(page, BAD.replace("cellar", "kitchen"))
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()
    expect(page.locator(".problem-line")).to_have_count(0)


def test_only_what_this_browser_shows_is_approved(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    button = page.get_by_role("button", name="Run it on the robot")
    expect(button).to_be_enabled()
    button.evaluate("""(button) => {
        const show = programEditor.show;
        programEditor.show = (what) => what.force && show(what);  // no other update arrives
        const pane = Object.values(mounted_app.$refs).find((each) => each?.editor);
        pane.emitting = false;
        pane.editor.dispatch({changes: {from: 0, insert: "# something else\\n"}});
        pane.emitting = true;
        button.click();
    }""")
    expect(page.get_by_text("review it again")).to_be_visible()
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
    expect(page.locator(".cm-content")).not_to_contain_text("something else")


def replace_while_stalled(server: PageServer, page: Page) -> Locator:
    """Replace the program on a page that hears nothing from the server, and return the button to run it."""
    type_and_check(page, TEA)
    button = page.get_by_role("button", name="Run it on the robot")
    expect(button).to_be_enabled()
    page.evaluate(STALL)
    server.call("POST", "/api/missions", {"program": FAR})
    wait_until(page, "fetch('api/missions/current').then(a => a.json()).then(a => a.state === 'checked')")
    page.wait_for_timeout(2_500)  # longer than the server refuses clicks
    return button


def test_a_click_on_a_stalled_connection_approves_only_what_it_was_made_for(
    server: PageServer, open_page: OpenPage
) -> None:
    page = open_page(server)
    replace_while_stalled(server, page).click()
    page.wait_for_timeout(500)
    page.evaluate("release()")
    expect(page.get_by_text("review it again")).to_be_visible()
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
    expect(page.locator(".cm-content")).to_contain_text("range(50)")


@pytest.mark.parametrize("key", ["Escape", "STOP"])
def test_a_click_on_a_stalled_connection_does_not_outlive_a_stop(
    server: PageServer, open_page: OpenPage, key: str
) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    button = page.get_by_role("button", name="Run it on the robot")
    expect(button).to_be_enabled()
    page.evaluate(STALL_SENDING)
    button.click()
    page.wait_for_timeout(300)
    if key == "STOP":
        page.get_by_role("button", name="STOP").click()
    else:
        page.keyboard.press(key)
    page.wait_for_timeout(500)
    page.evaluate("release()")
    expect(page.get_by_text("look at the program again")).to_be_visible()
    state = server.call("GET", "/api/missions/current").data["state"]
    assert state == ("stopped" if key == "STOP" else "checked")


def test_a_click_as_a_stalled_connection_recovers_approves_nothing(
    server: PageServer, open_page: OpenPage
) -> None:
    page = open_page(server)
    replace_while_stalled(server, page).evaluate("""async (button) => {
        release();
        while (!programEditor.text().includes("range(50)")) await new Promise((r) => setTimeout(r, 5));
        button.disabled = false;
        button.click();
    }""")
    expect(page.get_by_text("review it again")).to_be_visible()
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")


def test_checks_keep_text_that_is_typed_meanwhile(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    write(page, TEA)
    page.keyboard.press("Control+End")
    typed = "# words with a pause in which a check begins, and words while it goes on, over and over"
    for number, letter in enumerate(typed):
        page.keyboard.type(letter)
        page.wait_for_timeout(400 if number % 8 == 0 else 30)
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()
    assert text_of(page).endswith(typed)
    while not server.call("GET", "/api/missions/current").data["program"].endswith(typed):
        page.wait_for_timeout(50)
    assert text_of(page).endswith(typed)


def wait_until_same(server: PageServer, first: Page, second: Page) -> None:
    """Wait until two pages show the program that the tool has."""

    def shown() -> set[str]:
        texts = {page.evaluate("programEditor.text()") for page in (first, second)}
        return texts | {server.call("GET", "/api/missions/current").data["program"]}

    end = time.monotonic() + PATIENCE
    while len(shown()) > 1:
        assert time.monotonic() < end
        first.wait_for_timeout(50)


def test_two_people_who_type_at_once_get_the_same_text(server: PageServer, open_page: OpenPage) -> None:
    first, second = open_page(server), open_page(server)
    type_and_check(first, TEA)
    expect(second.locator(".cm-content")).to_contain_text("Tea for ann")
    for page in (first, second):
        page.locator(".cm-content").click()
        page.keyboard.press("Control+End")
    for number in range(8):
        first.keyboard.type(f"# first {number}\n")
        second.keyboard.type(f"# second {number}\n")
        first.wait_for_timeout(150 * (number % 4))
    wait_until_same(server, first, second)
    first.keyboard.type("# the end of it\n")
    expect(second.locator(".cm-content")).to_contain_text("the end of it")
    wait_until_same(server, first, second)


def test_slower_of_two_edits_is_refused_with_a_message(server: PageServer, open_page: OpenPage) -> None:
    first, second = open_page(server), open_page(server)
    type_and_check(first, TEA)
    expect(second.locator(".cm-content")).to_contain_text("Tea for ann")
    for page in (first, second):
        page.locator(".cm-content").click()
        page.keyboard.press("Control+End")
    second.evaluate("programEditor.show = () => {}")  # The tool's message comes too late.
    first.keyboard.insert_text("# of the first\n")
    expect(first.get_by_text("Checked: no problems.")).to_be_visible()
    while "# of the first" not in server.call("GET", "/api/missions/current").data["program"]:
        first.wait_for_timeout(50)
    second.keyboard.insert_text("# of the second\n")
    expect(second.get_by_text("Someone else changed the program")).to_be_visible()
    assert "# of the second" not in server.call("GET", "/api/missions/current").data["program"]


def test_text_typed_just_before_a_click_is_checked_and_kept(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    button = page.get_by_role("button", name="Run it on the robot")
    expect(button).to_be_enabled()
    page.locator(".cm-content").click()
    page.keyboard.press("Control+End")
    page.keyboard.insert_text("# one more")
    button.evaluate("button => button.click()")
    expect(page.get_by_text("Checking your last edit first.")).to_be_visible()
    wait_until(
        page,
        "fetch('api/missions/current').then(a => a.json()).then(a => a.program.endsWith('# one more'))",
    )
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
    expect(page.locator(".cm-content")).to_contain_text("# one more")


def test_undo_reverts_only_own_edits(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    page.keyboard.insert_text("# mine")
    expect(page.locator(".cm-content")).to_contain_text("# mine")
    server.call("PUT", "/api/missions/current/program", {"program": FAR})
    expect(page.locator(".cm-content")).to_contain_text("range(50)")
    for _ in range(5):
        page.keyboard.press("Control+z")
    expect(page.locator(".cm-content")).to_contain_text("range(50)")


def test_a_program_that_is_too_long_is_refused_in_a_sentence(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    page.locator(".cm-content").click()
    page.keyboard.press("Control+a")
    page.keyboard.insert_text("# " + "x" * 200_000)
    expect(page.get_by_text("The limit is 200,000 characters")).to_be_visible()
    expect(page.locator(".cm-content")).to_contain_text("Tea for ann, please")


def test_approval_despite_problems_is_for_one_program(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    write(page, BAD)
    page.get_by_text("Run it despite the problems").click()
    write(page, BAD.replace("cellar", "attic"))
    expect(page.locator(".problem-line")).to_contain_text("attic")
    expect(page.get_by_role("button", name="Run it on the robot")).to_be_disabled()


@pytest.mark.parametrize("how", ["click", "Escape"])
def test_stop_ends_what_the_robot_does(server: PageServer, open_page: OpenPage, how: str) -> None:
    page = open_page(server)
    run(page, FAR)
    if how == "click":
        page.locator("#stop").click()
    else:
        page.keyboard.press("Escape")
    expect(page.locator("#stop-told")).to_have_text("The robot has stopped.")
    expect(page.locator(".headline")).to_have_text("Stopped")
    assert server.call("GET", "/api/robot").data["state"] == "stopped"


def test_a_stop_before_the_robot_moves_discards_the_program(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("Discarded before it ran.")
    expect(page.locator(".reason")).to_have_text("stopped from the page before it ran")


def test_recent_instructions_are_up_to_date(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, world=OFFICE) as server:
        page = open_page(server)
        page.locator(".pick").first.click()
        page.get_by_role("button", name="Write the program").click()
        page.get_by_role("button", name="Run it on the robot").click()
        expect(page.locator(".headline")).to_have_text("Running")
        page.reload()
        expect(page.get_by_text("Recent")).to_be_visible()
        expect(page.locator(".pick .state")).to_have_count(0)
        page.locator("#stop").click()
        expect(page.locator(".pick .state")).to_have_text("stopped")
        expect(page.get_by_role("button", name="Start again from the beginning")).to_be_visible()
        page.context.close()


def test_an_unknown_instruction_leads_to_known_ones(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, world=OFFICE) as server:
        page = open_page(server)
        page.locator("textarea").fill("Go to the lobby.")
        page.get_by_role("button", name="Write the program").click()
        expect(page.locator(".trouble")).to_contain_text("OPENAI_API_KEY")
        offered = page.locator(".picks", has_text="Instructions it knows").locator(".pick")
        expect(offered).to_have_count(3)
        offered.first.click()
        expect(page.locator("textarea")).to_have_value(offered.first.locator("span").inner_text())
        page.get_by_role("button", name="Write the program").click()
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        page.context.close()


def test_an_empty_editor_says_that_programs_can_be_typed(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path) as server:
        page = open_page(server)
        expect(page.locator("[data-started]")).to_be_visible()
        shown = "getComputedStyle(document.querySelector('.cm-content'), '::before').content"
        assert "def task_program():" in page.evaluate(shown)
        type_and_check(page, TEA)
        assert page.evaluate(shown) == "none"
        expect(page.get_by_text("Your own program, without an instruction.")).to_be_visible()
        page.context.close()


def test_escape_keeps_a_waiting_program(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    type_and_check(page, TEA)
    page.keyboard.press("Escape")
    page.wait_for_timeout(500)
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")


def test_stop_works_before_scripts_arrive(server: PageServer, open_page: OpenPage) -> None:
    """The page is reloading, and none of NiceGUI's scripts has arrived."""
    page = open_page(server)
    run(page, FAR)
    held: list[Route] = []

    def hold(route: Route) -> None:  # Playwright rejects built-in functions.
        held.append(route)

    page.context.route("**/_nicegui/**/*.js", hold)
    page.reload(wait_until="commit")
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("The robot has stopped.")
    assert held
    assert page.locator(".headline").count() == 0


def test_stop_is_confirmed_only_after_it_worked(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    run(page, FAR)
    answer = {"state": "stopping", "reason": "", "is_over": False}
    page.route("**/api/robot?once=over", lambda route: route.fulfill(body=json.dumps(answer)))
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("Stop sent. Waiting for the robot to confirm …")
    page.wait_for_timeout(500)
    expect(page.locator("#stop-told")).to_have_text("Stop sent. Waiting for the robot to confirm …")


def test_unreachable_tool_is_reported(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    page.route("**/api/stop*", lambda route: route.fulfill(body="lost"))
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_contain_text("emergency stop")


def test_stop_that_is_not_answered_for_seconds_is_reported(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    held: list[Route] = []
    page.route("**/api/stop*", lambda route: held.insert(0, route))
    page.locator("#stop").click()
    expect(page.locator("#stop-told")).to_have_text("Sending the stop …")
    expect(page.locator("#stop-told")).to_contain_text("emergency stop")
    held[0].continue_()
    expect(page.locator("#stop-told")).to_have_text("Nothing is running.")


def test_stop_is_always_in_the_same_place_and_nothing_is_wider_than_the_screen(
    server: PageServer, open_page: OpenPage
) -> None:
    places = set()
    page = open_page(server)
    type_and_check(page, TEA + "    # " + "a long line " * 30 + "\n")
    for path in ("/", "/missions", "/missions/" + server.call("GET", "/api/robot").data["mission"]):
        page.goto(f"{server.inside}{path}")
        expect(page.locator("h1, h2").first).to_be_visible()
        for width, height in (DESK, TABLET, PHONE):
            page.set_viewport_size({"width": width, "height": height})
            page.mouse.wheel(0, 3000)
            page.wait_for_timeout(200)
            box = page.locator("#stop").bounding_box()
            assert box is not None
            places.add((width, box["x"], box["y"]))
            assert box["x"] + box["width"] <= width
            assert page.evaluate("document.documentElement.scrollWidth") <= width, path
    assert len(places) == 3


def test_a_robot_keeps_its_mission_when_the_page_closes(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    run(page, FAR)
    page.context.close()
    time.sleep(1)
    assert server.call("GET", "/api/robot").data["state"] == "running"


def test_many_tabs_stay_in_step(server: PageServer, open_page: OpenPage) -> None:
    first = open_page(server)
    pages = [first, *(open_page(server, beside=first) for _ in range(5))]
    run(first, FAR)
    for page in pages:
        expect(page.locator(".headline")).to_have_text("Running")
    pages[3].keyboard.press("Escape")
    for page in pages:
        expect(page.locator(".headline")).to_have_text("Stopped")


def test_examples_are_seen_whole_and_taken_by_a_click(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, world=OFFICE) as server:
        page = open_page(server)
        for pick in page.locator(".pick").all():
            words = pick.locator("span")
            assert words.evaluate("e => e.scrollHeight <= e.clientHeight"), words.inner_text()
            pick.click()
            expect(page.locator("textarea").first).to_have_value(words.inner_text())
        assert (
            page.locator(".pick").first.evaluate("e => getComputedStyle(e).borderTopColor")
            != "rgba(0, 0, 0, 0)"
        )
        page.context.close()


def is_in_sight(page: Page, name: str) -> bool:
    """Return whether a button can be pressed without scrolling, above the names of the pages."""
    box = page.get_by_role("button", name=name).bounding_box()
    pages = page.locator(".pages").bounding_box()
    assert box is not None
    assert pages is not None
    return box["y"] > 60 and box["y"] + box["height"] < pages["y"]


def test_phone_shows_the_next_step_first(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, "--face", "--speed", "2", world=OFFICE) as server:
        page = open_page(server, size=PHONE)
        page.locator(".pick").last.scroll_into_view_if_needed()
        page.locator(".pick").last.click()
        page.wait_for_function("scrollY === 0")
        assert is_in_sight(page, "Write the program")
        page.get_by_role("button", name="Write the program").click()
        expect(page.get_by_role("button", name="Run it on the robot")).to_be_enabled()
        page.wait_for_function("scrollY === 0")
        assert is_in_sight(page, "Run it on the robot")
        page.locator(".parts").get_by_text("Status").click()
        expect(page.locator(".map")).to_be_in_viewport()
        page.locator(".parts").get_by_text("Program").click()
        page.get_by_role("button", name="Run it on the robot").click()
        expect(page.locator(".headline")).to_have_text("Running")
        expect(page.locator(".headline")).to_be_in_viewport()
        page.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        expect(page.locator(".headline")).to_be_in_viewport()
        told, status = (page.locator(part).bounding_box() for part in ("#stop-told", "#h-status"))
        assert told is not None
        assert status is not None
        assert told["y"] + told["height"] < status["y"]
        page.locator(".pick").last.scroll_into_view_if_needed()
        page.locator(".pick").last.click()
        expect(page.locator("textarea").first).to_be_in_viewport()
        assert is_in_sight(page, "Write the program")
        page.context.close()


def test_page_of_a_killed_tool_is_disabled(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path) as server:
        pages = [open_page(server, size=size, expecting="ERR_CONNECTION_REFUSED") for size in (DESK, PHONE)]
        for page in pages:
            expect(page.locator(".headline")).to_be_visible()
            page.wait_for_load_state("networkidle")
        server.end(signal.SIGKILL)
        for page in pages:
            page.wait_for_selector("#popup[aria-hidden=false]")
            message = page.locator("#popup").evaluate("e => getComputedStyle(e, '::before').content")
            assert "use its emergency stop" in message
            for pane in page.locator(".pane").all():
                assert pane.evaluate("e => getComputedStyle(e.parentNode).filter") == "grayscale(1)"
                assert pane.evaluate("e => getComputedStyle(e).pointerEvents") == "none"
            page.locator("#stop").click()  # Nothing covers the button.
            expect(page.locator("#stop-told")).to_contain_text("emergency stop")
            page.context.close()


def test_past_missions_are_shown_and_downloaded(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    run(page, TEA)
    expect(page.locator(".headline")).to_have_text("Done")
    page.get_by_role("link", name="Missions").click()
    expect(page.locator(".rows .state-done").first).to_be_visible()
    expect(page.locator(".rows a").first).to_contain_text('typed: get_all_rooms() go_to("study") answer')
    page.locator(".rows a").first.click()
    expect(page.locator(".pages [aria-current]")).to_have_text("Missions")
    expect(page.locator(".timeline")).to_contain_text("Would you like tea?")
    expect(page.locator(".timeline .text").first).to_have_text("Mission created")
    expect(page.locator(".timeline .text").last).to_have_text("Done")
    assert not re.search(r"drafting|^checked$|\(\)", page.locator(".timeline").inner_text(), re.MULTILINE)
    expect(page.locator(".source")).to_contain_text("task_program")
    for link, begins in (("Events", b'{"time"'), ("MCAP", b"\x89MCAP")):
        with page.expect_download() as download:
            page.get_by_role("link", name=link).click()
        assert Path(download.value.path()).read_bytes().startswith(begins)


def test_page_shows_how_a_mission_ended_after_the_tool_died(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path) as server:
        page = open_page(server)
        run(page, FAR)
        expect(page.locator(".doing")).to_have_text(re.compile("Drives to"))
        page.context.close()
        server.end(signal.SIGKILL)
    with PageServer(tmp_path) as server:
        page = open_page(server)
        expect(page.locator(".interrupted").first).to_contain_text("ended unexpectedly during go_to")
        page.get_by_role("button", name="Dismiss").click()
        expect(page.locator(".interrupted").first).to_be_hidden()
        page.context.close()


def test_missing_token_is_explained(server: PageServer) -> None:
    answer = server.ask("GET", "/", accept="text/html")
    assert "open the printed link" in answer.text


def test_replacing_program_cannot_be_approved_at_once(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
    button = page.get_by_role("button", name="Run it on the robot")
    for program, is_first in ((TEA, True), (TEA.replace("tea", "milk").replace("Tea", "Milk"), False)):
        server.call("POST", "/api/missions", {"program": program})
        expect(page.locator(".cm-content")).to_contain_text("like tea" if is_first else "like milk")
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        if not is_first:
            button.evaluate("button => { button.disabled = false; button.click(); }")
            expect(page.get_by_text("review it again")).to_be_visible()
            expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
            page.wait_for_timeout(2_000)
        expect(button).to_be_enabled()
    button.click()
    expect(page.locator(".headline")).to_have_text("Running")


def test_new_mission_cannot_be_approved_at_once_even_if_typed_here(
    server: PageServer, open_page: OpenPage
) -> None:
    page = open_page(server)
    button = page.get_by_role("button", name="Run it on the robot")
    write(page, TEA)
    expect(button).to_be_enabled()
    server.call("POST", "/api/missions", {"program": TEA})
    expect(button).to_be_disabled()
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()
    button.evaluate("button => { button.disabled = false; button.click(); }")
    expect(page.get_by_text("review it again")).to_be_visible()
    expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
