"""What bench/ros1.py compares with: goals sent one by one by actionlib's own client, in the robot's Python.

Prints the seconds of each as JSON. It is told the folder of the worker, whose messages it uses, the action's
definition and how many goals to send.
"""

import json
import sys
import threading
import time
from typing import Any

sys.path.insert(0, sys.argv[1])

import actionlib
import rospy

from message_types import action_types

rospy.init_node("raw", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
action = json.loads(sys.argv[2])
spec = action_types([action])[action["type"]]
client = actionlib.ActionClient(action["server"], spec)
client.wait_for_server()
goal = type(spec().action_goal.goal)


def seconds() -> float:
    """Send a goal, and wait for its end."""
    done = threading.Event()

    def changed(handle: Any) -> None:
        if handle.get_comm_state() == actionlib.CommState.DONE:
            done.set()

    start = time.perf_counter()
    handle = client.send_goal(goal("hello"), changed)
    assert done.wait(30), handle
    return time.perf_counter() - start


took = [seconds() for _ in range(int(sys.argv[3]))]
rospy.signal_shutdown("the end")
print(json.dumps(took))
