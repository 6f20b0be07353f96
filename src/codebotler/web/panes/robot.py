"""The status pane: the robot's activity, position and conversation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping

from nicegui import ui

from codebotler.core.skills.declaration import by_event
from codebotler.core.terminal import shortened
from codebotler.core.world import Room, World, laid_out
from codebotler.missions.display.progress import ANSWER, Moment, position_on_map
from codebotler.missions.display.view import Phase, SessionView
from codebotler.missions.display.wording import reason_text, title
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.web.console import Console
from codebotler.web.floorplan import MapState, floorplan, room_at
from codebotler.web.frame import Button, DrawnBox, PlainText, script
from codebotler.web.panes.continuing import ContinueButton, can_be_continued
from codebotler.web.panes.question import QuestionPane

_PHASE_HEADLINES: Mapping[Phase, str] = {
    "": "No mission yet",
    "writing": "Writing the program",
    "checking": "Checking the program",
    "no-program": "No program yet",
    "question": "Which did you mean?",
    MissionState.CHECKED: "Ready: waiting for your approval",
    MissionState.APPROVED: "Starting",
}
CONTINUE_HINT = "Nothing moves until you approve the rest."
_MAX_LISTED_MOMENTS, _MAX_TITLE = 60, 160


class RobotPane:
    """Shows the state of the current mission, the robot on a map, and what has happened."""

    def __init__(self, console: Console, model: Callable[[], str]) -> None:
        self._console = console
        self._drawn: tuple[Moment, ...] = ()
        self._mapped: object = None
        script("moments.js")
        with ui.element("section").classes("pane status").props("aria-labelledby=h-status"):
            with ui.element("div").classes("head"):
                PlainText("h2", "Status").props("id=h-status")
                PlainText("span", console.robot.name, "robot-name")
            self._interrupted = DrawnBox("interrupted", self._draw_interrupted)
            self._state = PlainText("p", "", "headline").props("role=status aria-live=polite")
            self._doing = PlainText("p", "", "doing")
            self._where = PlainText("p", "", "quiet")
            self._asking = None if console.face is None else QuestionPane(console.face)
            self._reason = PlainText("p", "", "reason")
            self._warning = PlainText("p", "", "lost").props("role=alert")
            self._continue = ContinueButton(console, model=model)
            self._hint = PlainText("p", "", "quiet")
            self._map = ui.html("", sanitize=False).classes("map")
            self._log = ui.element("ol").classes("moments").props('tabindex=0 aria-label="What happened"')

    def show(self, view: SessionView) -> None:
        """Show the mission's state, the robot on its map, and what has happened so far."""
        self._interrupted.show(self._console.interrupted or None)
        progress = view.progress
        self._state.show_text(_headline(view))
        self._state.classes(replace=f"headline {view.phase or 'none'}")
        doing = progress.doing
        self._doing.show_text(doing[:1].upper() + doing[1:] if view.is_running else "")
        where = [f"line {progress.line}"] if progress.line is not None else []
        where += [f"holding {shortened(progress.held, 60)}"] if progress.held else []
        if progress.moments and progress.clock:
            where.append(f"{progress.clock:.1f} s on the robot's clock")
        self._where.show_text(" · ".join(where))
        self._reason.show_text(reason_text(view.reason, view.line))
        lost = "" if view.is_over and view.progress.has_begun else self._console.warning  # else its reason
        self._warning.show_text(lost)
        self._continue.show(view)
        self._hint.show_text(CONTINUE_HINT if self._continue.visible else "")
        if self._asking is not None:
            self._asking.show(is_over=view.is_over)
        self._draw_map(view)
        self._draw_moments(progress.moments)

    def _draw_map(self, view: SessionView) -> None:
        room_map, world = view.room_map, self._console.world
        if world is None and room_map is not None:
            world = World(tuple(map(Room, room_map.rooms)), room_map.start)
        if world is None:
            return
        state = map_state(view, world)
        what = (id(self._console.world), room_map, state)
        if what != self._mapped:
            self._mapped = what
            self._map.set_content(floorplan(world, state))

    def _draw_moments(self, moments: tuple[Moment, ...]) -> None:
        """Append new moments and scroll to them, or redraw the whole list for another mission."""
        if moments == self._drawn:
            return
        known = len(self._drawn)
        if moments[:known] != self._drawn or known > _MAX_LISTED_MOMENTS:
            self._log.clear()
            known = max(0, len(moments) - _MAX_LISTED_MOMENTS)
        self._drawn = moments
        with self._log:
            for moment in moments[known:]:
                with ui.element("li").classes(f"moment moment-{moment.kind}"):
                    PlainText("time", f"{moment.clock:.1f} s")
                    row = by_event(moment.kind)
                    verb = None if row is None else row.verb
                    if moment.kind == ANSWER or verb is not None:
                        PlainText("small", "heard" if verb is None else verb.past)
                    PlainText("span", moment.text, "text")
        ui.run_javascript(f"moments.follow({self._log.id})")

    def _draw_interrupted(self, summaries: tuple[MissionSummary, ...]) -> None:
        for summary in summaries:
            what = shortened(title(summary), _MAX_TITLE)
            PlainText("p", f"Mission {summary.id} ({what}) was interrupted: {summary.reason}")
            if can_be_continued(summary):
                button = ContinueButton(self._console, summary.id)
                button.props(f'aria-label="Continue mission {summary.id}"')
        Button("Dismiss", self._console.dismiss, "plain")


def _headline(view: SessionView) -> str:
    if view.phase == MissionState.CHECKED and view.problems:
        return "The program has problems" if view.can_run else "The program cannot run"
    if view.phase == MissionState.CHECKED and view.past is not None:
        return "Ready: the rest waits for your approval"
    return _PHASE_HEADLINES.get(view.phase) or view.phase.capitalize()


def map_state(view: SessionView, world: World) -> MapState:
    """Return where the robot is and was, and what it has found, with the names of rooms in `world`."""
    progress, rooms = view.progress, laid_out(world).rooms
    room_map = view.room_map or RoomMap.of(world)

    def room_of(words: str) -> str:
        return (room_map.room(words) if words else None) or world.robot

    room, finds = room_of(progress.room), defaultdict[str, list[str]](list)
    for find in progress.finds:
        finds[room_of(find.room)].append(find.name)
    at = position_on_map(progress, world, room_map)
    if progress.is_between and not progress.is_driving:
        room = room_at(rooms, at) if at else ""
    return MapState(at, room, progress.is_driving, progress.trail, dict(finds), progress.held)
