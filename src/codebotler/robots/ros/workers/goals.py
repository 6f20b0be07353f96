"""The base class of workers. A worker sends one skill at a time to the robot as a goal, and watches it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from channel import Channel, Fields, SetupError
from reports import MotionReports

WATCH_SECONDS = 0.1  # the interval between two checks of the current goal
ALIVE_SECONDS = 1.0  # the interval between two heartbeats to CodeBotler
TOOL_SILENCE = 0.7  # the robot is stopped after this many seconds without a heartbeat from CodeBotler
FEEDBACK_INTERVAL = 0.5  # the minimum time in seconds between two feedback messages to CodeBotler
END_SECONDS = 1.0  # how long an ending worker waits for its cancelled goal to end
PICTURE_SECONDS = 0.5  # how long to wait after a result for its picture, which comes over its own connection

ROS1_ENDS = {2: "cancelled", 3: "succeeded", 4: "aborted", 5: "rejected", 8: "cancelled", 9: "lost"}
"""How a goal has ended, by its status in actionlib_msgs/GoalStatus."""

ROS2_ENDS = {4: "succeeded", 5: "cancelled", 6: "aborted"}
"""How a goal has ended, by its status in action_msgs/msg/GoalStatus."""


class Goal:
    """A request to a server to perform a skill, and its progress. All times are on the monotonic clock."""

    def __init__(self, number: int, server: Any) -> None:
        self.number, self.server = number, server
        self.lock = threading.RLock()
        self.stop: Callable[[], object] | None = None  # a function that sends a cancel, once the goal is sent
        self.handle: Any = None  # the ROS handle, which keeps actionlib from forgetting the goal
        self.sent: float | None = None
        self.is_acknowledged = self.is_over = False
        self.status_ended: float | None = None  # when the status showed the end; the result may arrive later
        self.cancelled: float | None = None
        self.last_feedback = 0.0
        self.end_event, self.picture_event = threading.Event(), threading.Event()

    def cancel(self) -> None:
        """Cancel the goal. If it has not been sent yet, it will never be sent."""
        with self.lock:
            self.cancelled = self.cancelled or time.monotonic()
            if self.stop is not None:
                self.stop()


class Server:
    """A client for the action server, service or topic of one skill."""

    has_cancelled = True  # False while a cancel still has to be confirmed

    def __init__(self, call: Fields) -> None:
        self.name: str = call["server"]
        self.type: str = call["type"]

    def last_alive(self) -> float:
        """Return the monotonic time of the last sign of life, or the current time if this is not tracked."""
        return time.monotonic()

    def has_pictures(self) -> bool:
        """Return whether the server publishes pictures."""
        return False

    def cancel(self) -> None:
        """Cancel all goals of all clients. Servers that have no goals ignore this."""


class SkillWorker:
    """Performs skills, one at a time. Subclasses implement at least `connect`, `send` and `listen`.

    The first message, `start`, has these fields:
    - for the connection: its `address`, the name of the `node`, `calls` by skill, and folders of `packages`;
    - for the motion: the topics `pose`, `velocity` and `keepout`, and the `frames` of poses from tf;
    - for goals that still run: whether to `cancel_all`, and `sign`, the path of a file that contains
      the name of the server of a running goal;
    - time limits in seconds: `patience`, `silence` and `longest`.
    """

    graph: Any
    servers: dict[str, Any]
    settles = 0.0  # how many seconds beyond the patience connecting to a server may take
    silence_says = ""  # the reason to give for a dead server, unless its status messages are missing

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
            why = f"CodeBotler was killed while {running} had a goal, which this connection cannot cancel"
            mend = "connect with the same options as before, or stop the robot by hand"
            raise SetupError(f"{why}; {mend} and delete {self._sign}")
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
        """Connect to ROS and set `graph` and `servers`. Return whether a dead worker left its node behind."""
        raise NotImplementedError

    def send(self, goal: Goal, fields: Fields) -> None:
        """Send a goal with these message fields. The caller must hold the goal's lock."""
        raise NotImplementedError

    def listen(
        self, topic: str, hear: Callable[[Fields], object], *, is_needed: bool = True
    ) -> Callable[[], object] | None:
        """Pass the messages of a topic to `hear` as plain data. Return a function that unsubscribes.

        If nothing publishes the topic, raise SetupError if `is_needed`, else return None.
        """
        raise NotImplementedError

    def publish(self, topic: str, fields: Fields) -> None:
        """Publish a latched message on one of the keepout topics."""
        raise NotImplementedError

    def start(self, goal: Goal, fields: Fields) -> None:
        """Send a goal, or report its end if it was already cancelled."""
        with goal.lock:
            if goal.cancelled is not None:
                self.end(goal, "cancelled")
            else:
                self._sign.write_text(goal.server.name)
                self.send(goal, fields)

    def obey(self, line: Fields) -> None:
        """Handle a message from CodeBotler: perform, look, publish or cancel."""
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
        """Cancel the current goal and leave the ROS graph."""
        self.stop()
        self.graph.leave()

    def stop(self) -> None:
        """Cancel the current goal, and wait up to 1 second for it to end."""
        goal = self.goal
        if goal is not None and not goal.is_over:
            goal.cancel()
            goal.end_event.wait(END_SECONDS)
        if goal is not None and goal.cancelled is not None:
            time.sleep(WATCH_SECONDS)  # ROS sends messages in its own threads

    def missing(self) -> dict[str, str]:
        """Map each skill whose server cannot be reached to a message that says why."""
        self.wait_for_servers()
        return {
            skill: self.graph.explain_missing(server.name, server.type)
            for skill, server in self.servers.items()
            if not server.is_connected(self.silence)
        }

    def wait_for_servers(self) -> None:
        """Wait up to `patience` seconds for all servers on the graph to be connected."""
        deadline = time.monotonic() + self.patience
        present = [server for server in self.servers.values() if self.graph.nodes_of(server.name)]
        # Ask all servers in each round, because a server's first call starts the timer for its connection.
        while sum(server.is_connected(self.silence) for server in present) < len(present):
            if time.monotonic() >= deadline or self.graph.has_left():
                break
            time.sleep(0.005)

    def cancel_all(self) -> bool:
        """Cancel all goals of all clients, and return whether this was possible."""
        for server in self.servers.values():
            server.cancel()
        time.sleep(WATCH_SECONDS)  # ROS sends messages in its own threads
        return True

    def check_goal(self, goal: Goal, sent: float, now: float) -> None:
        """End a goal that was sent at time `sent` as lost if its server has died or is too slow by `now`."""
        fault = self._find_fault(goal, sent, now)
        if fault is not None:
            self.end(goal, "lost", text=fault)

    def end(self, goal: Goal, kind: str, **more: Any) -> None:
        """Report the end of a goal with a message of `kind`, such as `result`. Later calls do nothing."""
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
        """Report the text and number fields of a feedback message, at most twice a second."""
        plain = {name: value for name, value in feedback.items() if not isinstance(value, (dict, list))}
        shown = {name: f"{value:.4g}" if isinstance(value, float) else value for name, value in plain.items()}
        text = ", ".join(f"{name}: {value}" for name, value in shown.items())
        now = time.monotonic()
        if text and not goal.is_over and now - goal.last_feedback > FEEDBACK_INTERVAL:
            goal.last_feedback = now
            self.channel.send("feedback", id=goal.number, text=text)

    def finish(self, goal: Goal, state: str, values: Fields, text: str = "") -> None:
        """End a goal: succeeded, aborted, rejected, cancelled or lost. `values` is its result, `text` why."""
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
        """Send a picture in base64 to CodeBotler if it comes from the current goal's server."""
        goal = self.goal
        if goal is None or goal.server is not server or goal.sent is None or goal.is_over:
            return
        self.channel.send("picture", id=goal.number, data=data)
        goal.picture_event.set()

    def _end_with_picture(self, goal: Goal, values: Fields) -> None:
        goal.picture_event.wait(PICTURE_SECONDS)
        self.end(goal, "result", values=values)

    def _look(self, goal: Goal, topic: str) -> None:
        """Send the next picture on a topic. Because pictures are large, subscribe only until it arrives."""
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
        reports = MotionReports(self.channel, start["frames"])
        if start["pose"]:
            self.listen(start["pose"], reports.report_pose)
        if start["frames"]:
            self.listen(start["pose"] + "_static", reports.report_pose, is_needed=False)
        if start["velocity"]:
            self.listen(start["velocity"], reports.report_velocity)

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
        """Send heartbeats and supervise the current goal, until our node leaves the graph."""
        last_sent = 0.0
        while True:
            time.sleep(WATCH_SECONDS)
            now = time.monotonic()
            if now - last_sent >= ALIVE_SECONDS:
                self.channel.send("alive")
                last_sent = now
            if self.graph.has_left():
                self.channel.send("gone", text=self.graph.explain_end())
                return
            goal = self.goal
            if goal is None or goal.is_over:
                continue
            if now - self.channel.last_alive > TOOL_SILENCE:
                why = f"CodeBotler gave no sign of life for {TOOL_SILENCE:g} s, so the robot was stopped"
                self.end(goal, "lost", text=why)
            elif goal.sent is not None:
                self.check_goal(goal, goal.sent, now)

    def _find_fault(self, goal: Goal, sent: float, now: float) -> str | None:
        """Return a message that explains why a goal has failed, or None if it has not."""
        server, late = goal.server.name, now - self.patience
        if max(goal.server.last_alive(), sent) < now - self.silence:
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
