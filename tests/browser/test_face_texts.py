"""Texts that the robot says and asks stay text on its face and on the operator's page."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, WebSocketRoute, expect

from codebotler.web.face import screen_text
from evil import EVIL, NAMES, OWN_TAGS
from faces import HEARING, SPEAKING
from pageserver import PageServer
from viewing import PHONE, OpenPage


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("face"), "--face", "--speed", "1") as server:
        yield server


def program_of(text: str) -> str:
    """Return a program that says and asks a text, drives to it, and fails with it."""
    said = json.dumps(text[:LONGEST])
    return f"""def task_program():
    say({said})
    answer = ask({said}, {said}, [{said}, "no", {said}])
    say(answer)
    try:
        go_to({said})
    except Exception:
        pass
    ask({said}, "again?", ["yes", {said}])
    raise ValueError({said})
"""


def expect_unharmed(page: Page, before: int) -> None:
    assert page.evaluate("window.owned") is None
    assert page.locator(OWN_TAGS).count() == before
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]  # type: ignore[index]  # It has one.


LONGEST = 9_000
"""Most characters that a program may say at once."""


def squeeze(text: str) -> str:
    return "".join(text.split())


@pytest.mark.parametrize("evil", EVIL, ids=NAMES)
def test_hostile_text_stays_text(server: PageServer, open_page: OpenPage, evil: str) -> None:
    operator = open_page(server)
    face = open_page(server, link=server.face_link, size=PHONE, script=SPEAKING + HEARING)
    expect(face.locator("#doing")).not_to_be_empty()
    expect(operator.locator(".headline")).to_be_visible()
    before, beside = face.locator(OWN_TAGS).count(), operator.locator(OWN_TAGS).count()
    server.run(program_of(evil), despite_problems=True)
    expect(face.locator("#options button")).to_have_count(3)
    shown = squeeze(screen_text(evil[:LONGEST], 300))
    assert squeeze(face.locator("#said p").last.inner_text())[:200] == squeeze(screen_text(evil))[:200]
    assert squeeze(face.locator("#question").inner_text())[:200] == squeeze(screen_text(evil))[:200]
    assert squeeze(face.locator("#person").inner_text()) == f"For{shown}"
    assert squeeze(face.locator("#options span").first.inner_text()) == shown
    expect(operator.locator(".asking button")).to_have_count(3)
    for page, count in ((face, before), (operator, beside)):
        expect_unharmed(page, count)
    voice = face.get_by_role("switch", name="Answer by voice")
    voice.click()
    ends = time.monotonic() + 60
    while not face.evaluate("window.listening.length"):
        assert time.monotonic() < ends
    face.evaluate("text => hear(text)", evil.encode(errors="replace").decode())
    expect(face.locator("#heard-text")).to_be_visible()
    expect_unharmed(face, before)
    voice.click()
    face.locator("#options button").first.click()
    expect(face.locator("#question")).to_have_text("again?")
    expect_unharmed(face, before)
    face.locator("#options button").last.click()
    expect(operator.locator(".headline")).to_have_text("Failed")
    assert squeeze(face.locator("#ended").inner_text()) == f"Thankyou:{shown}"
    for page, count in ((face, before), (operator, beside)):
        expect_unharmed(page, count)
        page.reload()
        page.wait_for_load_state("networkidle")
        expect_unharmed(page, count)


def test_answers_that_are_hard_to_tell_apart_can_be_chosen(server: PageServer, open_page: OpenPage) -> None:
    """Answers may be empty, equal, or more than a screen holds."""
    face = open_page(server, link=server.face_link, script=SPEAKING)
    options = ["", " ", "no", "no", *map(str, range(60))]
    server.run(f"def task_program():\n    say('[' + ask('', '', {options}) + ']')\n", despite_problems=True)
    expect(face.locator("#options button")).to_have_count(50)
    expect(face.locator("#more")).to_have_text("14 more answers are not shown.")
    expect(face.locator("#person")).to_be_hidden()
    expect(face.locator("#question")).to_have_text("?")
    expect(face.locator("#options span").nth(1)).to_have_text("(blank)")
    face.locator("#options button").nth(1).click()
    expect(face.locator("#said p")).to_have_text("[ ]", use_inner_text=False)


@pytest.mark.parametrize("evil", EVIL, ids=NAMES)
def test_face_itself_escapes_texts(server: PageServer, open_page: OpenPage, evil: str) -> None:
    """A stand-in for the tool sends the text raw, and 100 KB of it; the tool never would."""
    raw = evil.encode(errors="replace").decode()
    told = {
        "doing": "asking",
        "to": raw,
        "said": [{"number": 1, "text": raw}],
        "question": {"number": 2, "person": raw, "text": raw, "options": [raw, raw], "more_options": 0},
        "seconds_left": None,
        "ended": None,
        "state": "running",
        "is_over": False,
        "reason": "",
    }
    face = open_page(server, link="about:blank", size=PHONE)
    sent: list[WebSocketRoute] = []

    def hold(route: WebSocketRoute) -> None:  # Playwright rejects built-in functions.
        sent.append(route)

    face.route_web_socket("**/api/face/live", hold)
    face.goto(server.face_link)
    face.wait_for_timeout(100)
    before = face.locator(OWN_TAGS).count()
    sent[0].send(json.dumps(told))
    expect(face.locator("#options button")).to_have_count(2)
    assert squeeze(face.locator("#question").inner_text())[:99] == squeeze(raw)[:99]
    expect_unharmed(face, before)
    over = {"question": None, "ended": {"number": 2, "how": "answered", "answer": raw}, "reason": raw}
    for change in (over, {**over, "doing": "moving"}, {**over, "doing": "idle", "is_over": True}):
        sent[0].send(json.dumps({**told, **change}))
        expect(face.locator("#ended")).to_be_visible()
        expect_unharmed(face, before)
