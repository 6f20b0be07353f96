"""Messages of a rosbridge: topics for actions of ROS 1, operations for those of ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

from channel import Fields
from goals import ROS1_ENDS, ROS2_ENDS
from message_types import parts_of

NO_STAMP = {"secs": 0, "nsecs": 0}
RECALLED = 7
"""The status of a goal that was cancelled before it began."""


@dataclass(frozen=True)
class GoalUpdate:
    """An update of a goal; without a `goal`, a sign of life of the server."""

    goal: str
    what: str  # status (the server has accepted the goal), feedback or ended
    state: str = ""  # succeeded, aborted, rejected, cancelled or lost; a status may have it before the end
    text: str = ""
    values: Fields = field(default_factory=dict)
    server: str = ""  # of a status


class Ros1Protocol:
    """Actions of ROS 1, whose goals and results are topics."""

    has_status = True  # servers send a status all the time, so silence means death

    def opening(self, server: str, action: str) -> Iterator[Fields]:
        """Advertise goals and cancels, and subscribe to the rest."""
        kind = "/".join(parts_of(action)) + "Action"
        ours = {"goal": f"{kind}Goal", "cancel": "actionlib_msgs/GoalID"}
        theirs = {
            "result": f"{kind}Result",
            "feedback": f"{kind}Feedback",
            "status": "actionlib_msgs/GoalStatusArray",  # last, so that it implies the others
        }
        for name, of in ours.items():
            yield {"op": "advertise", "topic": f"{server}/{name}", "type": of}
        for name, of in theirs.items():
            yield {"op": "subscribe", "topic": f"{server}/{name}", "type": of}

    def goal(self, server: str, _action: str, goal: str, fields: Fields) -> Fields:
        """Publish a goal; sending it again is harmless, since a server accepts each id only once."""
        msg = {"goal_id": {"id": goal, "stamp": NO_STAMP}, "goal": fields}
        return {"op": "publish", "topic": f"{server}/goal", "msg": msg}

    def cancel(self, server: str, goal: str) -> Fields:
        """Publish the id of a goal; an empty one cancels all goals."""
        return {"op": "publish", "topic": f"{server}/cancel", "msg": {"id": goal, "stamp": NO_STAMP}}

    def updates(self, message: Fields) -> Iterator[GoalUpdate]:
        """Yield the updates in a published message."""
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
    """Actions of ROS 2, for which rosbridge has operations; tested only against a simulated rosbridge."""

    has_status = False

    def opening(self, _server: str, _action: str) -> Iterator[Fields]:
        """Send nothing."""
        yield from ()

    def goal(self, server: str, action: str, goal: str, fields: Fields) -> Fields:
        """Send a goal, and request feedback."""
        return {
            "op": "send_action_goal",
            "id": goal,
            "action": server,
            "action_type": "/action/".join(parts_of(action)),
            "args": fields,
            "feedback": True,
        }

    def cancel(self, server: str, goal: str) -> Fields:
        """Cancel a goal."""
        return {"op": "cancel_action_goal", "id": goal, "action": server}

    def updates(self, message: Fields) -> Iterator[GoalUpdate]:
        """Yield the updates in an answer."""
        match message:
            case {"op": "action_feedback", "id": str(goal), "values": dict(values)}:
                yield GoalUpdate(goal, "feedback", values=values)
            case {"op": "action_result", "id": str(goal), "status": int(status), "values": dict(values)}:
                yield GoalUpdate(goal, "ended", ROS2_ENDS.get(status, "lost"), values=values)
            case {"op": "action_result", "id": str(goal), "values": why}:  # it could not even be sent
                yield GoalUpdate(goal, "ended", "lost", text=str(why))


def service_updates(message: Fields) -> Iterator[GoalUpdate]:
    """Yield the updates in a service's answer."""
    match message:
        case {"op": "service_response", "id": str(goal), "result": True, **more}:  # values may be left out
            yield GoalUpdate(goal, "ended", "succeeded", values=more.get("values") or {})
        case {"op": "service_response", "id": str(goal), **more}:
            yield GoalUpdate(goal, "ended", "aborted", text=str(more.get("values", "")))


ActionProtocol: TypeAlias = Ros1Protocol | Ros2Protocol
