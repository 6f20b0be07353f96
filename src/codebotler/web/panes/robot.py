"""The third pane: what the robot does, where it is, and what it said and was told."""

from __future__ import annotations

from nicegui import ui

from codebotler.core.world import Room, World, laid_out
from codebotler.missions.mission import State
from codebotler.missions.progress import Moment
from codebotler.missions.session import SessionView
from codebotler.web.console import Console
from codebotler.web.elements import Press, Words
from codebotler.web.floorplan import floorplan
from codebotler.web.panes.question import Asking

HEADLINES = {
    None: "Nothing is asked for",
    State.DRAFTING: "The program is being written",
    State.CHECKED: "Waits for your word",
    State.APPROVED: "About to start",
    State.RUNNING: "Running",
    State.DONE: "Done",
    State.FAILED: "Failed",
    State.STOPPING: "Told to stop; has not stopped yet",
    State.STOPPED: "Stopped",
    State.INTERRUPTED: "Interrupted",
}
SPOKEN = {"says": "said", "asks": "asked", "hears": "was told"}
MOST_MOMENTS = 60


class Status:
    """Shows how far the mission at hand has come.

    Args:
        console: whose mission.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._drawn: tuple[Moment, ...] = ()
        self._mapped: object = None
        with ui.element("section").classes("pane status").props("aria-labelledby=h-status"):
            with ui.element("div").classes("head"):
                Words("h2", "Status").props("id=h-status")
                Words("span", console.robot.name, "robot-name")
            self._gone = ui.element("div").classes("interrupted")
            self._state = Words("p", "", "headline").props("role=status aria-live=polite")
            self._doing = Words("p", "", "doing")
            self._where = Words("p", "", "quiet")
            self._asking = None if console.face is None else Asking(console.face)
            self._reason = Words("p", "", "reason")
            self._map = ui.html("", sanitize=False).classes("map")
            self._log = ui.element("ol").classes("moments").props('tabindex=0 aria-label="What happened"')
        self._tell_interrupted()

    def show(self, view: SessionView) -> None:
        """Show how far it has come."""
        progress = view.progress
        state = view.state
        headline = HEADLINES[state]
        if state is None and view.busy and not view.is_over:
            headline = "About to begin"
        self._state.say(headline)
        self._state.classes(replace=f"headline {state or 'none'}")
        doing = progress.doing
        self._doing.say(doing[:1].upper() + doing[1:] if view.is_running else "")
        where = [f"line {progress.line}"] if progress.line is not None else []
        where += (
            [f"{progress.clock:.1f} s by the robot's clock"] if progress.moments and progress.clock else []
        )
        self._where.say(" · ".join(where))
        self._reason.say(view.reason)
        if self._asking is not None:
            self._asking.show(is_over=view.is_over)
        self._draw_map(view)
        self._draw_moments(progress.moments)

    def _draw_map(self, view: SessionView) -> None:
        progress, plan = view.progress, view.room_map
        world = self._console.world
        if world is None and plan is not None:
            world = World(tuple(map(Room, plan.rooms)), plan.start)
        if world is None:
            return
        room = (plan.room(progress.room) if plan and progress.room else None) or world.robot
        at = progress.at
        if at is None:
            at = next((one.stand_at for one in laid_out(world).rooms if one.name == room), None)
        what = (id(self._console.world), plan, at, room)
        if what != self._mapped:
            self._mapped = what
            self._map.set_content(floorplan(world, at, room))

    def _draw_moments(self, moments: tuple[Moment, ...]) -> None:
        """Put what is new on top; all anew where it is another mission."""
        if moments == self._drawn:
            return
        known = len(self._drawn)
        if moments[:known] != self._drawn or known > MOST_MOMENTS:
            self._log.clear()
            known = max(0, len(moments) - MOST_MOMENTS)
        self._drawn = moments
        with self._log:
            for moment in moments[known:]:
                with ui.element("li").classes(f"moment moment-{moment.kind}") as row:
                    Words("time", f"{moment.clock:.1f} s")
                    if moment.kind in SPOKEN:
                        Words("small", SPOKEN[moment.kind])
                    Words("span", moment.text, "text")
                row.move(target_index=0)

    def _tell_interrupted(self) -> None:
        self._gone.set_visibility(bool(self._console.interrupted))
        with self._gone:
            for summary in self._console.interrupted:
                Words("p", f"Mission {summary.id} was interrupted: {summary.reason}")
            Press("I have seen it", self._seen, "plain")

    def _seen(self) -> None:
        self._console.interrupted = ()
        self._gone.set_visibility(False)
