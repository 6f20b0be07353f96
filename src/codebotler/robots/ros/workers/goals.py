"""The base class of workers: perform one skill at a time as a goal, and supervise it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from channel import Channel, Fields, SetupError
from reports import MotionReports

WATCH_SECONDS = 0.1  # between two rounds of the watchdog
ALIVE_SECONDS = 1.0  # between two signs of life
TOOL_SILENCE = 0.7  # seconds without a sign of life of the tool; then the robot is stopped
FEEDBACK_INTERVAL = 0.5  # seconds between two feedbacks to the tool
END_SECONDS = 1.0  # for a cancelled goal, when the worker ends
PICTURE_SECONDS = 0.5  # for a picture after the result, since it has its own connection
MAX_PICTURE_BYTES = 2_000_000

ROS1_ENDS = {2: "cancelled", 3: "succeeded", 4: "aborted", 5: "rejected", 8: "cancelled", 9: "lost"}
"""The end of a goal, by the status of actionlib_msgs/GoalStatus."""

ROS2_ENDS = {4: "succeeded", 5: "cancelled", 6: "aborted"}
"""The end of a goal, by the status of action_msgs/msg/GoalStatus."""


class Goal:
    """The current goal, with times of the monotonic clock."""

    def __init__(self, number: int, server: Any) -> None:
        self.number, self.server = number, server
        self.lock = threading.RLock()
        self.stop: Callable[[], object] | None = None  # sends a cancel; set when the goal is sent
        self.handle: Any = None  # actionlib forgets goals without a handle
        self.sent: float | None = None
        self.is_acknowledged = self.is_over = False
        self.status_ended: float | None = None  # from then on, only the result is missing
        self.cancelled: float | None = None
        self.last_feedback = 0.0
        self.end_event, self.picture_event = threading.Event(), threading.Event()

    def cancel(self) -> None:
        """Cancel the goal; if it has not been sent, it never will be."""
        with self.lock:
            self.cancelled = self.cancelled or time.monotonic()
            if self.stop is not None:
                self.stop()


class Server:
    """The server for one skill, seen from a client."""

    has_cancelled = True  # unless it must confirm that

    def __init__(self, call: Fields) -> None:
        self.name: str = call["server"]
        self.type: str = call["type"]

    def last_sign(self) -> float:
        """Return the time of its last sign of life; now, if its death shows in another way."""
        return time.monotonic()

    def has_pictures(self) -> bool:
        """Whether it publishes pictures."""
        return False

    def cancel(self) -> None:
        """Cancel all goals of all clients."""


class SkillWorker:
    """Performs skills, one at a time; subclasses implement `connect` and `send`.

    The first line has the `address`, the `node`, the `calls` by skill, folders of `packages`, the topics of
    the `pose`, the `velocity` and `keepout`, whether to `cancel_all` goals, the `sign`, a file that names the
    server with a running goal, and the time limits `patience`, `silence` and `longest`.
    """

    graph: Any
    servers: dict[str, Any]
    settles = 0.0  # seconds for the connection with a server, in addition to the patience
    silence_says = ""  # how a dead server shows, if not by its silence

    def __init__(self, channel: Channel, start: Fields) -> None:
        self.channel = channel
        self.patience: float = start["patience"]
        self.silence: float = start["silence"]
        self.longest: float = start["longest"]
        self.goal: Goal | None = None
        self._sign = Path(start["sign"])
        running = self._sign.read_text() if self._sign.exists() else ""
        has_dead_twin = self.connect(start) or bool(running)
        if running and running not in {server.name for server in self.servers.values()}:
            raise SetupError(
                f"an earlier tool was killed while {running} went on, which this connection cannot cancel; "
                f"connect as then, or stop the robot by hand and delete {self._sign}"
            )
        self._listen(start)
        missing = self.missing()
        if self.graph.has_left():
            raise SetupError(self.graph.explain_end())
        cancelled_all = (has_dead_twin or start["cancel_all"]) and self.cancel_all()
        if cancelled_all:
            self._sign.unlink(missing_ok=True)
        threading.Thread(target=self._watch, daemon=True).start()
        self.channel.send("ready", missing=missing, cancelled_all=cancelled_all)

    def connect(self, start: Fields) -> bool:
        """Set `graph` and `servers`; return whether an earlier worker died and left its node behind."""
        raise NotImplementedError

    def send(self, goal: Goal, fields: Fields) -> None:
        """Send a goal; the caller holds its lock."""
        raise NotImplementedError

    def listen(
        self, topic: str, hear: Callable[[Fields], object], *, is_needed: bool = True
    ) -> Callable[[], object] | None:
        """Subscribe to a topic, with messages as plain data; return the function that unsubscribes.

        If the topic is missing, raise SetupError where it `is_needed`, else return None.
        """
        raise NotImplementedError

    def publish(self, topic: str, fields: Fields) -> None:
        """Publish a latched message on a topic of `keepout`."""
        raise NotImplementedError

    def start(self, goal: Goal, fields: Fields) -> None:
        """Send a goal, unless it was cancelled."""
        with goal.lock:
            if goal.cancelled is not None:
                self.end(goal, "cancelled")
            else:
                self._sign.write_text(goal.server.name)
                self.send(goal, fields)

    def obey(self, line: Fields) -> None:
        """Perform or cancel a skill."""
        if line["do"] == "perform":
            server = self.servers[line["skill"]]
            self.goal = goal = Goal(line["id"], server)
            if server.is_connected(self.silence):
                self.start(goal, line["fields"])
            else:
                threading.Thread(target=self._wait_and_send, args=(goal, line["fields"]), daemon=True).start()
        elif line["do"] == "look":
            self.goal = looking = Goal(line["id"], None)
            looking.stop = lambda: self.end(looking, "cancelled")
            threading.Thread(target=self._look, args=(looking, line["topic"]), daemon=True).start()
        elif line["do"] == "publish":
            self.publish(line["topic"], line["fields"])
        elif line["do"] == "cancel":
            if self.goal is not None:
                self.goal.cancel()
            self.channel.send("cancel-sent")

    def leave(self) -> None:
        """Cancel the goal, and leave the graph."""
        self.stop()
        self.graph.leave()

    def stop(self) -> None:
        """Cancel the goal, and wait briefly for its end."""
        goal = self.goal
        if goal is not None and not goal.is_over:
            goal.cancel()
            goal.end_event.wait(END_SECONDS)
        if goal is not None and goal.cancelled is not None:
            time.sleep(WATCH_SECONDS)  # ROS sends in threads of its own

    def missing(self) -> dict[str, str]:
        """Return why servers cannot be reached, by skill."""
        self.wait_for_servers()
        return {
            skill: self.graph.explain_missing(server.name, server.type)
            for skill, server in self.servers.items()
            if not server.is_connected(self.silence)
        }

    def wait_for_servers(self) -> None:
        """Wait for connections with the servers on the graph."""
        deadline = time.monotonic() + self.patience
        present = [server for server in self.servers.values() if self.graph.nodes_of(server.name)]
        # Ask all servers in each round, since the first call starts the time that a connection needs.
        while (
            sum(s.is_connected(self.silence) for s in present) < len(present) and time.monotonic() < deadline
        ):
            if self.graph.has_left():
                break
            time.sleep(0.005)

    def cancel_all(self) -> bool:
        """Cancel all goals of all clients; return whether that is possible."""
        for server in self.servers.values():
            server.cancel()
        time.sleep(WATCH_SECONDS)  # ROS sends in threads of its own
        return True

    def look_after(self, goal: Goal, sent: float, now: float) -> None:
        """End a goal that has failed."""
        fault = self._find_fault(goal, sent, now)
        if fault is not None:
            self.end(goal, "lost", text=fault)

    def end(self, goal: Goal, kind: str, **more: Any) -> None:
        """Report the end of a goal, once."""
        with goal.lock:
            if goal.is_over:
                return
            goal.is_over = True
        if kind == "lost":
            goal.cancel()
        else:
            self._sign.unlink(missing_ok=True)
        self.channel.send(kind, id=goal.number, **more)
        goal.end_event.set()

    def pass_on(self, goal: Goal, feedback: dict[str, Any]) -> None:
        """Report the text and number fields of a feedback, at a limited rate."""
        plain = {name: value for name, value in feedback.items() if not isinstance(value, (dict, list))}
        text = ", ".join(
            f"{name}: {value:.4g}" if isinstance(value, float) else f"{name}: {value}"
            for name, value in plain.items()
        )
        now = time.monotonic()
        if text and not goal.is_over and now - goal.last_feedback > FEEDBACK_INTERVAL:
            goal.last_feedback = now
            self.channel.send("feedback", id=goal.number, text=text)

    def finish(self, goal: Goal, state: str, values: Fields, text: str = "") -> None:
        """End a goal with the state of its server: succeeded, aborted, rejected, cancelled or lost."""
        if state == "lost":
            self.end(goal, "lost", text=text)
        elif state == "cancelled" or goal.cancelled is not None:
            self.end(goal, "cancelled")
        elif state != "succeeded":
            self.end(goal, "error", state=state, text=text, values=values)
        elif goal.picture_event.is_set() or not goal.server.has_pictures():
            self.end(goal, "result", values=values)
        else:
            threading.Thread(target=self._end_with_picture, args=(goal, values), daemon=True).start()

    def pass_picture(self, server: Any, data: str) -> None:
        """Pass on a picture, in base64, from the server of the current goal."""
        goal = self.goal
        if goal is None or goal.server is not server or goal.sent is None or goal.is_over:
            return
        size = len(data) * 3 // 4
        if size > MAX_PICTURE_BYTES:
            text = f"a picture of {size:,} bytes was left out; the limit is {MAX_PICTURE_BYTES:,} bytes"
            self.channel.send("feedback", id=goal.number, text=text)
        else:
            self.channel.send("picture", id=goal.number, data=data)
        goal.picture_event.set()

    def _end_with_picture(self, goal: Goal, values: Fields) -> None:
        """Wait briefly for the picture of a goal, and end the goal."""
        goal.picture_event.wait(PICTURE_SECONDS)
        self.end(goal, "result", values=values)

    def _look(self, goal: Goal, topic: str) -> None:
        """Send the next picture of a topic; subscribe only for that time, since pictures are large."""
        pictures: list[Fields] = []
        unsubscribe, deadline = None, time.monotonic() + self.patience
        text = f"no picture arrived on {topic}; is the camera's node running?"
        try:
            while not (pictures or goal.is_over) and time.monotonic() < deadline:
                unsubscribe = unsubscribe or self.listen(topic, pictures.append, is_needed=False)
                time.sleep(0.01)
        except SetupError as error:
            text = str(error)
        if unsubscribe is not None:
            unsubscribe()
        if pictures:
            self.end(goal, "result", values=pictures[0])
        else:
            self.end(goal, "error", state="aborted", text=text)

    def _listen(self, start: Fields) -> None:
        """Subscribe to the topics of poses and velocities."""
        pose, velocity = start["pose"], start["velocity"]
        reports = MotionReports(self.channel, pose and pose["frames"])
        if pose is not None:
            self.listen(pose["topic"], reports.report_pose)
            if pose["frames"]:
                self.listen(pose["topic"] + "_static", reports.report_pose, is_needed=False)
        if velocity is not None:
            self.listen(velocity["topic"], reports.report_velocity)

    def _wait_and_send(self, goal: Goal, fields: Fields) -> None:
        deadline = time.monotonic() + self.patience + self.settles
        while time.monotonic() < deadline and not self.graph.has_left():
            if goal.cancelled is not None or goal.server.is_connected(self.silence):
                self.start(goal, fields)
                return
            time.sleep(0.005)
        why = self.graph.explain_missing(goal.server.name, goal.server.type)
        self.end(goal, "unsent", text=why)

    def _watch(self) -> None:
        """Send signs of life, and supervise the current goal."""
        last_sign = 0.0
        while True:
            time.sleep(WATCH_SECONDS)
            now = time.monotonic()
            if now - last_sign >= ALIVE_SECONDS:
                self.channel.send("alive")
                last_sign = now
            if self.graph.has_left():
                self.channel.send("gone", text=self.graph.explain_end())
                return
            goal = self.goal
            if goal is None or goal.is_over:
                continue
            if now - self.channel.last_sign > TOOL_SILENCE:
                why = f"CodeBotler gave no sign of life for {TOOL_SILENCE:g} s, so the robot was stopped"
                self.end(goal, "lost", text=why)
            elif goal.sent is not None:
                self.look_after(goal, goal.sent, now)

    def _find_fault(self, goal: Goal, sent: float, now: float) -> str | None:
        """Return why a goal has failed, or None."""
        server, late = goal.server.name, now - self.patience
        if max(goal.server.last_sign(), sent) < now - self.silence:
            why = self.silence_says or f"no status for {self.silence:g} s"
            return f"the action server at {server} has died: {why}"
        if goal.cancelled is not None and goal.cancelled < late:
            return f"{server} was told to stop, but did not confirm it within {self.patience:g} s"
        if not goal.is_acknowledged and sent < late:
            return f"{server} did not accept the goal within {self.patience:g} s"
        if goal.status_ended is not None and goal.status_ended < late:
            return f"{server} ended the goal, but sent no result within {self.patience:g} s"
        if sent < now - self.longest:
            return f"{server} did not finish within {self.longest:g} s; the goal was cancelled"
        return None
