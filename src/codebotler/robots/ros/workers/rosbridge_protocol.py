"""The rosbridge messages for goals: ROS 1 actions use topics, and ROS 2 actions have their own operations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

from channel import Fields
from goals import ROS1_ENDS, ROS2_ENDS
from message_types import parts_of

NO_STAMP = {"secs": 0, "nsecs": 0}
RECALLED = 7
"""The status of a goal that was cancelled before it started."""


@dataclass(frozen=True)
class GoalUpdate:
    """News about a goal, or, if `goal` is empty, a status message that only shows that a server is alive."""

    goal: str  # the goal id, or an empty string
    what: str  # status (which implies that the server has accepted the goal), feedback or ended
    state: str = ""  # the final state (succeeded, aborted, rejected, cancelled or lost) if it is known
    text: str = ""  # the server's explanation of the state
    values: Fields = field(default_factory=dict)  # the fields of the feedback or the result
    server: str = ""  # the server that sent a status


class Ros1Protocol:
    """ROS 1 actions, whose goals, results and statuses are messages on topics."""

    has_status = True  # servers send their status regularly, so a silent server is dead

    def opening(self, server: str, action: str) -> Iterator[Fields]:
        """Yield messages that advertise goals and cancels, and subscribe to the server's other topics."""
        kind = "/".join(parts_of(action)) + "Action"
        ours = {"goal": f"{kind}Goal", "cancel": "actionlib_msgs/GoalID"}
        theirs = {
            "result": f"{kind}Result",
            "feedback": f"{kind}Feedback",
            "status": "actionlib_msgs/GoalStatusArray",  # last, because it shows that the others are set up
        }
        for name, of in ours.items():
            yield {"op": "advertise", "topic": f"{server}/{name}", "type": of}
        for name, of in theirs.items():
            yield {"op": "subscribe", "topic": f"{server}/{name}", "type": of}

    def goal(self, server: str, _action: str, goal: str, fields: Fields) -> Fields:
        """Return the message for a goal, which may be sent again because servers accept an id only once."""
        msg = {"goal_id": {"id": goal, "stamp": NO_STAMP}, "goal": fields}
        return {"op": "publish", "topic": f"{server}/goal", "msg": msg}

    def cancel(self, server: str, goal: str) -> Fields:
        """Return the message that cancels a goal, or all goals if the id is empty."""
        return {"op": "publish", "topic": f"{server}/cancel", "msg": {"id": goal, "stamp": NO_STAMP}}

    def updates(self, message: Fields) -> Iterator[GoalUpdate]:
        """Yield the goal updates in a received message."""
        match message:
            case {"op": "publish", "topic": str(topic), "msg": {"status_list": list(statuses)}}:
                server = topic.rpartition("/")[0]
                yield GoalUpdate("", "status", server=server)
                for status in statuses:
                    goal, now = status["goal_id"]["id"], status["status"]
                    if now == RECALLED:
                        yield GoalUpdate(goal, "ended", "cancelled", server=server)
                    else:
                        yield GoalUpdate(goal, "status", ROS1_ENDS.get(now, ""), server=server)
            case {"op": "publish", "msg": {"status": status, "result": dict(values)}}:
                state = ROS1_ENDS.get(status["status"], "lost")
                yield GoalUpdate(status["goal_id"]["id"], "ended", state, status["text"], values)
            case {"op": "publish", "msg": {"status": status, "feedback": dict(values)}}:
                yield GoalUpdate(status["goal_id"]["id"], "feedback", values=values)


class Ros2Protocol:
    """ROS 2 actions, which rosbridge supports directly. This is tested only against a simulated rosbridge."""

    has_status = False

    def opening(self, _server: str, _action: str) -> Iterator[Fields]:
        """Yield nothing, because ROS 2 actions need no preparation."""
        yield from ()

    def goal(self, server: str, action: str, goal: str, fields: Fields) -> Fields:
        """Return the message for a goal, with a request for feedback."""
        return {
            "op": "send_action_goal",
            "id": goal,
            "action": server,
            "action_type": "/action/".join(parts_of(action)),
            "args": fields,
            "feedback": True,
        }

    def cancel(self, server: str, goal: str) -> Fields:
        """Return the message that cancels a goal."""
        return {"op": "cancel_action_goal", "id": goal, "action": server}

    def updates(self, message: Fields) -> Iterator[GoalUpdate]:
        """Yield the goal updates in a received message."""
        match message:
            case {"op": "action_feedback", "id": str(goal), "values": dict(values)}:
                yield GoalUpdate(goal, "feedback", values=values)
            case {"op": "action_result", "id": str(goal), "status": int(status), "values": dict(values)}:
                yield GoalUpdate(goal, "ended", ROS2_ENDS.get(status, "lost"), values=values)
            case {"op": "action_result", "id": str(goal), "values": why}:  # rosbridge could not send the goal
                yield GoalUpdate(goal, "ended", "lost", text=str(why))


def service_updates(message: Fields) -> Iterator[GoalUpdate]:
    """Yield the end of a service call if a received message is its answer."""
    match message:
        case {"op": "service_response", "id": str(goal), "result": True, **more}:  # `values` is optional
            yield GoalUpdate(goal, "ended", "succeeded", values=more.get("values") or {})
        case {"op": "service_response", "id": str(goal), **more}:
            yield GoalUpdate(goal, "ended", "aborted", text=str(more.get("values", "")))


ActionProtocol: TypeAlias = Ros1Protocol | Ros2Protocol
