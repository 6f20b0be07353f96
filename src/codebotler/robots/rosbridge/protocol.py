"""What is said to a rosbridge and heard from it: for ROS 1 by topics, for ROS 2 by operations of its own.

Nothing here sends or waits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

from codebotler.core.skills import RosAction
from codebotler.robots.base import Argument

Message: TypeAlias = dict[str, Any]

PACKAGE = "robot_actions_pkg"
AT_ONCE = {"secs": 0, "nsecs": 0}

ENDS_1 = {2: "cancelled", 3: "succeeded", 4: "aborted", 5: "rejected", 8: "cancelled", 9: "lost"}
"""How a goal has ended, by the status of actionlib_msgs/GoalStatus."""

RECALLING = 7
"""The status of a goal that was cancelled before it began, perhaps even before the server heard of it."""

ENDS_2 = {4: "succeeded", 5: "cancelled", 6: "aborted"}
"""How a goal has ended, by the status of action_msgs/msg/GoalStatus."""


@dataclass(frozen=True)
class News:
    """What was heard of a goal.

    Args:
        goal: its id; empty if this is about the server as a whole.
        what: `status` (the server is alive, and has taken the goal if there is an id), `feedback` or `ended`.
        state: how it ended: succeeded, aborted, rejected, cancelled or lost; a status may tell that before.
        text: the server's words.
        values: the fields of the result.
        server: whose news it is, where that is told.
    """

    goal: str
    what: str
    state: str = ""
    text: str = ""
    values: Message = field(default_factory=dict)
    server: str = ""


class Dialect(Protocol):
    """How actions are spoken of."""

    is_heard: bool
    """Whether servers are heard while nothing goes on, so that their silence means something."""

    def opening(self, action: RosAction) -> Iterator[Message]:
        """What is said of an action before its first goal."""

    def goal(self, action: RosAction, goal: str, arguments: Sequence[Argument]) -> Message:
        """Send a goal; said again, it is the same goal."""

    def cancel(self, action: RosAction, goal: str) -> Message:
        """Cancel a goal."""

    def news(self, message: Message) -> Iterator[News]:
        """What a message tells of goals."""


class Topics:
    """Actions of ROS 1, whose goals and results are topics."""

    is_heard = True

    def opening(self, action: RosAction) -> Iterator[Message]:
        """Advertise what is published, and subscribe to what is heard."""
        kind = f"{PACKAGE}/{action.type}Action"
        ours = {"goal": f"{kind}Goal", "cancel": "actionlib_msgs/GoalID"}
        theirs = {
            "result": f"{kind}Result",
            "feedback": f"{kind}Feedback",
            "status": "actionlib_msgs/GoalStatusArray",  # the last, since who hears it hears the others
        }
        for name, of in ours.items():
            yield {"op": "advertise", "topic": f"{action.server}/{name}", "type": of}
        for name, of in theirs.items():
            yield {"op": "subscribe", "topic": f"{action.server}/{name}", "type": of}

    def goal(self, action: RosAction, goal: str, arguments: Sequence[Argument]) -> Message:
        """Publish a goal; the server takes one id only once."""
        msg = {"goal_id": {"id": goal, "stamp": AT_ONCE}, "goal": fields(action, arguments)}
        return {"op": "publish", "topic": f"{action.server}/goal", "msg": msg}

    def cancel(self, action: RosAction, goal: str) -> Message:
        """Publish the id of a goal that is to be cancelled."""
        msg = {"id": goal, "stamp": AT_ONCE}
        return {"op": "publish", "topic": f"{action.server}/cancel", "msg": msg}

    def news(self, message: Message) -> Iterator[News]:
        """What was published."""
        match message:
            case {"op": "publish", "topic": str(topic), "msg": {"status_list": list(statuses)}}:
                server = topic.rpartition("/")[0]
                yield News("", "status", server=server)
                for status in statuses:
                    goal, now = status["goal_id"]["id"], status["status"]
                    is_over = now == RECALLING
                    state = "cancelled" if is_over else ENDS_1.get(now, "")
                    yield News(goal, "ended" if is_over else "status", state, server=server)
            case {"op": "publish", "msg": {"status": status, "result": dict(values)}}:
                state = ENDS_1.get(status["status"], "lost")
                yield News(status["goal_id"]["id"], "ended", state, status["text"], values)
            case {"op": "publish", "msg": {"status": status, "feedback": dict(values)}}:
                yield News(status["goal_id"]["id"], "feedback", text=in_words(values))


class Operations:
    """Actions of ROS 2, for which rosbridge has operations of their own.

    It could be tested against a stand-in for the protocol only, never against a rosbridge of ROS 2.
    """

    is_heard = False

    def opening(self, _action: RosAction) -> Iterator[Message]:
        """Nothing."""
        yield from ()

    def goal(self, action: RosAction, goal: str, arguments: Sequence[Argument]) -> Message:
        """Send a goal, and ask for feedback."""
        return {
            "op": "send_action_goal",
            "id": goal,
            "action": action.server,
            "action_type": f"{PACKAGE}/action/{action.type}",
            "args": fields(action, arguments),
            "feedback": True,
        }

    def cancel(self, action: RosAction, goal: str) -> Message:
        """Cancel a goal."""
        return {"op": "cancel_action_goal", "id": goal, "action": action.server}

    def news(self, message: Message) -> Iterator[News]:
        """What an action answered."""
        match message:
            case {"op": "action_feedback", "id": str(goal), "values": dict(values)}:
                yield News(goal, "feedback", text=in_words(values))
            case {"op": "action_result", "id": str(goal), "status": int(status), "values": dict(values)}:
                yield News(goal, "ended", ENDS_2.get(status, "lost"), values=values)
            case {"op": "action_result", "id": str(goal), "values": why}:  # it could not even be sent
                yield News(goal, "ended", "lost", text=str(why))


def fields(action: RosAction, arguments: Sequence[Argument]) -> Message:
    """The fields of a goal, by name."""
    names = [line.split()[1] for line in action.goal]
    values = [a if isinstance(a, str) else list(a) for a in arguments]
    return dict(zip(names, values, strict=True))


def in_words(values: Message) -> str:
    """The fields of a feedback."""
    return ", ".join(f"{name}: {value}" for name, value in values.items())
