"""Pages that refuse a request are accessible, too."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from pageserver import PageServer
from viewing import SCREENS, OpenPage, Screen, expect_no_grave_fault


@pytest.mark.parametrize("screen", [SCREENS[0], SCREENS[-1]], ids=lambda screen: screen[0])
def test_pages_that_refuse(server: PageServer, open_page: OpenPage, screen: Screen) -> None:
    _, size, dark = screen
    address = f"http://localhost:{server.port}/"
    page = open_page(server, size=size, dark=dark, link=address, expecting="Failed to load resource")
    expect(page.locator("p")).to_contain_text("open the printed link")
    expect_no_grave_fault(page)
    page.goto(f"{server.link}x")
    expect(page.locator("p")).to_have_text("this token is wrong; use the printed link or token")
    expect_no_grave_fault(page)
    page.goto(server.link)
    page.goto(f"{server.inside}/nothing")
    expect(page.locator("p")).to_have_text("there is no such page")
    expect_no_grave_fault(page)
