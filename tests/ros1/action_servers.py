"""Real action servers in which each goal says how it goes; what they hear is printed as JSON."""

import json
import os
import signal
import sys
import threading
import time

WORKER = os.path.join(os.path.dirname(__file__), "..", "..", "src", "codebotler", "robots")
sys.path.insert(0, os.environ.get("WORKER", WORKER))

import actionlib  # noqa: E402 - the path comes first
import rospy  # noqa: E402
from actionlib_msgs.msg import GoalStatus  # noqa: E402
from ros1_worker import message_types  # noqa: E402


def tell(*what):
    print(json.dumps(what), flush=True)


class Deaf(actionlib.ActionServer):
    """Takes no notice of goals while the environment says so."""

    def internal_goal_callback(self, goal):
        if os.environ.get("DEAF"):
            tell("ignored")
        else:
            super().internal_goal_callback(goal)


class Server:
    def __init__(self, name, spec):
        self.server = Deaf(name, spec, self.start, self.cancel, auto_start=False)
        self.server.start()
        self.goals = {}

    def start(self, handle):
        goal = handle.get_goal()
        text = getattr(goal, goal.__slots__[0]) if goal.__slots__ else ""
        self.goals[handle.get_goal_id().id] = handle, text
        tell("goal", text)
        result = handle.get_default_result()
        if text == "reject":
            handle.set_rejected(result, "not in this gown")
            return
        handle.set_accepted()
        if text == "abort":
            handle.set_aborted(result, "the door is shut")
        elif text == "abort, named":
            handle.set_aborted(result, "DoorIsShut: you have no key")
        elif text == "abort without a word":
            handle.set_aborted(result)
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
        elif text not in {"never", "never, whatever you say", "late"}:
            if result.__slots__:
                result.result = ["not a truth"] if isinstance(result.result, list) else result.result
            handle.set_succeeded(result)

    def cancel(self, handle):
        handle, text = self.goals[handle.get_goal_id().id]
        tell("cancel", text)
        if text == "late":
            threading.Timer(0.3, handle.set_succeeded, [handle.get_default_result()]).start()
        elif text != "never, whatever you say":
            handle.set_canceled(handle.get_default_result(), "cancelled")


rospy.init_node("servers", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
actions = json.loads(sys.argv[1])
specs = message_types([{"type": kind, "definition": text} for kind, _, text in actions])
servers = [Server(name, specs[kind]) for kind, name, _ in actions]
tell("ready")
sys.stdin.read()
rospy.signal_shutdown("the end")
time.sleep(0.05)
os._exit(0)
