"""Real action servers on ROS 2, where the text of a goal selects its result; they print events as JSON."""

import json
import os
import signal
import sys
import threading
import time
from typing import Any

sys.path.insert(0, sys.argv[1])

import rclpy
import rclpy.action
from action_msgs.srv import CancelGoal
from rclpy.action import CancelResponse, GoalResponse
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from ros2_types import fields_of, message_types

REFUSES = "never, whatever you say"
NEVER = ("never", REFUSES, "late", "slow", "by somebody else")
actions = json.loads(sys.argv[2])


def tell(*what: str) -> None:
    print(json.dumps(what), flush=True)


def resolve(end: Any) -> None:
    executor.create_task(lambda: (end.set_result(None), executor.create_task(lambda: None)))


class Server:
    def __init__(self, kind: str, name: str, definition: str) -> None:
        self.spec, self.fields = SPECS[kind], fields_of(definition)
        self.ends: dict[bytes, Any] = {}
        self.cancels = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        self.server = rclpy.action.ActionServer(
            node, self.spec, name, self.execute, goal_callback=self.accept, cancel_callback=self.cancel
        )

    def text_of(self, goal: Any) -> str:
        return str(getattr(goal, self.fields[0][0])) if self.fields[0] else ""

    def accept(self, goal: Any) -> GoalResponse:
        text = self.text_of(goal)
        if text == "ignore":
            tell("ignored")
            time.sleep(4)
        elif text == "slow":
            tell("taking")
            time.sleep(0.5)
        return GoalResponse.REJECT if text == "reject" else GoalResponse.ACCEPT

    async def execute(self, handle: Any) -> Any:
        text = self.text_of(handle.request)
        tell("goal", text)
        if text == "abort":
            handle.abort()
        elif text == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        elif text in NEVER:
            await self.end_of(handle, text)
        else:
            if text == "feedback":
                feedback = self.spec.Feedback()
                setattr(feedback, self.fields[2][0], "the hall")
                handle.publish_feedback(feedback)
            handle.succeed()
        return self.spec.Result()

    def end_for(self, handle: Any) -> Any:
        """Return the future of a goal, which may be cancelled before its execution."""
        return self.ends.setdefault(bytes(handle.goal_id.uuid), Future(executor=executor))

    async def end_of(self, handle: Any, text: str) -> None:
        end = self.end_for(handle)
        if text == "by somebody else":
            self.cancels.call_async(CancelGoal.Request())
        await end
        if text == "late":
            handle.succeed()
        else:
            handle.canceled()

    def cancel(self, handle: Any) -> CancelResponse:
        text = self.text_of(handle.request)
        tell("cancel", text)
        if text == REFUSES:
            return CancelResponse.REJECT
        end = self.end_for(handle)
        threading.Timer(0.3 if text == "late" else 0, resolve, [end]).start()
        return CancelResponse.ACCEPT


rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node(f"servers_{os.getpid()}")
TEXTS = {kind: text for kind, _, text in actions}
SPECS = message_types([*TEXTS], [], actions=TEXTS)
servers = [Server(*action) for action in actions]
executor = SingleThreadedExecutor()
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()
tell("ready")
sys.stdin.read()
node.destroy_node()
rclpy.shutdown()
os._exit(0)
