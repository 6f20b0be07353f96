"""Skills performed as actionlib goals."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable
from typing import Any

from channel import Channel, Message, NotReadyError
from graph import TICK, Graph, taken_over
from message_types import BUFFER, COMPRESSED, PACKAGE, in_text, message_types, picture_types

ALIVE = 1.0  # seconds between two signs of life
SETTLES = 0.2  # seconds until a server sends results to who has just connected: ROS tells neither side
LAST_PICTURE = 0.5  # seconds for a picture to come after the result, by a connection of its own
LARGEST_PICTURE = 2_000_000  # bytes
LAST_WORDS = 1.0  # seconds for a cancelled goal to end when the worker does


class Server:
    """What the worker knows of the action server of one skill.

    Args:
        action: the skill's row: its `server` and `type`.
        spec: the type of the action's messages.
        see: told each picture that the server shows.
    """

    def __init__(self, action: Message, spec: Any, see: Callable[[Any, Any], None]) -> None:
        import actionlib
        import actionlib_msgs.msg
        import rospy

        self.name: str = action["server"]
        self.type: str = action["type"]
        self.client = actionlib.ActionClient(self.name, spec)
        self.goal = type(spec().action_goal.goal)
        self.heard = 0.0  # when its last status came, on a clock that nobody sets
        self._node: str | None = None
        self._results: Any = None  # the connection by which they come
        self._since = 0.0
        topic = rospy.remap_name(self.name) + "/status"
        self._status = rospy.Subscriber(topic, actionlib_msgs.msg.GoalStatusArray, self._hear)
        self._pictures = rospy.Subscriber(
            rospy.remap_name(self.name) + "/picture",
            picture_types()[COMPRESSED],
            lambda message: see(self, message.data),
            buff_size=BUFFER,
        )

    def _hear(self, status: Any) -> None:
        self.heard = time.monotonic()
        self._node = status._connection_header["callerid"]

    def shows_pictures(self) -> bool:
        """Whether somebody publishes what it sees."""
        return bool(self._pictures.get_num_connections())

    def silent_for(self) -> float:
        """Seconds since its last status."""
        return time.monotonic() - self.heard

    def is_connected(self, silence: float) -> bool:
        """Whether goals reach it and its results reach us."""
        client, node = self.client, self._node
        if node is None or self.silent_for() > silence:
            return False
        results, feedback = (
            next((c for c in subscriber.impl.connections if c.callerid_pub == node), None)
            for subscriber in (client.result_sub, client.feedback_sub)
        )
        if results is not self._results:
            self._results, self._since = results, time.monotonic()
        reached = all(p.impl.has_connection(node) for p in (client.pub_goal, client.pub_cancel))
        return reached and None not in (results, feedback) and time.monotonic() - self._since > SETTLES

    def cancel(self, goal_id: str = "") -> None:
        """Cancel one goal; without a name, all of anybody.

        The handle's own way of cancelling takes a goal that the server has not yet heard of for a lost one.
        """
        import actionlib_msgs.msg

        self.client.pub_cancel.publish(actionlib_msgs.msg.GoalID(id=goal_id))


class Goal:
    """What goes on.

    Args:
        number: by which the other side knows it.
        server: who executes it.
    """

    def __init__(self, number: int, server: Server) -> None:
        self.number, self.server = number, server
        self.lock = threading.RLock()
        self.stop: Callable[[], None] | None = None
        self.handle: Any = None  # actionlib forgets a goal of which nobody keeps this
        self.sent: float | None = None
        self.is_acknowledged = self.is_over = False
        self.ends: float | None = None  # since when only its result is waited for
        self.cancelled: float | None = None
        self.ended, self.seen = threading.Event(), threading.Event()

    def cancel(self) -> None:
        """Cancel it; if it has not been sent yet, it never will be."""
        with self.lock:
            self.cancelled = self.cancelled or time.monotonic()
            if self.stop is not None:
                self.stop()


class Ros1Worker:
    """Executes skills, one at a time.

    Args:
        channel: to whoever commands.
        start: the first line: the `node`, the `actions` by skill, and the seconds that are waited.
    """

    def __init__(self, channel: Channel, start: Message) -> None:
        self.channel = channel
        self.patience: float = start["patience"]
        self.silence: float = start["silence"]
        self.longest: float = start["longest"]
        self.goal: Goal | None = None
        self.graph, left_behind = self._entered(start["node"])
        self.servers: dict[str, Any] = self._servers(start["actions"])
        missing = self._missing()
        if missing and self.graph.is_taken():
            raise NotReadyError(taken_over(self.graph.node))
        if left_behind or start["cancel_all"]:
            self._cancel_all()
        threading.Thread(target=self._watch, daemon=True).start()
        self.channel.tell("ready", missing=missing, cancelled_all=left_behind or start["cancel_all"])

    def obey(self, line: Message) -> None:
        """Do what a line says."""
        if line["do"] == "perform":
            self._perform(line)
        elif line["do"] == "cancel":
            if self.goal is not None:
                self.goal.cancel()
            self.channel.tell("cancel-sent")

    def leave(self) -> None:
        """Cancel what goes on, and leave the graph."""
        self._stop()
        self.graph.leave()

    def _entered(self, node: str) -> Any:
        """The graph, and whether an earlier worker died there without leaving."""
        import rospy

        graph = Graph(node)
        left_behind = graph.enter()
        rospy.on_shutdown(self._stop)
        return graph, left_behind

    def _stop(self) -> None:
        """Cancel what goes on, while that can still be sent."""
        goal = self.goal
        if goal is not None and not goal.is_over:
            goal.cancel()
            goal.ended.wait(LAST_WORDS)
        if goal is not None and goal.cancelled is not None:
            time.sleep(TICK)  # ROS sends in threads of its own

    def _servers(self, actions: Message) -> dict[str, Any]:
        specs = message_types(list(actions.values()))
        return {skill: Server(action, specs[action["type"]], self._see) for skill, action in actions.items()}

    def _missing(self) -> dict[str, str]:
        """Wait a while for the servers on the graph; those that are not there, with the reason, by skill."""
        until = time.monotonic() + self.patience
        awaited = [server for server in self.servers.values() if self.graph.nodes_of(server.name)]
        # Each is asked each time, since it settles from when it was first found connected.
        while sum(s.is_connected(self.silence) for s in awaited) < len(awaited) and time.monotonic() < until:
            if self.graph.is_left():
                break
            time.sleep(0.005)
        return {
            skill: self.graph.why_missing(server.name, server.type)
            for skill, server in self.servers.items()
            if not server.is_connected(self.silence)
        }

    def _cancel_all(self) -> None:
        for server in self.servers.values():
            server.cancel()
        time.sleep(TICK)  # ROS sends in threads of its own

    def _perform(self, line: Message) -> None:
        server = self.servers[line["skill"]]
        self.goal = goal = Goal(line["id"], server)
        if server.is_connected(self.silence):
            self._send(goal, line["arguments"])
        else:
            threading.Thread(target=self._wait_and_send, args=(goal, line["arguments"]), daemon=True).start()

    def _wait_and_send(self, goal: Goal, arguments: list[Any]) -> None:
        until = time.monotonic() + self.patience
        while time.monotonic() < until and goal.cancelled is None and not self.graph.is_left():
            if goal.server.is_connected(self.silence):
                self._send(goal, arguments)
                return
            time.sleep(0.005)
        if goal.cancelled is not None:
            self._end(goal, "cancelled")
            return
        why = self.graph.why_missing(goal.server.name, goal.server.type)
        self._end(goal, "unsent", text=why, anew=self.graph.is_forgotten())

    def _send(self, goal: Goal, arguments: list[Any]) -> None:
        import genpy

        fields = goal.server.goal.__slots__
        if len(fields) != len(arguments):
            text = (
                f"the installed {PACKAGE}/{goal.server.type}Action has {len(fields)} goal fields "
                f"({', '.join(fields)}), but the skill has {len(arguments)} arguments"
            )
            self._end(goal, "unsent", text=text)
            return
        message = goal.server.goal(*arguments)
        try:  # what fails within rospy leaves half a message on the line, and spoils the next one
            message.serialize(io.BytesIO())
        except (genpy.SerializationError, ValueError) as error:
            self._end(goal, "unsent", text=f"the goal of {goal.server.name} cannot be sent: {error}")
            return
        with goal.lock:
            if goal.cancelled is not None:
                self._end(goal, "cancelled")
                return
            goal.sent = time.monotonic()
            goal.handle = goal.server.client.send_goal(
                message,
                lambda handle: self._changed(goal, handle),
                lambda _, feedback: self._feedback(goal, feedback),
            )
            goal_id = goal.handle.comm_state_machine.action_goal.goal_id.id
            goal.stop = lambda: goal.server.cancel(goal_id)

    def _changed(self, goal: Goal, handle: Any) -> None:
        """Hear of a step of the goal's life, in one of rospy's threads."""
        from actionlib import CommState, TerminalState

        state = handle.get_comm_state()
        goal.is_acknowledged = True
        if state == CommState.WAITING_FOR_RESULT and goal.ends is None:
            goal.ends = time.monotonic()
        if state != CommState.DONE:
            return
        terminal, text = handle.get_terminal_state(), handle.get_goal_status_text()
        if goal.cancelled is not None and terminal != TerminalState.LOST:
            self._end(goal, "cancelled", state=TerminalState.to_string(terminal))
        elif terminal == TerminalState.SUCCEEDED:
            self._end_seen(goal, value_of(handle.get_result()))
        elif terminal in (TerminalState.ABORTED, TerminalState.REJECTED):
            state_name = "rejected" if terminal == TerminalState.REJECTED else "aborted"
            self._end(goal, "error", state=state_name, text=text)
        elif terminal == TerminalState.LOST:
            self._end(goal, "lost", text=f"{goal.server.name} has forgotten its goal; was it started anew?")
        else:
            self._end(goal, "cancelled", state="by somebody else")

    def _feedback(self, goal: Goal, feedback: Any) -> None:
        fields = ", ".join(f"{name}: {getattr(feedback, name)}" for name in feedback.__slots__)
        if fields and not goal.is_over:
            self.channel.tell("feedback", id=goal.number, text=fields)

    def _see(self, server: Server, data: Any) -> None:
        """Pass on a picture that a server shows while its goal goes on."""
        goal = self.goal
        if goal is None or goal.server is not server or goal.sent is None or goal.is_over:
            return
        if len(data) > LARGEST_PICTURE:
            text = f"a picture was left out, for it has {len(data):,} bytes, not {LARGEST_PICTURE:,} or less"
            self.channel.tell("feedback", id=goal.number, text=text)
        else:
            self.channel.tell("picture", id=goal.number, data=in_text(data))
        goal.seen.set()

    def _end_seen(self, goal: Goal, value: Any) -> None:
        """End a goal that succeeded, with the picture of it, which may come a moment after its result."""
        if goal.seen.is_set() or not goal.server.shows_pictures():
            self._end(goal, "result", value=value)
            return

        def wait() -> None:
            goal.seen.wait(LAST_PICTURE)
            self._end(goal, "result", value=value)

        threading.Thread(target=wait, daemon=True).start()

    def _end(self, goal: Goal, what: str, **more: Any) -> None:
        with goal.lock:
            if goal.is_over:
                return
            goal.is_over = True
        if what == "lost":
            goal.cancel()
        self.channel.tell(what, id=goal.number, **more)
        goal.ended.set()

    def _watch(self) -> None:
        """Look after the goal that goes on, by a clock that neither ROS nor anybody else sets."""
        told = 0.0
        while True:
            time.sleep(TICK)
            now = time.monotonic()
            if now - told >= ALIVE:
                self.channel.tell("alive")
                told = now
            if self.graph.is_left():
                self.channel.tell("gone", text=taken_over(self.graph.node))
                return
            goal = self.goal
            if goal is not None and not goal.is_over:
                why = self._fault(goal, now)
                if why is not None:
                    self._end(goal, "lost", text=why)

    def _fault(self, goal: Goal, now: float) -> str | None:
        """Why a goal is not to be waited for any longer."""
        server, late = goal.server.name, now - self.patience
        if goal.sent is None:
            return None
        if max(goal.server.heard, goal.sent) < now - self.silence:
            return f"the action server at {server} has died: no status for {self.silence:g} s"
        faults = (
            (
                goal.cancelled is not None and goal.cancelled < late,
                f"was told to stop, and did not say within {self.patience:g} s that it has",
            ),
            (
                not goal.is_acknowledged and goal.sent < late,
                f"did not take the goal within {self.patience:g} s",
            ),
            (
                goal.ends is not None and goal.ends < late,
                f"ended the goal, but sent no result within {self.patience:g} s",
            ),
            (
                goal.sent < now - self.longest,
                f"did not end within {self.longest:g} s; the goal was cancelled",
            ),
        )
        return next((f"{server} {fault}" for is_so, fault in faults if is_so), None)


def value_of(result: Any) -> Any:
    """What a skill returns: the only field of the result."""
    fields = result.__slots__
    return getattr(result, fields[0]) if fields else None
