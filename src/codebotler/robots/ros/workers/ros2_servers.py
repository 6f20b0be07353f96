"""Action servers of a virtual robot on ROS 2, run by a Python that has rclpy. CodeBotler performs goals."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from channel import Channel, Fields, serve
from message_types import as_data
from ros2_graph import Ros2Graph
from ros2_types import fill, message_types

SERVERS_IN_USE = "there is another virtual robot (the node {}); stop it first"


class Ros2ActionServers:
    """Offers an action server per skill. The first message has the `node` name and `actions` by skill."""

    def __init__(self, channel: Channel, start: Fields) -> None:
        import rclpy.action

        self.channel = channel
        self.ends: dict[str, Any] = {}  # futures for the ends of goals, by goal id
        actions = start["actions"]
        texts = {action["type"]: action["definition"] for action in actions.values()}
        specs = message_types([*texts], [], lambda text: channel.send("progress", text=text), actions=texts)
        self.graph = Ros2Graph(start["node"], SERVERS_IN_USE)
        self.graph.enter()
        self.servers = [
            rclpy.action.ActionServer(
                self.graph.ours,
                specs[action["type"]],
                action["server"],
                self._make_callback(skill, specs[action["type"]]),
                cancel_callback=self._cancel,
            )
            for skill, action in actions.items()
        ]
        self.graph.spin()
        channel.send("ready", has_master=False)

    def obey(self, line: Fields) -> None:
        """End a goal as succeeded, aborted or cancelled, as a message from CodeBotler says."""
        self.graph.resolve(self.ends.pop(line["id"]), line)

    def leave(self) -> None:
        """Leave the ROS graph."""
        self.graph.leave()

    def _make_callback(self, skill: str, spec: Any) -> Callable[[Any], Awaitable[Any]]:
        async def execute(handle: Any) -> Any:
            from rclpy.task import Future

            number = _number_of(handle)
            self.ends[number] = end = Future(executor=self.graph.executor)
            arguments = [*as_data(handle.request).values()]
            self.channel.send("goal", id=number, skill=skill, arguments=arguments)
            line = await end
            result = spec.Result()
            if line["do"] == "succeed":
                fill(result, dict.fromkeys(result.get_fields_and_field_types(), line["value"]))
                handle.succeed()
            elif line["do"] == "abort":
                handle.abort()
            else:
                handle.canceled()
            return result

        return execute

    def _cancel(self, handle: Any) -> Any:
        from rclpy.action import CancelResponse

        self.channel.send("cancel", id=_number_of(handle))
        return CancelResponse.ACCEPT


def _number_of(handle: Any) -> str:
    return bytes(handle.goal_id.uuid).hex()


if __name__ == "__main__":
    serve(Ros2ActionServers)
