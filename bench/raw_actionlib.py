"""Sends goals one by one with actionlib's own client, in the robot's Python, as a baseline of bench/ros1.py.

The arguments are the folder of the worker, whose messages the script uses, the definition of the action, and
the number of goals. The script prints the seconds of each goal as JSON.
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
    """Send a goal, wait until it has ended, and return the seconds."""
    done = threading.Event()

    def on_change(handle: Any) -> None:
        if handle.get_comm_state() == actionlib.CommState.DONE:
            done.set()

    start = time.perf_counter()
    handle = client.send_goal(goal("hello"), on_change)
    assert done.wait(30), handle
    return time.perf_counter() - start


took = [seconds() for _ in range(int(sys.argv[3]))]
rospy.signal_shutdown("the end")
print(json.dumps(took))
