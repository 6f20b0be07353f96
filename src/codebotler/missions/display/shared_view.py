"""`SharedView`: the view of a mission session, which one thread changes and others read or wait for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

from codebotler.missions.display.view import SessionView
from codebotler.missions.mission import Mission
from codebotler.missions.storage.log import LogLine


class SharedView:
    """Holds a session's latest view and events. `changed` is called after each change and must not block."""

    def __init__(self, view: SessionView, changed: Callable[[], None]) -> None:
        self._view, self._changed = view, changed
        self._lock = threading.Condition()  # held briefly, never while calling the mission
        self._events: list[LogLine] = []
        self._mission: Mission | None = None
        self.on_event: Callable[[LogLine], None] = lambda _: None  # an error raised here stops the robot

    def wait_until(self, is_met: Callable[[SessionView], bool]) -> SessionView:
        """Wait until `is_met` accepts the view, or the session ends. Return the latest view."""
        with self._lock:
            self._lock.wait_for(lambda: self._view.is_over or is_met(self._view))
            return self._view

    @property
    def view(self) -> SessionView:
        """The latest snapshot of the session, which the page and the terminal show."""
        return self._view

    @property
    def is_stuck(self) -> bool:
        """Whether a skill is still running after a stop that the robot did not confirm, so it may move."""
        stuck = None if self._mission is None else self._mission.stuck
        return stuck is not None and stuck.is_alive()

    @property
    def may_move(self) -> bool:
        """Whether the robot may still be moving, because it was lost or did not confirm a stop."""
        return self._mission is not None and self._mission.may_move

    def events(self, start: int = 0) -> list[LogLine]:
        """Return the mission's events so far, oldest first, starting at index `start`."""
        return self._events[start:]

    def _add_remark(self, sentence: str) -> None:
        assert self._mission is not None, "the mission exists before questions to the robot"
        self._mission.note(sentence)
        self._show(remarks=(*self._view.remarks, sentence))

    def _add_to_reply(self, piece: str) -> None:
        with self._lock:
            self._change(reply=self._view.reply + piece)

    def _add_event(self, line: LogLine) -> None:
        """Add an event to the view. The mission holds its own lock during this call."""
        with self._lock:
            self._events.append(line)
            self._change(progress=self._view.progress.after(line))
        self.on_event(line)

    def _show(self, **changes: object) -> None:
        with self._lock:
            self._change(**changes)

    def _change(self, **changes: object) -> None:
        """Update the view, including the mission's state. The caller must hold the lock."""
        if self._mission is not None:
            now = self._mission.summary
            changes |= {"state": now.state, "reason": now.reason, "line": now.line}
            if now.has_ended:
                changes["busy"] = ""
        self._view = replace(self._view, **changes)  # type: ignore[arg-type]  # names and values of its fields
        self._lock.notify_all()
        self._changed()
