"""Open and inspect pages in a browser."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from typing import TypeAlias

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

DESK, TABLET, PHONE = (1440, 900), (768, 1024), (390, 844)
"""Width and height of screens, in pixels."""

OpenPage: TypeAlias = Callable[..., Page]
Shoot: TypeAlias = Callable[..., None]

GRAVE = {"serious", "critical"}
ONLY_FAULTS = {"resultTypes": ["violations"]}  # The other results would take as long again.
Screen: TypeAlias = tuple[str, tuple[int, int], bool]
SCREENS: list[Screen] = [
    (f"{name}-{'dark' if dark else 'light'}", size, dark)
    for name, size in (("desk", DESK), ("tablet", TABLET), ("phone", PHONE))
    for dark in (False, True)
]


def chromium() -> str | None:
    """Find the browser of this system, preferably the small one, which draws no window."""
    names = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None)


def wait_until(page: Page, promise: str, arg: object = None) -> None:
    """Wait until a promise resolves to true; `wait_for_function` takes the promise itself for true."""
    end = time.monotonic() + PATIENCE
    while not page.evaluate(promise, arg):
        assert time.monotonic() < end, promise
        page.wait_for_timeout(50)


PATIENCE = 60.0  # seconds


def expect_no_grave_fault(page: Page) -> None:
    """Expect that axe finds no serious barrier."""
    found = Axe().run(page, options=ONLY_FAULTS).response["violations"]
    grave = [fault for fault in found if fault["impact"] in GRAVE]
    assert [(fault["id"], [node["html"] for node in fault["nodes"]]) for fault in grave] == []


def write(page: Page, program: str) -> None:
    """Replace the program in the editor."""
    expect(page.locator("[data-started] .cm-content")).to_be_visible()
    page.locator(".cm-content").click()
    page.keyboard.press("Control+a")
    page.keyboard.insert_text(program)
