"""The robot's face on a separate screen: people see what it does and says, and answer its questions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Route, expect

from faces import ASKS, REFUSED, SPEAKING, TWICE, face_of, last_statement, option, wait_until
from pageserver import PageServer
from server import Server
from viewing import PHONE, OpenPage

TOUCHES = """() => new MutationObserver(() =>
    setTimeout(() => document.querySelector("#options button")?.click(), 100),
).observe(document.getElementById("options"), { childList: true })"""
"""Touches the first answer to each further question a tenth of a second after it appears."""

FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("face"), "--face", "--speed", "2") as server:
        yield server


@pytest.fixture(autouse=True)
def stop_robot(server: PageServer) -> None:
    """Start every test with a robot that does nothing."""
    server.rest()


def test_from_an_instruction_to_an_answer_on_the_face(tmp_path: Path, open_page: OpenPage) -> None:
    """Two browsers are open: the operator's and the robot's tablet."""
    world = (Path(__file__).parents[2] / "examples" / "office.yaml").read_text()
    instruction = "Ask alice in her office whether she wants a stapler, and tell me here what she says."
    program = (
        "def task_program():\n    start = get_current_location()\n    go_to('alice\\'s office')\n"
        "    answer = ask('alice', 'Would you like a stapler?', ['Yes', 'No'])\n    go_to(start)\n"
        "    say('Alice says: ' + answer)\n"
    )
    with (
        Server(answer=lambda _: program) as model,
        PageServer(
            tmp_path,
            *("--face", "--speed", "40", "--model", "completions:m", "--base-url", model.url),
            world=world,
        ) as server,
    ):
        operator, face = open_page(server), face_of(server, open_page)
        expect(face.locator("#doing")).to_have_text("Hello. I have nothing to do right now.")
        operator.locator("textarea").fill(instruction)
        operator.get_by_role("button", name="Write the program").click()
        expect(operator.get_by_text("Checked: no problems.")).to_be_visible()
        assert operator.locator(".strip .scene").count() > 1
        operator.get_by_role("button", name="Run it on the robot").click()
        expect(face.locator("#question")).to_have_text("Would you like a stapler?")
        expect(face.locator("#person")).to_have_text("For alice")
        expect(operator.locator(".asking .question")).to_have_text("Would you like a stapler?")
        expect(operator.get_by_text("The robot's face is open on 1 screen.")).to_be_visible()
        option(face, "No").click()
        expect(operator.locator(".headline")).to_have_text("Done")
        expect(operator.locator(".moment-answer .text")).to_have_text("No")
        expect(last_statement(face)).to_have_text("Alice says: No")
        expect(face.locator("#doing")).to_have_text("I have finished.")
        assert face.evaluate("window.spoken") == ["Would you like a stapler? Yes, No", "Alice says: No"]
        for page in (operator, face):
            page.context.close()


def test_face_shows_what_the_robot_does(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(FAR)
    expect(face.locator("#doing")).to_have_text("On my way to kitchen")
    expect(face.locator("body[data-doing=moving]")).to_be_visible()
    face.locator("#stop").click()
    expect(face.locator("#stop-told")).to_have_text("The robot has stopped.")
    expect(face.locator("#doing")).not_to_have_text("On my way to kitchen")
    expect(face.locator("body[data-doing=idle]")).to_be_visible()
    assert server.call("GET", "/api/robot").data["reason"] == "stopped by a person at the face"


def test_stop_works_before_the_script_of_the_face_arrives(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(FAR)
    expect(face.locator("#doing")).to_have_text("On my way to kitchen")
    held: list[Route] = []

    def hold(route: Route) -> None:  # Playwright rejects built-in functions.
        held.append(route)

    face.route("**/static/face.js", hold)
    face.reload(wait_until="commit")
    face.locator("#stop").click()
    expect(face.locator("#stop-told")).to_have_text("The robot has stopped.")
    assert held
    expect(face.locator("#doing")).to_be_empty()


def test_two_faces_are_in_step_and_the_first_answer_counts(server: PageServer, open_page: OpenPage) -> None:
    one, other = face_of(server, open_page), face_of(server, open_page, PHONE, expecting=REFUSED)
    server.run(ASKS)
    for face in (one, other):
        expect(option(face, "Yes")).to_be_enabled()
    held: list[Route] = []

    def hold(route: Route) -> None:  # Playwright rejects built-in functions.
        held.append(route)

    other.route("**/api/face/answer", hold)
    option(other, "Yes").click()
    option(one, "No, thank you").click()
    for face in (one, other):
        expect(face.locator("#asked")).to_be_hidden()
        expect(last_statement(face)).to_have_text("She says No, thank you")
    held[0].fallback()
    expect(other.locator("#ended")).to_contain_text("closed")


def test_stop_withdraws_the_question(server: PageServer, open_page: OpenPage) -> None:
    operator, face = open_page(server), face_of(server, open_page)
    server.run(ASKS)
    expect(option(face, "Yes")).to_be_enabled()
    operator.locator("#stop").click()
    expect(face.locator("#asked")).to_be_hidden()
    expect(face.locator("#ended")).to_have_text("The question was withdrawn.")
    expect(operator.locator("#stop-told")).to_have_text("The robot has stopped.")
    assert face.evaluate("window.hushed") > 0


def test_a_question_that_nobody_answers_ends(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, "--face", "--speed", "0", "--face-timeout", "2") as server:
        operator, face = open_page(server), face_of(server, open_page)
        server.run(ASKS)
        expect(face.locator("#left")).to_have_text(re.compile(r"^[12] s left to answer$"))
        expect(face.locator("#ended")).to_have_text("Nobody answered in time.")
        expect(operator.locator(".reason")).to_have_text(
            re.compile(r'^line \d+: AskTimeout: nobody answered "Would you like tea\?" within 2 s$')
        )
        for page in (operator, face):
            page.context.close()


def test_operator_sees_that_no_face_is_open_and_can_answer(server: PageServer, open_page: OpenPage) -> None:
    operator = open_page(server)
    server.run(ASKS)
    expect(operator.get_by_text("Open the robot's face")).to_be_visible()
    operator.locator(".asking").get_by_role("button", name="Yes").click()
    expect(operator.locator(".moment-answer .text")).to_have_text("Yes")
    expect(operator.locator(".asking")).to_be_hidden()


def test_face_that_opens_late_shows_the_question(server: PageServer, open_page: OpenPage) -> None:
    server.run(ASKS)
    face = face_of(server, open_page)
    expect(option(face, "Yes")).to_be_enabled()
    face.reload()
    option(face, "Yes").click()
    expect(last_statement(face)).to_have_text("She says Yes")
    assert "Good morning" not in face.evaluate("window.spoken"), "a new face does not repeat old speech"


def test_a_touch_for_one_question_answers_no_other(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(TWICE)
    expect(option(face, "Yes")).to_be_enabled()
    face.evaluate(TOUCHES)
    option(face, "Yes").dblclick()
    expect(face.locator("#question")).to_have_text("Are you sure?")
    expect(option(face, "No")).to_be_enabled()
    option(face, "No").click()
    expect(last_statement(face)).to_have_text("YesNo")


# --- without a mouse


def test_questions_are_answered_by_number_keys(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(ASKS)
    expect(option(face, "Yes")).to_be_enabled()
    face.keyboard.press("9")
    face.keyboard.press("Control+1")
    expect(option(face, "Yes")).to_be_enabled()
    face.keyboard.press("2")
    expect(last_statement(face)).to_have_text("She says No, thank you")


def test_questions_are_answered_by_tab_and_enter(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(ASKS)
    expect(option(face, "Yes")).to_be_enabled()
    for _ in range(10):
        face.keyboard.press("Tab")
        if face.evaluate("document.activeElement.innerText").endswith("Yes"):
            break
    face.keyboard.press("Enter")
    expect(last_statement(face)).to_have_text("She says Yes")


def test_escape_stops_the_robot(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(FAR)
    expect(face.locator("#doing")).to_have_text("On my way to kitchen")
    face.keyboard.press("Escape")
    expect(face.locator("#stop-told")).to_have_text("The robot has stopped.")


def test_face_announces_events_to_screen_readers(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    for where, live in (("#said", "log"), ("#doing", "status"), ("#announce", "alert"), ("#ended", "status")):
        assert face.locator(where).get_attribute("role") == live
    server.run(ASKS)
    expect(face.get_by_role("alert")).to_have_text("The robot asks: Would you like tea?")
    expect(face.get_by_role("group", name="Would you like tea?").get_by_role("button")).to_have_count(2)
    expect(face.get_by_role("log", name="What the robot says")).to_contain_text("Good morning")
    line = face.locator("#said p").first
    line.evaluate("e => e.mark = 1")
    expect(face.locator("#options button").first).to_be_enabled()
    face.keyboard.press("1")
    expect(last_statement(face)).to_have_text("She says Yes")
    assert line.evaluate("e => e.mark") == 1, "an announcement is not written again"


# --- lost and slow connections


def test_face_reports_a_lost_tool_and_reconnects(tmp_path: Path, open_page: OpenPage) -> None:
    tokens = ["--face-token", "the tablet's own", "--token", "the operator's own"]
    with PageServer(tmp_path, "--face", *tokens) as server:
        port = server.port
        face = open_page(
            server,
            link=f"http://localhost:{port}/face?token=the+tablet's+own",
            script=SPEAKING,
            expecting="WebSocket connection",
        )
        expect(face.locator("#doing")).to_have_text("Hello. I have nothing to do right now.")
        face.locator("h1, body").first.click(position={"x": 5, "y": 5})
        server.run("def task_program():\n    for number in range(4):\n        say(str(number))\n")
        wait_until(face, "window.spoken.includes('3')")
    expect(face.locator("#doing")).to_have_text("The robot cannot be reached. Trying again …")
    with PageServer(tmp_path, "--face", *tokens, "--port", str(port)) as server:
        expect(face.locator("#doing")).to_have_text("Hello. I have nothing to do right now.")
        server.run("def task_program():\n    say('here again')\n")
        wait_until(face, "window.spoken.includes('here again')")
        face.context.close()


def test_slow_face_delays_nobody(server: PageServer, open_page: OpenPage) -> None:
    slow, quick = face_of(server, open_page), face_of(server, open_page)
    slow.context.new_cdp_session(slow).send("Emulation.setCPUThrottlingRate", {"rate": 20})
    server.run(ASKS)
    option(quick, "Yes").click()
    expect(last_statement(quick)).to_have_text("She says Yes")
    expect(last_statement(slow)).to_have_text("She says Yes")
