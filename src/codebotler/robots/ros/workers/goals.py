"""What all workers have in common: performing one skill at a time as a goal, and watching it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from channel import Channel, Message, SetupError
from reports import MotionReports

TICK = 0.1  # seconds between two rounds of the watchdog
ALIVE = 1.0  # seconds between two signs of life
TOOL_SILENCE = 0.7  # seconds without a sign of life of the tool, after which the robot is stopped
TELLS_AGAIN = 0.5  # seconds between two feedbacks that are passed on
LAST_WORDS = 1.0  # seconds for a cancelled goal to end when the worker does
LAST_PICTURE = 0.5  # seconds for a picture to come after the result, over a connection of its own
LARGEST_PICTURE = 2_000_000  # bytes

ENDS_ROS1 = {2: "cancelled", 3: "succeeded", 4: "aborted", 5: "rejected", 8: "cancelled", 9: "lost"}
"""How a goal ended, by the status of actionlib_msgs/GoalStatus."""

ENDS_ROS2 = {4: "succeeded", 5: "cancelled", 6: "aborted"}
"""How a goal ended, by the status of action_msgs/msg/GoalStatus."""


class Goal:
    """The goal that goes on, with times by the monotonic clock."""

    def __init__(self, number: int, server: Any) -> None:
        self.number, self.server = number, server
        self.lock = threading.RLock()
        self.stop: Callable[[], object] | None = None  # sends a cancel, once there is something to cancel
        self.handle: Any = None  # kept, since actionlib forgets goals whose handles are gone
        self.sent: float | None = None
        self.is_acknowledged = self.is_over = False
        self.status_ended: float | None = None  # since then only the result is missing
        self.cancelled: float | None = None
        self.told = 0.0  # when its last feedback was passed on
        self.ended, self.seen = threading.Event(), threading.Event()

    def cancel(self) -> None:
        """Cancel it; if it has not been sent yet, it never will be."""
        with self.lock:
            self.cancelled = self.cancelled or time.monotonic()
            if self.stop is not None:
                self.stop()


class Server:
    """What performs one skill, seen from a client; what it does need not be possible to cancel."""

    has_cancelled = True  # as far as it can

    def __init__(self, call: Message) -> None:
        self.name: str = call["server"]
        self.type: str = call["type"]

    def heard(self) -> float:
        """When it last gave a sign of life, by the monotonic clock; now, if its death shows otherwise."""
        return time.monotonic()

    def shows_pictures(self) -> bool:
        """Whether anything publishes what it sees."""
        return False

    def cancel(self) -> None:
        """Cancel all goals of all clients."""


class SkillWorker:
    """Performs skills, one at a time; `connect` and `send` belong to one kind of robot.

    The first line has the `address`, the `node`, the `calls` by skill, folders of `packages`, the topics of
    the `pose`, the `velocity` and `keepout`, whether to `cancel_all` goals, the `sign`, a file that names
    the server whose goal may go on, and the seconds to wait: `patience`, `silence` and `longest`.
    """

    graph: Any
    servers: dict[str, Any]
    settles = 0.0  # seconds that a connection with a server takes beyond the patience
    silence_says = ""  # how the death of a server shows, if not by its silence

    def __init__(self, channel: Channel, start: Message) -> None:
        self.channel = channel
        self.patience: float = start["patience"]
        self.silence: float = start["silence"]
        self.longest: float = start["longest"]
        self.goal: Goal | None = None
        self._sign = Path(start["sign"])
        going_on = self._sign.read_text() if self._sign.exists() else ""
        left_behind = self.connect(start) or bool(going_on)
        if going_on and going_on not in {server.name for server in self.servers.values()}:
            raise SetupError(
                f"an earlier tool was killed while {going_on} went on, which this connection cannot cancel; "
                f"connect as then, or stop the robot by hand and delete {self._sign}"
            )
        self._listen(start)
        missing = self.missing()
        if self.graph.is_left():
            raise SetupError(self.graph.why_left())
        cancelled_all = (left_behind or start["cancel_all"]) and self.cancel_all()
        if cancelled_all:
            self._sign.unlink(missing_ok=True)
        threading.Thread(target=self._watch, daemon=True).start()
        self.channel.send("ready", missing=missing, cancelled_all=cancelled_all)

    def connect(self, start: Message) -> bool:
        """Set `graph` and `servers`; whether an earlier worker died without leaving."""
        raise NotImplementedError

    def send(self, goal: Goal, fields: Message) -> None:
        """Send a goal, whose lock is held."""
        raise NotImplementedError

    def listen(
        self, topic: str, hear: Callable[[Message], object], *, is_needed: bool = True
    ) -> Callable[[], object] | None:
        """Call `hear` with each message of a topic as plain data; what ends that, if the topic is there.

        Where one `is_needed` that is not there, a SetupError says so.
        """
        raise NotImplementedError

    def publish(self, topic: str, fields: Message) -> None:
        """Publish the last message of a topic of `keepout`, also for those who come later."""
        raise NotImplementedError

    def start(self, goal: Goal, fields: Message) -> None:
        """Send a goal, unless it is cancelled."""
        with goal.lock:
            if goal.cancelled is not None:
                self.end(goal, "cancelled")
            else:
                self._sign.write_text(goal.server.name)
                self.send(goal, fields)

    def obey(self, line: Message) -> None:
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
        """Cancel what goes on, and leave the graph."""
        self.stop()
        self.graph.leave()

    def stop(self) -> None:
        """Cancel what goes on, while that can still be sent."""
        goal = self.goal
        if goal is not None and not goal.is_over:
            goal.cancel()
            goal.ended.wait(LAST_WORDS)
        if goal is not None and goal.cancelled is not None:
            time.sleep(TICK)  # ROS sends in threads of its own

    def missing(self) -> dict[str, str]:
        """Why servers cannot be reached, by skill."""
        self.wait_for_servers()
        return {
            skill: self.graph.why_missing(server.name, server.type)
            for skill, server in self.servers.items()
            if not server.is_connected(self.silence)
        }

    def wait_for_servers(self) -> None:
        """Wait for those that are on the graph."""
        until = time.monotonic() + self.patience
        awaited = [server for server in self.servers.values() if self.graph.nodes_of(server.name)]
        # Each is asked each time, since it settles from when it was first found connected.
        while sum(s.is_connected(self.silence) for s in awaited) < len(awaited) and time.monotonic() < until:
            if self.graph.is_left():
                break
            time.sleep(0.005)

    def cancel_all(self) -> bool:
        """Cancel all goals of all clients; whether that is possible."""
        for server in self.servers.values():
            server.cancel()
        time.sleep(TICK)  # ROS sends in threads of its own
        return True

    def look_after(self, goal: Goal, sent: float, now: float) -> None:
        """End a goal that is not worth waiting for any longer."""
        fault = self._fault(goal, sent, now)
        if fault is not None:
            self.end(goal, "lost", text=fault)

    def end(self, goal: Goal, what: str, **more: Any) -> None:
        """Report how a goal ended, once."""
        with goal.lock:
            if goal.is_over:
                return
            goal.is_over = True
        if what == "lost":
            goal.cancel()
        else:
            self._sign.unlink(missing_ok=True)
        self.channel.send(what, id=goal.number, **more)
        goal.ended.set()

    def pass_on(self, goal: Goal, feedback: dict[str, Any]) -> None:
        """Report the fields of a feedback that hold a text or a number, but not more often than is of use."""
        plain = {name: value for name, value in feedback.items() if not isinstance(value, (dict, list))}
        text = ", ".join(
            f"{name}: {value:.4g}" if isinstance(value, float) else f"{name}: {value}"
            for name, value in plain.items()
        )
        now = time.monotonic()
        if text and not goal.is_over and now - goal.told > TELLS_AGAIN:
            goal.told = now
            self.channel.send("feedback", id=goal.number, text=text)

    def finish(self, goal: Goal, state: str, values: Message, text: str = "") -> None:
        """End a goal as its server says: succeeded, aborted, rejected, cancelled or lost."""
        if state == "lost":
            self.end(goal, "lost", text=text)
        elif state == "cancelled" or goal.cancelled is not None:
            self.end(goal, "cancelled")
        elif state != "succeeded":
            self.end(goal, "error", state=state, text=text, values=values)
        elif goal.seen.is_set() or not goal.server.shows_pictures():
            self.end(goal, "result", values=values)
        else:
            threading.Thread(target=self._end_with_picture, args=(goal, values), daemon=True).start()

    def see(self, server: Any, data: str) -> None:
        """Pass on a picture, in base64, that a server shows while its goal goes on."""
        goal = self.goal
        if goal is None or goal.server is not server or goal.sent is None or goal.is_over:
            return
        size = len(data) * 3 // 4
        if size > LARGEST_PICTURE:
            text = f"a picture of {size:,} bytes was left out; the limit is {LARGEST_PICTURE:,} bytes"
            self.channel.send("feedback", id=goal.number, text=text)
        else:
            self.channel.send("picture", id=goal.number, data=data)
        goal.seen.set()

    def _end_with_picture(self, goal: Goal, values: Message) -> None:
        """End a goal when its picture has come, or has had its time."""
        goal.seen.wait(LAST_PICTURE)
        self.end(goal, "result", values=values)

    def _look(self, goal: Goal, topic: str) -> None:
        """Send the next picture of a topic, which is listened to only meanwhile, since pictures are large."""
        seen: list[Message] = []
        ignore, until = None, time.monotonic() + self.patience
        text = f"no picture has arrived on {topic}; is the camera's node running?"
        try:
            while not (seen or goal.is_over) and time.monotonic() < until:
                ignore = ignore or self.listen(topic, seen.append, is_needed=False)
                time.sleep(0.01)
        except SetupError as error:
            text = str(error)
        if ignore is not None:
            ignore()
        if seen:
            self.end(goal, "result", values=seen[0])
        else:
            self.end(goal, "error", state="aborted", text=text)

    def _listen(self, start: Message) -> None:
        """Listen to what tells where the robot is, and how fast it moves."""
        pose, velocity = start["pose"], start["velocity"]
        reports = MotionReports(self.channel, pose and pose["frames"])
        if pose is not None:
            self.listen(pose["topic"], reports.hear_pose)
            if pose["frames"]:
                self.listen(pose["topic"] + "_static", reports.hear_pose, is_needed=False)
        if velocity is not None:
            self.listen(velocity["topic"], reports.hear_velocity)

    def _wait_and_send(self, goal: Goal, fields: Message) -> None:
        until = time.monotonic() + self.patience + self.settles
        while time.monotonic() < until and not self.graph.is_left():
            if goal.cancelled is not None or goal.server.is_connected(self.silence):
                self.start(goal, fields)
                return
            time.sleep(0.005)
        why = self.graph.why_missing(goal.server.name, goal.server.type)
        self.end(goal, "unsent", text=why)

    def _watch(self) -> None:
        """Give signs of life, and look after the current goal."""
        last_sign = 0.0
        while True:
            time.sleep(TICK)
            now = time.monotonic()
            if now - last_sign >= ALIVE:
                self.channel.send("alive")
                last_sign = now
            if self.graph.is_left():
                self.channel.send("gone", text=self.graph.why_left())
                return
            goal = self.goal
            if goal is None or goal.is_over:
                continue
            if now - self.channel.heard > TOOL_SILENCE:
                why = f"CodeBotler gave no sign of life for {TOOL_SILENCE:g} s, so the robot was stopped"
                self.end(goal, "lost", text=why)
            elif goal.sent is not None:
                self.look_after(goal, goal.sent, now)

    def _fault(self, goal: Goal, sent: float, now: float) -> str | None:
        """Why a goal is not worth waiting for any longer."""
        server, late = goal.server.name, now - self.patience
        if max(goal.server.heard(), sent) < now - self.silence:
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
