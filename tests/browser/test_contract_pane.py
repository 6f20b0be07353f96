"""The page shows a contract before its approval, and highlights its changes after an edit."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import expect

from pageserver import PageServer
from viewing import OpenPage, write

GREET = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"


def test_a_contract_is_shown_and_an_edit_shows_what_is_new(tmp_path: Path, open_page: OpenPage) -> None:
    with PageServer(tmp_path, "--speed", "40") as server:
        page = open_page(server)
        pane = page.locator(".contract")
        expect(pane).to_be_hidden()
        write(page, GREET)
        expect(pane).to_contain_text('It may go to "kitchen"; say "hello". It picks up nothing')
        write(page, GREET.replace("hello", "good morning"))
        expect(pane).to_contain_text('say "good morning". It picks up nothing')
        expect(pane).to_contain_text("More than the draft before:")
        expect(pane.locator("table").first.locator("tr")).to_have_text(['say"good morning"'])
        write(page, "def task_program():\n    go_to('kitchen')\n")
        expect(pane).to_contain_text("Less than the draft before.")
        pane.get_by_text("The whole contract").click()
        expect(pane.locator("tr")).to_have_text(['go to"kitchen"at most 1 time'])


def test_long_texts_hide_no_other_skill(tmp_path: Path, open_page: OpenPage) -> None:
    looks = "".join(f"    is_in_room('{letter * 600}')\n" for letter in "abc")
    program = f"def task_program():\n{looks}    pick(get_current_location())\n"
    with PageServer(tmp_path) as server:
        page = open_page(server)
        write(page, program)
        expect(page.locator(".contract > p")).to_contain_text("pick up")
        expect(page.locator(".contract > p")).to_contain_text("says nothing.")
