"""Whatever a model, a world file, a robot or a person says is shown as text, and never obeyed."""

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
"""A program may say no more at once."""


HIDDEN = r"""() => {
    const odd = /[\p{Cc}\p{Cf}\p{Zl}\p{Zp}]/u;
    const found = [...document.querySelectorAll("textarea")].map((each) => each.value);
    const nodes = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (nodes.nextNode()) {
        // the editor shows what is really there, kept apart from the rest, with its name before it
        const { data, parentNode } = nodes.currentNode;
        if (!parentNode.closest(".escaped, script, style")) found.push(data);
    }
    return found.filter((text) => odd.test(text.replace(/[\n\t]/g, "")));
}"""
"""Texts with characters that nobody sees."""


def world_of(text: str) -> str:
    """A house in which everything has an evil name, as far as a world file can hold it."""
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


def count(page: Page) -> int:
    """How many elements there are that could do something."""
    return page.locator(OWN_TAGS).count()


def expect_unharmed(page: Page, before: int) -> None:
    assert page.evaluate("window.owned") is None
    assert count(page) == before
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]  # type: ignore[index]  # it has one


def expect_written_out(page: Page) -> None:
    """Nothing on the page is hidden in its texts, or turns them round."""
    assert page.evaluate(HIDDEN) == []


@pytest.fixture(params=range(len(EVIL)), ids=NAMES)
def evil(request: pytest.FixtureRequest) -> str:
    number: int = request.param
    return EVIL[number]


@pytest.fixture
def model(evil: str) -> Iterator[Server]:
    with Server(answer=lambda _: program_of(evil)) as model:
        yield model


def test_no_text_becomes_more_than_text(tmp_path: Path, opened: OpenPage, model: Server, evil: str) -> None:
    """An instruction, a model's name, a program, its problems, a world, an answer, an error, a reason."""
    arguments = [
        "--model",
        f"completions:{evil[:80].splitlines()[0].replace(chr(0), '')}",
        "--base-url",
        model.url,
    ]
    arguments = [each.encode(errors="replace").decode() for each in arguments]
    with PageServer(tmp_path, *arguments, "--speed", "0", world=world_of(evil)) as server:
        page = opened(server)
        expect(page.locator(".headline")).to_be_visible()
        before = count(page)
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
        assert "".join(shown.split())[:10] == "".join(_visible(evil).split())[:10]
        expect_unharmed(page, before)
        page.reload()
        expect(page.locator(".headline")).to_have_text("Failed")
        page.wait_for_selector(".pick")
        expect_unharmed(page, before)
        expect_written_out(page)
        page.locator(".pick").last.click()
        expect_written_out(page)
        phone = opened(server, "missions", size=PHONE)
        expect(phone.locator(".rows li")).to_have_count(1)
        expect_unharmed(phone, count(phone))
        expect_written_out(phone)
        phone.locator(".rows a").first.click()
        expect(phone.locator(".timeline")).to_be_visible()
        expect_written_out(phone)
        assert phone.evaluate("window.owned") is None
        assert server.call("GET", "/api/robot").data["state"] == "failed"
        for each in (page, phone):
            each.context.close()


def _visible(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def test_a_huge_program_does_not_hold_the_page_up(tmp_path: Path, opened: OpenPage) -> None:
    huge = "def task_program():\n" + "".join(f"    say('{n} xx')\n" for n in range(990))
    with PageServer(tmp_path, "--speed", "0") as server:
        page = opened(server)
        expect(page.locator(".headline")).to_be_visible()
        assert server.call("POST", "/api/missions", {"program": huge}).status == 201
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        began = time.monotonic()
        page.locator("#stop").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        assert time.monotonic() - began < 2
        page.context.close()
