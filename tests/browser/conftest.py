"""A real browser (the system's Chromium, by Playwright) in front of the page as a user starts it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from pageserver import PageServer
from viewing import DESK, OpenPage, chromium

QUIETLY = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-sync",
    "--no-first-run",
]
SECONDS = 60.0  # a busy machine is no fault of the page


NOT_ALWAYS = {"desk-dark", "tablet-light", "phone-dark"}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Without --shots, look at each size and at each colour scheme, but not at all pairs of them."""
    if config.getoption("--shots"):
        return
    left = [item for item in items if item.name.partition("[")[2].rstrip("]") in NOT_ALWAYS]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in left]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    path = chromium()
    if path is None:
        pytest.skip("there is no Chromium here: apt-get install chromium-headless-shell")
    expect.set_options(timeout=SECONDS * 1000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=QUIETLY)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    """A page with a simulated robot in a small house, where two seconds pass in one."""
    with PageServer(tmp_path_factory.mktemp("page"), "--speed", "2") as server:
        yield server


@pytest.fixture
def opened(browser: Browser) -> Iterator[OpenPage]:
    """Opens pages in browsers of their own, and takes amiss whatever any of them complains about."""
    complaints: list[str] = []

    expected: list[str] = []

    def heard(message: ConsoleMessage) -> None:
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
                    viewport={"width": size[0], "height": size[1]}, color_scheme="dark" if dark else "light"
                )
                contexts.callback(context.close)
            else:
                context = beside.context
            context.set_default_timeout(SECONDS * 1000)
            page = context.new_page()
            page.add_init_script(script)
            page.on("console", heard)
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.goto(link or server.link.replace("/?", f"/{path}?"))
            return page

        yield open_page
    assert complaints == []


@pytest.fixture
def shots(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The folder for screenshots: that of --shots, if it is given."""
    folder = request.config.getoption("--shots") or tmp_path
    return Path(folder)
