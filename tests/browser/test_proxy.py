"""The page behind a reverse proxy that speaks HTTPS, at its root or below a path, in a real browser."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page, expect

from command_line import forked
from pageserver import PageServer
from tlsproxy import TLSProxy
from viewing import OpenPage

FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"
ASK = "def task_program():\n    say('Hello')\n    ask('ann', 'Tea?', ['yes', 'no'])\n"
SOCKET, FILES = "/_nicegui_ws/", "/events."
STATUSES = "(asked) => Promise.all(asked.map(async (each) => (await fetch(each)).status))"
PATHS = {"root": ("", False), "kept": ("/robot", False), "stripped": ("/lab/robot", True)}
"""The path of the page, and whether the proxy removes it."""
BELOW_A_PATH = pytest.mark.parametrize("site", ["kept", "stripped"], indirect=True)
"""These tests skip the root, where a page has the same links without a proxy."""


@dataclass(frozen=True)
class Site:
    """A page and the proxy in front of it."""

    server: PageServer
    proxy: TLSProxy

    def link(self, path: str = "") -> str:
        """Return the link that opens a page for an operator through the proxy."""
        return f"{self.proxy.address}/{path}?token={self.server.token}"


@contextmanager
def serve_behind_proxy(
    folder: Path,
    *arguments: str,
    prefix: str = "",
    named: bool = True,
    strips: bool = False,
    host: bool = True,
) -> Iterator[Site]:
    """Serve a page behind a proxy; `named` passes the proxy to `--behind-proxy`."""
    with ExitStack() as stack:
        servers: list[PageServer] = []
        proxy = TLSProxy(folder, lambda: servers[0].port, prefix, strips=strips, passes_host=host)
        stack.enter_context(proxy)
        option = ("--behind-proxy", proxy.address) if named else ()
        servers.append(stack.enter_context(PageServer(folder, *arguments, *option)))
        yield Site(servers[0], proxy)


@pytest.fixture(scope="module", params=PATHS)
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    prefix, strips = PATHS[request.param]
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "runs").mkdir()
    words = ("--model", "recorded:careful", "--num-completions", "1", "--no-report", "--tasks", "SayGoodDay")
    ended = forked("roboeval", "run", *words, "--out", str(folder / "runs" / "careful"))
    assert ended.status == 0, ended.err
    with serve_behind_proxy(folder, "--speed", "2", "--face", prefix=prefix, strips=strips) as site:
        yield site


def addresses(page: Page) -> list[str]:
    """Return the addresses that a page links to or has loaded, resolved by the browser."""
    script = """() => [
        ...[...document.querySelectorAll("a[href], link[href]")].map((e) => e.href),
        ...[...document.querySelectorAll("[src]")].map((e) => e.src),
        ...[...document.querySelectorAll("form")].map((e) => e.action),
        ...performance.getEntriesByType("resource").map((e) => e.name),
    ].filter((each) => each.startsWith("http"))"""
    found: list[str] = page.evaluate(script)
    return found


def test_the_links_are_printed_with_their_tokens(site: Site) -> None:
    said = site.server.output
    assert f"{site.proxy.address}/?token={site.server.token}\n" in said
    assert f"{site.proxy.address}/face?token={site.server.face_token}\n" in said


def test_page_updates_and_stops_the_robot(site: Site, open_page: OpenPage) -> None:
    page = open_page(site.server, link=site.link())
    site.server.run(FAR)
    expect(page.locator(".headline")).to_have_text("Running")  # The websocket brings this text.
    with page.expect_response(re.compile("/api/stop")) as answer:
        page.locator("#stop").click()
    assert answer.value.status == 202
    expect(page.locator("#stop-told")).to_have_text("The robot has stopped.")
    expect(page.locator(".headline")).to_have_text("Stopped")


def test_no_address_leaves_the_path_of_the_page(site: Site, open_page: OpenPage) -> None:
    page = open_page(site.server, link=site.link())
    for path in ("", "missions", "runs", "runs/careful", "face"):
        page.goto(f"{site.proxy.address}{site.server.path}/{path}")
        page.wait_for_load_state("networkidle")
        found = addresses(page)
        left = {each for each in found if not f"{each}/".startswith(f"{site.proxy.address}/")}
        assert left == set(), path
        asked = sorted({each.partition("#")[0] for each in found if SOCKET not in each and FILES not in each})
        statuses = page.evaluate(STATUSES, asked)
        assert dict(zip(asked, statuses, strict=True)) == dict.fromkeys(asked, 200), path


def test_the_cookie_counts_below_the_path_alone_and_only_by_https(site: Site, open_page: OpenPage) -> None:
    page = open_page(site.server, link=site.link("missions"))
    assert urlsplit(page.url).query == ""
    (cookie,) = page.context.cookies()
    path = urlsplit(site.proxy.address).path + site.server.path
    assert (cookie["path"], cookie["secure"], cookie["httpOnly"]) == (path, True, True)


@BELOW_A_PATH
def test_a_past_mission_is_found_and_downloaded(site: Site, open_page: OpenPage) -> None:
    site.server.rest()
    site.server.run(ASK)
    page = open_page(site.server, link=site.link())
    page.get_by_role("link", name="Missions").click()
    page.locator(".rows a").first.click()
    expect(page.locator(".timeline")).to_contain_text("Hello")
    with page.expect_download() as download:
        page.get_by_role("link", name="Events").click()
    assert Path(download.value.path()).read_bytes().startswith(b'{"time"')


@BELOW_A_PATH
def test_the_face_speaks_and_its_stop_works(site: Site, open_page: OpenPage) -> None:
    site.server.rest()
    face = open_page(site.server, link=f"{site.proxy.address}/face?token={site.server.face_token}")
    site.server.run(ASK)
    expect(face.locator("#said")).to_contain_text("Hello")
    face.locator("#options button").first.click()
    expect(face.locator("#doing")).to_have_text("I have finished.")
    site.server.run(FAR)
    face.locator("#stop").click()
    expect(face.locator("#stop-told")).to_have_text("The robot has stopped.")


@BELOW_A_PATH
def test_the_run_of_a_benchmark_is_shown_to_its_last_page(site: Site, open_page: OpenPage) -> None:
    page = open_page(site.server, link=site.link("runs"))
    page.locator("table a").first.click()
    page.locator(".which a").first.click()
    expect(page.locator("h1")).to_contain_text("SayGoodDay")
    page.locator(".trail a").first.click()
    expect(page).to_have_url(re.compile(re.escape(site.proxy.address + site.server.path) + "/runs/careful"))


def test_without_the_option_stop_says_how_to_start(tmp_path: Path, browser: Browser) -> None:
    """NiceGUI reports that its modules are refused, so `open_page` would fail the test."""
    with serve_behind_proxy(tmp_path, named=False) as site, browser.new_context() as context:
        page = context.new_page()
        page.goto(site.link())
        page.wait_for_load_state("networkidle")
        page.locator("#stop").click()
        expect(page.locator("#stop-told")).to_contain_text("--behind-proxy")
        said = site.server.output
    assert said.count("use --behind-proxy") == 1
