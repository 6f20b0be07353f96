"""What all pages have in common: the bar with their names, and STOP where there is a robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from nicegui import html, ui

HEAD = '<link rel="stylesheet" href="/static/page.css">'
BAR = """<div id="stop-bar"><span id="stop-told" role="status" aria-live="assertive"></span>
<button id="stop" type="button" aria-keyshortcuts="Escape"><b>STOP</b><small>Esc</small></button></div>
<script src="/static/stop.js"></script>"""
ROBOT = (("Robot", "/"), ("Missions", "/missions"))
FACE = ("Face", "/face")
PATIENCE = 60.0
"""Seconds that a page may take to be put together: a run is read when it is first looked at."""


@dataclass(frozen=True)
class Frame:
    """Puts the bar on a page; STOP needs nothing of the rest to work.

    Args:
        links: names and addresses of pages, in order.
        brand: what it is all called.
        has_robot: whether there is one to stop.
    """

    links: tuple[tuple[str, str], ...] = ROBOT
    brand: str = "CodeBotler"
    has_robot: bool = True

    def __call__(self, title: str, here: str, parts: Sequence[tuple[str, str]] = ()) -> None:
        """Begin a page.

        Args:
            title: of the page.
            here: the address of the page that is marked in the bar.
            parts: names and addresses of its parts, for screens on which they stand below each other.
        """
        ui.page_title(f"{title} · {self.brand}")
        ui.add_head_html(HEAD)
        if self.has_robot:
            ui.add_body_html(BAR)
        with ui.element("header").classes("bar" if self.has_robot else "bar no-stop"):
            html.a(self.brand, href="/").classes("brand")
            if parts:
                with ui.element("nav").classes("parts").props('aria-label="Parts of this page"'):
                    for name, address in parts:
                        html.a(name, href=address)
            with ui.element("nav").classes("pages").props('aria-label="Pages"'):
                for name, address in self.links:
                    link = html.a(name, href=address)
                    if address == here:
                        link.props('aria-current="page"')
