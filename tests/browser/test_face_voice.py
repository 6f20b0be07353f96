"""The robot's face speaks and listens, with stand-ins, because a browser under test does neither."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from faces import ASKS, HEARING, MUTE, SPEAKING, TWICE, face_of, last_statement, option, wait_until
from pageserver import PageServer
from viewing import OpenPage


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("face"), "--face", "--speed", "2") as server:
        yield server


@pytest.fixture(autouse=True)
def stop_robot(server: PageServer) -> None:
    """Start every test with a robot that does nothing."""
    server.rest()


# --- speech


def test_muting_is_remembered(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    aloud = face.get_by_role("switch", name="Speak aloud")
    expect(aloud).to_be_checked()
    aloud.click()
    expect(aloud).not_to_be_checked()
    face.reload()
    expect(aloud).not_to_be_checked()
    server.run(ASKS)
    face.keyboard.press("1")
    expect(option(face, "Yes")).to_be_enabled()
    assert face.evaluate("window.spoken") == []
    aloud.click()
    face.keyboard.press("1")
    expect(last_statement(face)).to_have_text("She says Yes")
    expect(aloud).to_be_checked()
    wait_until(face, "window.spoken.includes('She says Yes')")


def test_answer_ends_the_spoken_question(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page)
    server.run(ASKS)
    expect(option(face, "Yes")).to_be_enabled()
    assert face.evaluate("window.hushed") == 0
    option(face, "Yes").click()
    wait_until(face, "window.hushed === 1")


def test_face_asks_for_a_touch_to_turn_on_the_sound(server: PageServer, open_page: OpenPage) -> None:
    """The browser's own speech synthesis is silent in tests."""
    face = face_of(server, open_page, script="")
    expect(face.locator("#hint")).to_have_text("Tap the screen once to turn on the sound.")
    size = face.locator("#hint").evaluate("e => parseFloat(getComputedStyle(e).fontSize)")
    assert size >= 30, "the hint must be readable from some steps away"
    face.locator("h1").click(force=True)
    expect(face.locator("#hint")).to_be_hidden()


def test_a_browser_without_a_voice_still_shows_all(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page, script=MUTE)
    expect(face.locator("#aloud")).to_be_hidden()
    expect(face.locator("#voice")).to_be_hidden()
    expect(face.locator("#hint")).to_be_hidden()
    server.run(ASKS)
    option(face, "Yes").click()
    expect(last_statement(face)).to_have_text("She says Yes")


# --- answers by voice, with a stand-in for the browser's speech recognition


def open_hearing_face(server: PageServer, open_page: OpenPage) -> Page:
    return face_of(server, open_page, script=SPEAKING + HEARING)


def test_face_listens_only_after_it_is_switched_on(server: PageServer, open_page: OpenPage) -> None:
    face = open_hearing_face(server, open_page)
    voice = face.get_by_role("switch", name="Answer by voice")
    expect(voice).not_to_be_checked()
    expect(voice).to_have_accessible_description(re.compile("many browsers send your voice to their vendor"))
    expect(face.locator("#voice-about")).to_be_visible()
    server.run(ASKS)
    expect(option(face, "Yes")).to_be_enabled()
    assert face.evaluate("window.listening.length") == 0
    voice.click()
    expect(voice).to_be_checked()
    wait_until(face, "window.listening.length === 1")
    face.reload()
    expect(voice).not_to_be_checked()
    expect(option(face, "Yes")).to_be_enabled()
    assert face.evaluate("window.listening.length") == 0, "the next person has not agreed"


def test_the_robot_does_not_listen_to_itself(server: PageServer, open_page: OpenPage) -> None:
    face = face_of(server, open_page, script=f"window.isSlow = true;{SPEAKING}{HEARING}")
    face.get_by_role("switch", name="Answer by voice").click()
    server.run(ASKS.replace('    say("Good morning")\n', ""))
    expect(option(face, "Yes")).to_be_enabled()
    expect(face.locator("body.speaks")).to_be_visible()
    assert face.evaluate("window.listening.length") == 0
    face.evaluate("window.end()")
    wait_until(face, "window.listening.length === 1")
    expect(face.locator("body.speaks")).to_be_hidden()


def test_a_spoken_answer_is_shown_before_it_is_taken(server: PageServer, open_page: OpenPage) -> None:
    face = open_hearing_face(server, open_page)
    face.get_by_role("switch", name="Answer by voice").click()
    server.run(ASKS)
    wait_until(face, "window.listening.length === 1")
    face.evaluate("hear('I would rather have coffee')")
    expect(face.locator("#heard-text")).to_contain_text("which is not one of the answers")
    expect(face.locator("#take")).to_be_hidden()
    face.evaluate("hear('oh yes or no thank you', 'yes')")
    expect(face.locator("#heard-text")).to_have_text(
        "I heard “oh yes or no thank you”. Is your answer “Yes”?"
    )
    assert face.evaluate("window.listening.length") == 0
    assert server.call("GET", "/api/face").data["question"] is not None
    face.get_by_role("button", name="No, listen again").click()
    expect(face.locator("#heard")).to_be_hidden()
    wait_until(face, "window.listening.length === 1")
    face.evaluate("hear('No. Thank you!')")
    expect(face.locator("#heard-text")).to_contain_text("Is your answer “No, thank you”?")
    face.get_by_role("button", name="Yes, that is my answer").click()
    expect(last_statement(face)).to_have_text("She says No, thank you")
    assert face.evaluate("window.listening.length") == 0


def test_spoken_answer_counts_only_for_its_question(server: PageServer, open_page: OpenPage) -> None:
    face = open_hearing_face(server, open_page)
    face.get_by_role("switch", name="Answer by voice").click()
    server.run(TWICE)
    wait_until(face, "window.listening.length === 1")
    face.evaluate("hear('yes')")
    expect(face.locator("#take")).to_be_visible()
    option(face, "No").click()
    expect(face.locator("#question")).to_have_text("Are you sure?")
    expect(face.locator("#heard")).to_be_hidden()


def test_face_reports_that_the_browser_may_not_listen(server: PageServer, open_page: OpenPage) -> None:
    face = open_hearing_face(server, open_page)
    voice = face.get_by_role("switch", name="Answer by voice")
    voice.click()
    server.run(ASKS)
    wait_until(face, "window.listening.length === 1")
    face.evaluate("fail('no-speech')")
    expect(voice).to_be_checked()
    face.evaluate("fail('not-allowed')")
    expect(face.locator("#ended")).to_have_text("The browser blocks the microphone. Please tap an answer.")
    expect(voice).not_to_be_checked()
    option(face, "Yes").click()
    expect(last_statement(face)).to_have_text("She says Yes")
