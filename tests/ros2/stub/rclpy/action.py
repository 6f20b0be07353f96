import os
import threading
from types import SimpleNamespace
from typing import Any

from rclpy import Future, note


class Feedback:
    near = "the hall"

    def get_fields_and_field_types(self) -> dict[str, str]:
        return {"near": "string"}


class Handle:
    def __init__(self, spec: Any, text: str) -> None:
        self.spec, self.text, self.accepted = spec, text, text != "reject"
        self._result = Future()

    def get_result_async(self) -> Future:
        if self.text == "abort":
            self.end(6)
        elif self.text == "by somebody else":
            self.end(5)
        elif self.text not in {"never", "never, whatever you say", "die"}:
            self.end(4)
        return self._result

    def cancel_goal_async(self) -> Future:
        note("cancel", self.text)
        if self.text != "never, whatever you say":
            self.end(5)
        return Future()

    def end(self, status: int) -> None:
        self._result.set_result(SimpleNamespace(status=status, result=self.spec.Result()))


class ActionClient:
    def __init__(self, _node: Any, spec: Any, name: str) -> None:
        self.spec, self.name, self.is_dead = spec, name, False

    def server_is_ready(self) -> bool:
        return not self.is_dead and self.name not in os.environ.get("LACKS", "").split()

    def send_goal_async(self, goal: Any, feedback_callback: Any = None) -> Future:
        text = str(next(iter(vars(goal).values()), ""))
        note("goal", *(str(value) for value in vars(goal).values()))
        if text == "feedback":
            feedback_callback(SimpleNamespace(feedback=Feedback()))
        self.is_dead = text == "die"
        sent = Future()
        if text == "slow":
            threading.Timer(0.5, sent.set_result, [Handle(self.spec, "never")]).start()
        elif text != "ignore":
            sent.set_result(Handle(self.spec, text))
        return sent
