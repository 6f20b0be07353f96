"""The operator's page: its three panes, kept in step with the console."""

from __future__ import annotations

from nicegui import ui

from codebotler.missions.session import SessionView
from codebotler.web.console import Console
from codebotler.web.elements import Words
from codebotler.web.frame import PATIENCE, Frame
from codebotler.web.panes.instruction import Instruct
from codebotler.web.panes.past import add as add_past
from codebotler.web.panes.program import ProgramPane
from codebotler.web.panes.robot import Status

PARTS = (("Instruct", "#h-instruct"), ("Program", "#h-program"), ("Status", "#h-status"))
EVERY = 0.1
"""Seconds after which a page looks whether something has changed."""


def add(console: Console, frame: Frame) -> None:
    """Put the operator's pages at their addresses.

    Args:
        console: what they show.
        frame: what all pages have.
    """

    @ui.page("/", response_timeout=PATIENCE)
    async def operate() -> None:
        frame("Robot", "/", PARTS)
        Words("h1", "Operate the robot", "unseen")
        with ui.element("div") as panes:
            instruct = Instruct(console)
            program = ProgramPane(console)
            status = Status(console)
        seen = -1

        def refresh() -> None:
            nonlocal seen
            version = console.notifier.version
            if version != seen:
                seen = version
                view = console.view
                panes.classes(replace=f"operate to-{_next(view)}")
                for pane in (instruct, program, status):
                    pane.show(view)

        refresh()
        ui.timer(EVERY, refresh, immediate=False)
        await ui.context.client.connected()
        await instruct.load()

    add_past(console, frame)


def _next(view: SessionView) -> str:
    """What there is to do for an operator now, by which a small screen puts its panes in order."""
    if view.is_running:
        return "watch"
    if not view.is_over:
        return "decide"
    return "ask" if view.state is None or view.trouble else "see"
