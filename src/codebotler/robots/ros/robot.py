"""What robots on ROS have in common: a worker that sends goals to one action server per skill."""

from __future__ import annotations

import base64
import re
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from codebotler.core.errors import RobotError
from codebotler.robots.base import (
    ROS_PYTHON,
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    Picture,
    Readiness,
    Result,
    RobotLostError,
    no_feedback,
)
from codebotler.robots.clock import Clock
from codebotler.robots.reservation import file_of
from codebotler.robots.ros.connection import Connection, SkillCall, Values, connection_of
from codebotler.robots.ros.worker import Message, RosWorker, lacks

OTHER_PYTHON = f"codebotler robots --ros-python {ROS_PYTHON}"
UNCANCELLED = "its goals could not be cancelled: STOP THE ROBOT BY HAND"
CANCELS = 1.0  # seconds within which the worker must have passed on a cancel
NAMED_ERROR = re.compile(r"([A-Z][A-Za-z]+): (.+)", re.DOTALL)


@dataclass(frozen=True)
class Waits:
    """Time limits, in seconds above 0.

    Args:
        patience: for an action server to appear, accept a goal, confirm a stop, or send a result.
        silence: between two statuses of a server; after that it counts as dead.
        longest: for a skill to end.
    """

    patience: float = 5.0
    silence: float = 3.0
    longest: float = 600.0


class RosRobot:
    """A robot that offers an action server for each skill.

    Args:
        name: the kind of robot.
        address: of the robot.
        script: what the worker runs, a file of `workers/` or a path.
        options: a user's; a speed other than 1 is for a virtual robot with that speed.
        environment: variables for the worker.
        waits: time limits.
        node: the worker's name on the graph, which only one node can have.
    """

    if_tool_dies = "the worker then cancels the robot's goal, unless it was killed as well"
    rooms_are_regexes = has_pose = False

    def __init__(
        self,
        name: str,
        address: str,
        script: str,
        options: Options,
        environment: Mapping[str, str],
        *,
        waits: Waits | None = None,
        node: str = "codebotler",
    ) -> None:
        self.connection = options.connection or connection_of(options.skills)
        self.name, self.address = name, address
        self.skills = options.skills if options.connection is None else self.connection.skills(options.skills)
        self.clock = Clock(options.speed)
        self.missing: Mapping[str, str] = {}
        self._script, self._python, self._environment = script, options.ros_python, environment
        self._node = node
        self._waits = waits or Waits()
        self._worker: RosWorker | None = None
        self._in_doubt = False  # whether an unwatched goal may still be going on
        self._stopped, self._number = True, 0
        self._order = threading.Lock()  # what was asked for before a stop is sent before it
        self._rescue_lock = threading.RLock()

    def connect(self) -> None:
        """Start a worker, wait for the action servers, and set the clock to 0.

        Raises:
            NotReadyError: there is no ROS, master or action server, or another tool uses the robot.
        """
        self.disconnect()
        worker = self._start(cancel_all=self._in_doubt)
        self.missing = worker.about["missing"]
        if self.missing and self.missing.keys() == self.connection.calls.keys():
            worker.leave()
            raise NotReadyError(f"the robot offers nothing: {next(iter(self.missing.values()))}")
        self._worker, self._stopped, self._in_doubt = worker, False, False
        self.clock.restart()

    def perform(self, skill: str, arguments: Sequence[Argument], feedback: Feedback = no_feedback) -> Result:
        """Send a goal and wait for its end.

        Raises:
            RobotError: the server rejects or aborts it.
            CancelledError: it was cancelled, by us or by another client.
            RobotLostError: the server or the worker died, or does not answer.
        """
        names = (parameter.name for parameter in self.skills[skill].parameters)
        return self._called(skill, dict(zip(names, arguments, strict=True)), feedback)

    def _called(self, skill: str, values: Values, feedback: Feedback) -> Result:
        """Perform a skill by its call, with values for the variables of that."""
        call = self.connection.calls.get(skill)
        if call is None:
            raise RobotError("SkillWithoutAction", f"there is no ROS action for the skill {skill}")
        order = {"do": "perform", "skill": skill, "fields": call.fields(values)}
        result: Result = call.answer(self._received(call, order, feedback))
        return result

    def _received(self, call: SkillCall, order: Message, feedback: Feedback) -> Values:
        """Send an order to perform a call, and return what the robot answers."""
        message = self._awaited(order, feedback)
        match message:
            case {"is": "result", "values": dict(values)}:
                return values
            case {"is": "error", "text": str(text), "state": str(state)}:
                raise error_of(call, text or call.why(message.get("values", {})), state)
            case {"is": "cancelled"}:
                raise CancelledError
        self._in_doubt = self._in_doubt or message["is"] == "lost"
        raise RobotLostError(message["text"])

    def _awaited(self, order: Message, feedback: Feedback) -> Message:
        """Send an order, and return the worker's last message about it."""
        worker, number = self._sent(order)
        at = ""
        while True:
            match worker.receive(self._waits.patience * 2):
                case None:
                    raise RobotLostError(f"the worker of {self.name} does not answer; {self._rescue(worker)}")
                case {"is": "ended"}:
                    how = worker.how_it_ended()
                    raise RobotLostError(
                        f"the worker of {self.name} has died ({how}); {self._rescue(worker)}"
                    )
                case {"is": "gone", "text": str(text)}:
                    self._in_doubt = True
                    raise RobotLostError(text)
                case {"id": int(goal), "is": "feedback", "text": str(text)} if goal == number:
                    feedback(text)
                case {"id": int(goal), "is": "picture", "data": str(data)} if goal == number:
                    feedback(Picture(base64.b64decode(data)))
                case {"is": "pose", "x": float(x), "y": float(y)}:
                    before, at = at, f"at ({x:z.2f}, {y:z.2f})"
                    if at != before:
                        feedback(at)
                case {"id": int(goal)} as message if goal == number:
                    return message

    def _sent(self, order: Message) -> tuple[RosWorker, int]:
        """Send an order, unless the robot was stopped; to which worker, and its number."""
        with self._order:
            if self._stopped:
                raise CancelledError
            assert self._worker is not None, "the robot is not connected"
            self._number += 1
            self._worker.send({**order, "id": self._number})
            return self._worker, self._number

    def cancel(self) -> None:
        """Have the worker cancel the goal; if it hangs, have another one cancel all goals."""
        has_order = self._order.acquire(timeout=CANCELS)  # a worker that hangs may not even read a long goal
        try:
            self._stopped = True
            worker = self._worker
            self.clock.stop()
            if worker is None or (has_order and worker.cancel(CANCELS)):
                return
        finally:
            if has_order:
                self._order.release()
        self._rescue(worker)

    def disconnect(self) -> None:
        """Have the worker cancel what goes on, and end it."""
        with self._order:
            self._stopped = True
            worker, self._worker = self._worker, None
        self.clock.stop()
        if worker is not None and not worker.leave():
            self._in_doubt = True

    def _start(self, *, cancel_all: bool) -> RosWorker:
        here = self.connection
        start: Message = {
            "address": self.address,
            "node": self._node,
            "calls": calls_data(here),
            "packages": here.packages,
            "pose": here.pose and vars(here.pose),
            "velocity": here.velocity and vars(here.velocity),
            "keepout": here.keepout or [],
            "cancel_all": cancel_all,
            "sign": str(file_of(self.name, self.address, f"{self._node}.goal")),
            **vars(self._waits),
        }
        return RosWorker(self._python, self._script, start, self._environment)

    def _rescue(self, worker: RosWorker) -> str:
        """Replace a lost worker by one that cancels all goals; the outcome as a clause."""
        with self._rescue_lock:
            if self._worker is not worker:
                return UNCANCELLED if self._in_doubt else "all goals were cancelled"
            worker.kill()
            self._worker, self._in_doubt = None, True
            try:
                other = self._start(cancel_all=True)
            except NotReadyError as error:
                return f"its goals could not be cancelled ({error.sentence}): STOP THE ROBOT BY HAND"
            other.leave()
            if not other.about["cancelled_all"]:
                return UNCANCELLED
            self._in_doubt = False
            return "another worker has cancelled all goals"


def ros_readiness(
    name: str, python: Path, needs: Sequence[str], mend: Callable[[Sequence[str]], str], note: str
) -> Readiness:
    """Whether an interpreter has the modules that a worker needs; `mend` names what installs the missing."""
    missing = lacks(python, needs)
    if missing is None:
        return Readiness(name, works=False, missing=f"{python} cannot be run", mend=OTHER_PYTHON, note=note)
    if missing:
        lacking = f"{python} lacks {', '.join(missing)}"
        return Readiness(name, works=False, missing=lacking, mend=mend(missing), note=note)
    return Readiness(name, works=True, note=note)


def calls_data(connection: Connection) -> Message:
    """What a worker must know of the calls of a connection, by skill."""
    return {
        skill: {"kind": call.kind, "server": call.name, "type": call.type, "definition": call.definition}
        for skill, call in connection.calls.items()
    }


def error_of(call: SkillCall, text: str, state: str) -> RobotError:
    """The error of a goal that was rejected or aborted (`state`), in the server's words.

    They may begin with the kind, as in `PickInvalidObject: there is no mug`.
    """
    named = NAMED_ERROR.fullmatch(text)
    if named is not None:
        return RobotError(named[1], named[2])
    return RobotError(call.failure, text or f"{call.name} {state} the goal without a reason")
