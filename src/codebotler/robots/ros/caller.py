"""Call skills on ROS through a worker process that talks to ROS."""

from __future__ import annotations

import base64
import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from codebotler.core.errors import RobotError
from codebotler.robots.base import (
    STOP_BY_HAND,
    CameraPicture,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    RobotLostError,
)
from codebotler.robots.clock import Clock
from codebotler.robots.reservation import robot_file
from codebotler.robots.ros.connections.connection import Connection, SkillCall, Values, default_connection
from codebotler.robots.ros.worker import RosWorker, WorkerMessage

NOT_CANCELLED = f"the robot's goals could not be cancelled: {STOP_BY_HAND}"
CANCEL_SECONDS = 1.0  # the time limit for the worker to send a cancel
NAMED_ERROR = re.compile(r"([A-Z][A-Za-z]+): (.+)", re.DOTALL)


@dataclass(frozen=True)
class Timeouts:
    """Time limits for a robot's servers and skills, in real seconds above 0."""

    patience: float = 5.0  # the limit for a server to appear, accept a goal, confirm a stop, or send a result
    silence: float = 3.0  # the time without a status message after which a server counts as dead
    longest: float = 600.0  # the limit for a whole skill


class RosCaller:
    """Performs skills through ROS actions, services and topics, by default an action for each skill.

    Args:
        name: the kind of robot, such as ros2.
        address: the robot's address, such as the URI of a ROS master.
        script: the worker's script, as the name of a file in `workers/` or a path.
        options: the options for opening the robot. With a virtual robot, the speed must equal its speed.
        environment: additional environment variables for the worker.
        waits: the time limits.
        node: the name of the worker's node, which must be unique on the ROS graph.
    """

    if_tool_dies = "the worker then cancels the robot's goal, unless the worker was killed as well"
    rooms_are_regexes = False

    def __init__(
        self,
        name: str,
        address: str,
        script: str,
        options: Options,
        environment: Mapping[str, str],
        *,
        waits: Timeouts | None = None,
        node: str = "codebotler",
    ) -> None:
        self.connection = options.connection or default_connection(options.skills)
        self.name, self.address = name, address
        self.skills = options.skills if options.connection is None else self.connection.skills(options.skills)
        self.clock = Clock(options.speed)
        self.missing: Mapping[str, str] = {}
        self._script, self._python, self._environment = script, options.ros_python, environment
        self._node = node
        self._waits = waits or Timeouts()
        self._worker: RosWorker | None = None
        self._in_doubt = False  # whether a goal may still be running without a worker that watches it
        self._stopped, self._number = True, 0
        self._send_lock = threading.Lock()  # ensures that no request is sent after a stop
        self._rescue_lock = threading.RLock()

    def connect(self) -> None:
        """Start a worker, wait for the servers, and set the clock to 0. The robot must not be connected yet.

        Raises:
            NotReadyError: ROS, the master or all servers are missing, or another process uses the robot.
        """
        worker = self._start(cancel_all=self._in_doubt)
        self.missing = worker.about["missing"]
        if self.missing and self.missing.keys() == self.connection.calls.keys():
            worker.leave()
            raise NotReadyError(f"the robot offers no skills: {next(iter(self.missing.values()))}")
        self._in_doubt = self._in_doubt and not worker.about["cancelled_all"]
        self._worker, self._stopped = worker, False
        self.clock.restart()

    def _request(self, call: SkillCall, request: WorkerMessage, feedback: Feedback) -> Values:
        """Send a request to the worker and return the robot's answer, or raise an error as `perform` does.

        The robot's reason for a failure may start with a kind of error, as in `PickInvalidObject: no mug`.
        """
        message = self._await_end(request, feedback)
        match message:
            case {"is": "result", "values": dict(values)}:
                return values
            case {"is": "error", "text": str(text), "state": str(state)}:
                why = text or call.why(message.get("values", {}))
                named = NAMED_ERROR.fullmatch(why)
                kind, why = (named[1], named[2]) if named else (call.failure, why)
                raise RobotError(kind, why or f"{call.name} {state} the goal without a reason")
            case {"is": "cancelled"}:
                raise CancelledError
        self._in_doubt = self._in_doubt or message["is"] == "lost"
        raise RobotLostError(message["text"])

    def _await_end(self, request: WorkerMessage, feedback: Feedback) -> WorkerMessage:
        """Send a request, pass on feedback, and return the worker's final message for the request."""
        worker, number = self._send(request)
        at = ""
        while True:
            match worker.receive(self._waits.patience * 2):
                case None:
                    raise RobotLostError(f"the {self.name} worker does not answer; {self._rescue(worker)}")
                case {"is": "ended"}:
                    how = worker.describe_end()
                    raise RobotLostError(f"the {self.name} worker has died ({how}); {self._rescue(worker)}")
                case {"is": "gone", "text": str(text)}:
                    self._in_doubt = True
                    raise RobotLostError(text)
                case {"id": int(goal), "is": "feedback", "text": str(text)} if goal == number:
                    feedback(text)
                case {"id": int(goal), "is": "picture", "data": str(data)} if goal == number:
                    feedback(CameraPicture(base64.b64decode(data)))
                case {"is": "pose", "x": float(x), "y": float(y)}:
                    before, at = at, f"at ({x:z.2f}, {y:z.2f})"
                    if at != before:
                        feedback(at)
                case {"id": int(goal)} as message if goal == number:
                    return message

    def _send(self, request: WorkerMessage) -> tuple[RosWorker, int]:
        """Send a request and return the worker and the request's number. Raise CancelledError if stopped."""
        with self._send_lock:
            if self._stopped:
                raise CancelledError
            assert self._worker is not None, "the robot is not connected"
            self._number += 1
            self._worker.send({**request, "id": self._number})
            return self._worker, self._number

    def cancel(self) -> None:
        """Have the worker cancel the robot's goal. If it hangs or is dead, a new worker cancels all goals."""
        has_lock = self._send_lock.acquire(timeout=CANCEL_SECONDS)  # a hanging worker can block its owner
        try:
            self._stopped = True
            worker = self._worker
            self.clock.stop()
            if worker is not None and has_lock and worker.cancel(CANCEL_SECONDS):
                return
        finally:
            if has_lock:
                self._send_lock.release()
        if worker is not None:
            self._rescue(worker)
        else:  # the robot was lost or did not confirm a stop, or it is being connected
            with self._rescue_lock:
                self._in_doubt = True
                self._cancel_all()

    def disconnect(self) -> None:
        """Have the worker cancel its goal and exit."""
        with self._send_lock:
            self._stopped = True
            worker, self._worker = self._worker, None
        self.clock.stop()
        if worker is not None and not worker.leave():
            self._in_doubt = True

    def _start(self, *, cancel_all: bool) -> RosWorker:
        start: WorkerMessage = {
            "address": self.address,
            "node": self._node,
            "calls": calls_data(self.connection),
            "packages": self.connection.packages,
            "pose": self.connection.pose,
            "velocity": self.connection.velocity,
            "frames": self.connection.frames,
            "keepout": self.connection.keepout or [],
            "cancel_all": cancel_all,
            "sign": str(robot_file(self.name, self.address, f"{self._node}.goal")),
            **vars(self._waits),
        }
        return RosWorker(self._python, self._script, start, self._environment)

    def _rescue(self, worker: RosWorker) -> str:
        """Replace a lost worker with one that cancels all goals, and return a clause on the outcome."""
        with self._rescue_lock:
            if self._worker is not worker:
                return NOT_CANCELLED if self._in_doubt else "all goals were cancelled"
            worker.kill()
            self._worker, self._in_doubt = None, True
            return self._cancel_all()

    def _cancel_all(self) -> str:
        """Have a new worker cancel all goals, and return a clause on the outcome."""
        try:
            other = self._start(cancel_all=True)
        except NotReadyError as error:
            return f"the robot's goals could not be cancelled ({error.sentence}): {STOP_BY_HAND}"
        other.leave()
        if not other.about["cancelled_all"]:
            return NOT_CANCELLED
        self._in_doubt = False
        return "another worker has cancelled all goals"


def calls_data(connection: Connection) -> WorkerMessage:
    """Return the kind, server, type and definition of each skill's call, as data for a worker."""
    return {
        skill: {"kind": call.kind, "server": call.name, "type": call.type, "definition": call.definition}
        for skill, call in connection.calls.items()
    }
