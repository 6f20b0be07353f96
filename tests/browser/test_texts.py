"""Texts from models, world files, robots and people are shown as text and never interpreted."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from evil import EVIL, NAMES, OWN_TAGS
from pageserver import PageServer
from server import Server
from viewing import PHONE, OpenPage

LONGEST = 9_000
"""Most characters that a program may say at once."""


INVISIBLE_TEXTS = r"""() => {
    const invisible = /[\p{Cc}\p{Cf}\p{Zl}\p{Zp}]/u;
    const found = [...document.querySelectorAll("textarea")].map((each) => each.value);
    const nodes = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (nodes.nextNode()) {
        // The editor shows each invisible character by name, in an element of its own.
        const { data, parentNode } = nodes.currentNode;
        if (!parentNode.closest(".escaped, script, style")) found.push(data);
    }
    return found.filter((text) => invisible.test(text.replace(/[\n\t]/g, "")));
}"""
"""Returns texts with invisible characters."""


def world_of(text: str) -> str:
    """Return a world in which everything has an evil name, as far as a world file allows."""
    name = json.dumps("".join(c for c in text if c.isprintable())[:300], ensure_ascii=False)
    plain = json.dumps("kitchen")
    quoted = name.replace("(", "").replace(")", "").replace("[", "").replace("*", "").replace("{", "")
    return f"robot: hall\nrooms: [hall, {plain}, {quoted}]\nobjects: {{kitchen: [{quoted}]}}\nabout: {name}\n"


def program_of(text: str) -> str:
    said = json.dumps(text[:LONGEST])
    comment = " ".join(text.replace("\0", "").replace("\ud800", "").splitlines())
    return f"""def task_program():
    say({said})
    try:
        go_to({said})
        ask({said}, {said}, [{said}, "no"])
    except Exception:
        pass
    # {comment}
    is_in_room({said})
    go_to("cellar")
"""


def count_active(page: Page) -> int:
    """Count the elements that could do something."""
    return page.locator(OWN_TAGS).count()


def expect_unharmed(page: Page, before: int) -> None:
    assert page.evaluate("window.owned") is None
    assert count_active(page) == before
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]  # type: ignore[index]  # It has one.


def expect_written_out(page: Page) -> None:
    """Expect no characters that are invisible or reverse the text."""
    assert page.evaluate(INVISIBLE_TEXTS) == []


@pytest.fixture(params=range(len(EVIL)), ids=NAMES)
def evil(request: pytest.FixtureRequest) -> str:
    number: int = request.param
    return EVIL[number]


@pytest.fixture
def model(evil: str) -> Iterator[Server]:
    with Server(answer=lambda _: program_of(evil)) as model:
        yield model


def test_hostile_text_stays_text(tmp_path: Path, open_page: OpenPage, model: Server, evil: str) -> None:
    """The text is in an instruction, a model's name, a program, a world, an answer, an error and a reason."""
    arguments = [
        "--model",
        f"completions:{evil[:80].splitlines()[0].replace(chr(0), '')}",
        "--base-url",
        model.url,
    ]
    arguments = [each.encode(errors="replace").decode() for each in arguments]
    with PageServer(tmp_path, *arguments, "--speed", "0", world=world_of(evil)) as server:
        page = open_page(server)
        expect(page.locator(".headline")).to_be_visible()
        before = count_active(page)
        page.locator("textarea").fill(evil.encode(errors="replace").decode())
        page.get_by_role("button", name="Write the program").click()
        expect(page.locator(".verdict")).to_be_visible()
        if not evil.isprintable():
            expect(page.locator(".cm-content .escape").first).to_be_visible()
        expect_unharmed(page, before)
        page.get_by_text("Run it despite the problems").click()
        page.get_by_role("button", name="Run it on the robot").click()
        expect(page.locator(".headline")).to_have_text("Failed")
        shown = page.locator(".moment-say .text").inner_text()
        assert "".join(shown.split())[:10] == "".join(_escape_invisible(evil).split())[:10]
        expect_unharmed(page, before)
        page.reload()
        expect(page.locator(".headline")).to_have_text("Failed")
        page.wait_for_selector(".pick")
        expect_unharmed(page, before)
        expect_written_out(page)
        page.locator(".pick").last.click()
        expect_written_out(page)
        phone = open_page(server, "missions", size=PHONE)
        expect(phone.locator(".rows li")).to_have_count(1)
        expect_unharmed(phone, count_active(phone))
        expect_written_out(phone)
        phone.locator(".rows a").first.click()
        expect(phone.locator(".timeline")).to_be_visible()
        expect_written_out(phone)
        assert phone.evaluate("window.owned") is None
        assert server.call("GET", "/api/robot").data["state"] == "failed"
        for each in (page, phone):
            each.context.close()


def _escape_invisible(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def test_huge_program_does_not_block_the_page(tmp_path: Path, open_page: OpenPage) -> None:
    huge = "def task_program():\n" + "".join(f"    say('{n} xx')\n" for n in range(990))
    with PageServer(tmp_path, "--speed", "0") as server:
        page = open_page(server)
        expect(page.locator(".headline")).to_be_visible()
        assert server.call("POST", "/api/missions", {"program": huge}).status == 201
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        began = time.monotonic()
        page.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        assert time.monotonic() - began < 2
        page.context.close()
