"""The operator's page with its three panes."""

from __future__ import annotations

from nicegui import ui

from codebotler.missions.display.view import SessionView
from codebotler.web.console import Console
from codebotler.web.frame import PAGE_BUILD_SECONDS, Frame, PlainText
from codebotler.web.live import follow
from codebotler.web.panes import mission_list, past_mission
from codebotler.web.panes.instruction import InstructionPane
from codebotler.web.panes.program import ProgramPane
from codebotler.web.panes.robot import RobotPane

_PARTS = (("Instruct", "#h-instruct"), ("Program", "#h-program"), ("Status", "#h-status"))


def add(console: Console, frame: Frame) -> None:
    """Add the pages for operators: the three panes, the list of missions, and each mission."""

    @ui.page("/", response_timeout=PAGE_BUILD_SECONDS)
    async def operate() -> None:
        frame("Robot", "/", _PARTS)
        PlainText("h1", "Operate the robot", "unseen")
        with ui.element("div") as box:
            instruction = InstructionPane(console)
            panes = (instruction, ProgramPane(console), RobotPane(console, lambda: instruction.model))

        def show() -> None:
            view = console.view
            step = _next_step(view, has_notice=bool(console.interrupted))
            box.classes(replace=f"operate to-{step}")
            for pane in panes:
                pane.show(view)

        async def update() -> None:
            with box:
                show()
            await instruction.follow(console.view)

        show()
        await follow(console.notifier, update)
        await instruction.load()

    mission_list.add(console, frame)
    past_mission.add(console, frame)


def _next_step(view: SessionView, *, has_notice: bool) -> str:
    """Return the operator's next step, which determines the order of panes on small screens."""
    if view.is_running:
        return "watch"
    if not view.is_over:
        return "decide"
    return "ask" if view.error or (view.state is None and not has_notice) else "see"
