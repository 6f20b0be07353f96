"""The operator's page: its three panes, kept in step with the desk."""

from __future__ import annotations

from nicegui import html, ui

from codebotler.web.desk import Desk
from codebotler.web.instruct import Instruct
from codebotler.web.past import add as add_past
from codebotler.web.programpane import ProgramPane
from codebotler.web.status import Status
from codebotler.web.words import Words

EVERY = 0.1
"""Seconds after which a page looks whether something has changed."""

HEAD = '<link rel="stylesheet" href="/static/page.css">'
BAR = """<div id="stop-bar"><span id="stop-told" role="status" aria-live="assertive"></span>
<button id="stop" type="button" aria-keyshortcuts="Escape"><b>STOP</b><small>Esc</small></button></div>
<script src="/static/stop.js"></script>"""


def frame(title: str, here: str) -> None:
    """What all pages of an operator have: the bar with STOP, which needs nothing of the rest to work.

    Args:
        title: of the page.
        here: the address of the page.
    """
    ui.page_title(f"{title} · CodeBotler")
    ui.add_head_html(HEAD)
    ui.add_body_html(BAR)
    with ui.element("header").classes("bar"):
        html.a("CodeBotler", href="/").classes("brand")
        with ui.element("nav").props('aria-label="Pages"'):
            for name, address in (("Robot", "/"), ("Missions", "/missions")):
                link = html.a(name, href=address)
                if address == here:
                    link.props('aria-current="page"')


def add(desk: Desk) -> None:
    """Put the operator's pages at their addresses.

    Args:
        desk: what they show.
    """

    @ui.page("/", response_timeout=10.0)
    async def operate() -> None:
        frame("Robot", "/")
        Words("h1", "Operate the robot", "unseen")
        with ui.element("div").classes("operate"):
            instruct = Instruct(desk)
            program = ProgramPane(desk)
            status = Status(desk)
        seen = -1

        def refresh() -> None:
            nonlocal seen
            version = desk.board.version
            if version != seen:
                seen = version
                view = desk.view
                for pane in (instruct, program, status):
                    pane.show(view)

        refresh()
        ui.timer(EVERY, refresh, immediate=False)
        await ui.context.client.connected()
        await instruct.load()

    add_past(desk, frame)
