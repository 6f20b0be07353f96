"""Fixtures that show the page in a real browser: the system's Chromium, driven by Playwright."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from pageserver import PageServer
from viewing import DESK, OpenPage, Shoot, chromium

CHROMIUM_OPTIONS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-sync",
    "--no-first-run",
    "--ignore-certificate-errors",  # A test's proxy has a self-signed certificate.
]
TIMEOUT_SECONDS = 60.0  # A busy machine may be slow.


ONLY_FOR_SHOTS = {
    *("test_continue[desk-dark]", "test_continue[tablet-light]", "test_continue[tablet-dark]"),
    *("test_continue[desk-light]", "test_continue[phone-light]"),
    *(
        "test_pages[desk-dark]",
        "test_pages[tablet-light]",
        "test_pages[tablet-dark]",
        "test_pages[phone-light]",
    ),
    *("test_face[desk-light]", "test_face[desk-dark]", "test_face[tablet-light]", "test_face[phone-dark]"),
}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Without --shots, test one large and one small screen, one of them light and the other dark."""
    if config.getoption("--shots"):
        return
    left = [item for item in items if item.name in ONLY_FOR_SHOTS]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in left]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    path = chromium()
    if path is None:
        pytest.skip("there is no Chromium here: apt-get install chromium-headless-shell")
    expect.set_options(timeout=TIMEOUT_SECONDS * 1000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_OPTIONS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    """Serve a page with a simulated robot in a small house, at twice the normal speed."""
    with PageServer(tmp_path_factory.mktemp("page"), "--speed", "2") as server:
        yield server


@pytest.fixture
def open_page(browser: Browser) -> Iterator[OpenPage]:
    """Open pages in separate browsers, and fail the test if any of them reports an error or a warning."""
    complaints: list[str] = []

    expected: list[str] = []

    def on_console(message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"} and not any(each in message.text for each in expected):
            complaints.append(f"{message.text} at {message.location}")

    with ExitStack() as contexts:

        def open_page(
            server: PageServer,
            path: str = "",
            *,
            size: tuple[int, int] = DESK,
            dark: bool = False,
            beside: Page | None = None,
            link: str = "",
            script: str = "",
            expecting: str = "",
        ) -> Page:
            expected.extend([expecting] if expecting else [])
            if beside is None:
                context = browser.new_context(
                    viewport={"width": size[0], "height": size[1]},
                    color_scheme="dark" if dark else "light",
                    reduced_motion="reduce",
                )
                contexts.callback(context.close)
            else:
                context = beside.context
            context.set_default_timeout(TIMEOUT_SECONDS * 1000)
            page = context.new_page()
            page.add_init_script(script)
            page.on("console", on_console)
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.goto(link or server.link.replace("/?", f"/{path}?"))
            # Before the handshake, NiceGUI may send typed text after the key that follows it.
            page.wait_for_function("() => !window.socket || window.did_handshake")
            return page

        yield open_page
    assert complaints == []


@pytest.fixture
def shoot(pytestconfig: pytest.Config) -> Shoot:
    """Return a function that saves a screenshot in the folder of --shots, if there is one."""
    folder = pytestconfig.getoption("--shots")

    def shoot(page: Page, name: str, *, full_page: bool = True) -> None:
        if folder:
            page.screenshot(path=Path(folder) / f"{name}.png", full_page=full_page)

    return shoot
