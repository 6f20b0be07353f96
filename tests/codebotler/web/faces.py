"""Open a face in a browser, with stand-ins for the voice and the microphone that it lacks."""

from __future__ import annotations

import re
import time

from playwright.sync_api import Locator, Page, expect

from pageserver import PageServer
from viewing import TABLET, OpenPage

SPEAKING = """
(() => {
  // A stand-in for the browser's speech synthesis: keeps what it is to say, and has said it a moment later,
  // or, where it is slow, when a test says so.
  window.spoken = [];
  window.hushed = 0;
  window.SpeechSynthesisUtterance = class extends EventTarget {
    constructor(text) { super(); this.text = text; }
  };
  const standIn = {
    speak(words) {
      window.spoken.push(words.text);
      const end = () => words.dispatchEvent(new Event("end"));
      if (window.isSlow) window.end = end;
      else setTimeout(end, 30);
    },
    cancel() { window.hushed += 1; },
  };
  Object.defineProperty(window, "speechSynthesis", { value: standIn });
  Object.defineProperty(navigator, "userActivation", { value: { hasBeenActive: true } });
})();
"""
"""A stub of speechSynthesis, which makes no sound."""

HEARING = """
(() => {
  // A stand-in for the browser's speech recognition: has heard what a test says by window.hear(...).
  window.listening = [];
  const tell = (name, what) => {
    for (const each of [...window.listening]) each.dispatchEvent(Object.assign(new Event(name), what));
  };
  window.SpeechRecognition = class extends EventTarget {
    start() { window.listening.push(this); }
    abort() { window.listening = window.listening.filter((each) => each !== this); }
  };
  window.hear = (...heard) => tell("result", { results: [heard.map((transcript) => ({ transcript }))] });
  window.fail = (error) => tell("error", { error });
})();
"""
"""A stub of SpeechRecognition, which hears the words of a test."""

MUTE = (
    "delete window.speechSynthesis; delete window.SpeechRecognition; delete window.webkitSpeechRecognition;"
)
"""A script that removes speech and recognition from a browser."""

ASKS = """def task_program():
    say("Good morning")
    answer = ask("ann", "Would you like tea?", ["Yes", "No, thank you"])
    say("She says " + answer)
    time.sleep(30)
"""
TWICE = """def task_program():
    first = ask("ann", "Would you like tea?", ["Yes", "No"])
    second = ask("ann", "Are you sure?", ["Yes", "No"])
    say(first + second)
"""
REFUSED = "409 (Conflict)"  # The browser logs this when an answer comes too late.


def face_of(
    server: PageServer,
    opened: OpenPage,
    size: tuple[int, int] = TABLET,
    script: str = SPEAKING,
    expecting: str = "",
) -> Page:
    page = opened(server, size=size, link=server.face_link, script=script, expecting=expecting)
    expect(page.locator("#doing")).not_to_be_empty()
    return page


def wait_until(page: Page, holds: str) -> None:
    """Wait until a script returns true; the page's policy forbids Playwright's own function for it."""
    ends = time.monotonic() + 60
    while not page.evaluate(holds):
        assert time.monotonic() < ends, holds
        page.wait_for_timeout(20)


def option(page: Page, text: str) -> Locator:
    return page.locator("#options button", has_text=re.compile(rf"^\d?{text}$"))


def last_statement(page: Page) -> Locator:
    """Find the last statement."""
    return page.locator("#said p").last
