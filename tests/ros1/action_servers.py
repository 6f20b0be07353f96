"""Real action servers, where the text of a goal selects its result; they print events as JSON."""

import json
import os
import signal
import sys
import threading
import time
from typing import Any

sys.path.insert(0, sys.argv[1])

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from message_types import action_types

ABORTS = {
    "abort": "the door is shut",
    "abort, named": "DoorIsShut: you have no key",
    "abort without a word": "",
}
NEVER = ("never", "never, whatever you say", "late")


def tell(*what: str) -> None:
    print(json.dumps(what), flush=True)


SERVERS: dict[str, actionlib.ActionServer] = {}


def connect_late(seconds: float) -> None:
    """Connect subscribers of results some seconds after they get a status, like a busy machine."""
    at_once = rospy.topics._PublisherImpl.add_connection

    def late(publisher: Any, connection: Any) -> Any:
        name, _, topic = publisher.resolved_name.rpartition("/")
        if topic != "result":
            return at_once(publisher, connection)
        threading.Thread(target=note, args=(SERVERS[name], publisher, connection), daemon=True).start()
        return True

    def note(server: Any, publisher: Any, connection: Any) -> None:
        while not has_other_connections(server):
            time.sleep(0.001)
        server.publish_status()
        time.sleep(seconds)
        at_once(publisher, connection)

    rospy.topics._PublisherImpl.add_connection = late


def has_other_connections(server: Any) -> bool:
    """Return whether all topics of a goal except its result are connected."""
    ends = server.goal_sub, server.cancel_sub, server.status_pub, server.feedback_pub
    return all(end is not None and end.get_num_connections() for end in ends)


class Deaf(actionlib.ActionServer):  # type: ignore[misc]  # it has no types
    """Ignores goals while the environment has DEAF."""

    def internal_goal_callback(self, goal: Any) -> None:
        if os.environ.get("DEAF"):
            tell("ignored")
        else:
            super().internal_goal_callback(goal)


class Server:
    def __init__(self, name: str, spec: Any) -> None:
        self.server = Deaf(name, spec, self.start, self.cancel, auto_start=False)
        SERVERS[rospy.resolve_name(name)] = self.server
        self.server.start()
        self.goals: dict[str, Any] = {}

    def start(self, handle: Any) -> None:
        goal, result = handle.get_goal(), handle.get_default_result()
        text = getattr(goal, goal.__slots__[0]) if goal.__slots__ else ""
        self.goals[handle.get_goal_id().id] = handle, text
        tell("goal", text)
        if text == "reject":
            handle.set_rejected(result, "not in this gown")
            return
        handle.set_accepted()
        if text in ABORTS:
            handle.set_aborted(result, ABORTS[text])
        elif text == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        elif text == "by somebody else":
            handle.set_canceled(result)
        elif text == "no result":
            handle.status_tracker.status.status = GoalStatus.SUCCEEDED
            self.server.publish_status()
        elif text == "feedback":
            feedback = self.server.ActionFeedback().feedback
            setattr(feedback, feedback.__slots__[0], "the hall")
            handle.publish_feedback(feedback)
            threading.Timer(0.3, handle.set_succeeded, [result]).start()
        elif text not in NEVER:
            handle.set_succeeded(result)

    def cancel(self, handle: Any) -> None:
        handle, text = self.goals[handle.get_goal_id().id]
        tell("cancel", text)
        if text == "late":
            threading.Timer(0.3, handle.set_succeeded, [handle.get_default_result()]).start()
        elif text != "never, whatever you say":
            handle.set_canceled(handle.get_default_result(), "cancelled")


if "KNOWS_LATE" in os.environ:
    connect_late(float(os.environ["KNOWS_LATE"]))
rospy.init_node("servers", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
actions = json.loads(sys.argv[2])
specs = action_types([{"type": kind, "definition": text} for kind, _, text in actions])
servers = [Server(name, specs[kind]) for kind, name, _ in actions]
tell("ready")
sys.stdin.read()
rospy.signal_shutdown("the end")
time.sleep(0.05)
os._exit(0)
