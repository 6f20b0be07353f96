"""After a reply without a program, the page says why and offers ways to go on."""

from __future__ import annotations

import json
from pathlib import Path

from playwright.sync_api import Page, expect

from pageserver import PageServer
from server import Fault, Request, Server
from viewing import DESK, PHONE, OpenPage, Shoot, expect_no_grave_fault

PROGRAM = "Here it is.\n\n```python\ndef task_program():\n    go_to('kitchen')\n    say('hello')\n```\n"
THOUGHTS = "<think>\nFirst to the kitchen.\n```python\ndef draft(): ...\n```\nThat will do.\n</think>\n"


def serve(folder: Path, model: Server, *more: str) -> PageServer:
    return PageServer(folder, "--speed", "0", "--model", "openai-chat:m", "--base-url", model.url, *more)


def ask(page: Page) -> None:
    page.locator("textarea").fill("Say hello in the kitchen")
    page.locator("textarea").press("Control+Enter")


def press(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


WORDS = {
    Fault.EMPTY: "The reply is empty.",
    Fault.WITHOUT_CODE: "The reply holds no code.",
    Fault.TOOL_CALL: "The model called a tool instead of writing a program.",
    Fault.REFUSAL: "The model refused: I can't help with weapons.",
}


def test_a_reply_without_a_program_says_why_and_can_be_asked_for_again(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot
) -> None:
    with Server(answer=lambda _: PROGRAM) as model, serve(tmp_path, model) as server:
        model.faults.extend(WORDS)
        page = open_page(server)
        ask(page)
        for asked, (fault, words) in enumerate(WORDS.items()):
            if asked:
                press(page, "Ask again")
            expect(page.locator(".programless")).to_have_text(words)
            expect(page.locator(".headline")).to_have_text("No program yet")
            expect(page.get_by_role("button", name="Run it on the robot")).to_be_hidden()
            expect(page.get_by_role("button", name="Ask for the program only")).to_be_visible()
            expect(page.get_by_text("SyntaxError")).to_have_count(0)
            expect_no_grave_fault(page)
            shoot(page, f"no-program-{fault.name}")
        press(page, "Ask for the program only")
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
        expect(page.locator(".programless")).to_be_hidden()
        first, *again, repaired = (request.body["messages"] for request in model.requests)
        assert again == [first] * (len(WORDS) - 1)
        assert first != repaired
        page.context.close()


def test_a_filtered_request_is_not_sent_with_advice(tmp_path: Path, open_page: OpenPage) -> None:
    with Server(fault=lambda _: Fault.FILTERED) as model, serve(tmp_path, model) as server:
        page = open_page(server)
        ask(page)
        expect(page.locator(".programless")).to_contain_text("A content filter blocked")
        expect(page.get_by_text("The prompt triggered the content policy")).to_be_visible()
        expect(page.get_by_role("button", name="Ask again", exact=True)).to_be_visible()
        expect(page.get_by_role("button", name="Ask for the program only")).to_be_hidden()
        page.context.close()


def test_a_reply_that_was_cut_off_is_asked_for_with_a_higher_limit(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot
) -> None:
    def answer(_: Request) -> str:
        return THOUGHTS + PROGRAM

    with (
        Server(answer=answer, limits=True) as model,
        serve(tmp_path, model, "--max-tokens", "16") as server,
    ):
        page = open_page(server, size=PHONE)
        ask(page)
        expect(page.locator(".programless")).to_have_text("The reply was cut off at 16 tokens.")
        shoot(page, "no-program-cut-off-phone")
        page.set_viewport_size({"width": DESK[0], "height": DESK[1]})
        shoot(page, "no-program-cut-off")
        press(page, "Raise the limit to 64 tokens")
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        assert [request.body["max_tokens"] for request in model.requests] == [16, 64]
        page.context.close()


def test_a_program_stays_approvable_where_the_next_reply_holds_none(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot
) -> None:
    with Server(answer=lambda _: PROGRAM) as model, serve(tmp_path, model) as server:
        model.faults.extend([None, Fault.REFUSAL])
        page = open_page(server)
        ask(page)
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        press(page, "Ask again")
        expect(page.locator(".programless")).to_contain_text("The previous program is kept.")
        expect(page.locator(".headline")).to_have_text("Ready: waiting for your approval")
        shoot(page, "no-program-but-one-before")
        press(page, "Run it on the robot")
        expect(page.locator(".headline")).to_have_text("Done")
        expect(page.locator(".programless")).to_be_hidden()
        page.context.close()


def test_a_reply_that_arrives_is_text_until_code_begins(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot
) -> None:
    with (
        Server(answer=lambda _: THOUGHTS + PROGRAM, fault=lambda _: Fault.STALLED) as model,
        serve(tmp_path, model) as server,
    ):
        page = open_page(server)
        ask(page)
        expect(page.locator(".reply .text").first).to_contain_text("First to the kitchen.")
        expect(page.locator(".headline")).to_have_text("Writing the program")
        expect(page.locator(".cm-content")).not_to_contain_text("kitchen")
        shoot(page, "reply-thoughts")
        now = server.call("GET", "/api/missions/current").data
        assert (now["program"], now["is_written"]) == ("", True), json.dumps(now)
        page.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        page.context.close()


def test_a_reply_that_arrives_is_code_from_where_code_begins(
    tmp_path: Path, open_page: OpenPage, shoot: Shoot
) -> None:
    with (
        Server(answer=lambda _: PROGRAM + " " * 60, fault=lambda _: Fault.STALLED) as model,
        serve(tmp_path, model) as server,
    ):
        page = open_page(server)
        ask(page)
        expect(page.locator(".cm-content")).to_contain_text("def task_program")
        expect(page.locator(".reply .text").first).to_have_text("Here it is.")
        expect(page.locator(".cm-content")).not_to_contain_text("Here")
        shoot(page, "reply-code")
        page.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        page.context.close()


def test_a_program_that_cannot_run_is_not_ready(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, "--speed", "0") as server:
        page = open_page(server)
        expect(page.locator("[data-started] .cm-content")).to_be_visible()
        page.locator(".cm-content").click()
        page.keyboard.insert_text("def task_program(:\n    go_to('kitchen')\n")
        expect(page.locator(".headline")).to_have_text("The program cannot run")
        page.keyboard.press("Control+a")
        page.keyboard.insert_text("def task_program():\n    go_to('cellar')\n")
        expect(page.locator(".headline")).to_have_text("The program has problems")
        page.context.close()
