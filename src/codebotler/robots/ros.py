"""A robot whose ROS is spoken to by a worker, of whichever ROS."""

from __future__ import annotations

import base64
import re
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from codebotler.core.skills import SKILLS, Skill, SkillTable
from codebotler.robots.base import (
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Picture,
    Result,
    RobotLostError,
    untold,
)
from codebotler.robots.clock import Clock
from codebotler.robots.worker import ENDED, Message, RosWorker
from codebotler.simulator.robot import RobotError

PYTHON = Path("/usr/bin/python3")
OTHER_PYTHON = f"codebotler robots --ros-python {PYTHON}"
CANCELS = 1.0  # seconds within which the worker must have passed on a cancel
NAMED = re.compile(r"([A-Z][A-Za-z]+): (.+)", re.DOTALL)
"""A server's words that begin with the kind of the error."""


@dataclass(frozen=True)
class Waits:
    """For how long what is waited for, in seconds above 0.

    Args:
        patience: for an action server to be there, to take a goal, to confirm a stop, to send a result.
        silence: for the next status of a server; then it counts as dead.
        longest: for a skill to end.
    """

    patience: float = 5.0
    silence: float = 3.0
    longest: float = 600.0


@dataclass(frozen=True)
class Ros:
    """What tells one ROS from another.

    Args:
        name: of the kind of robot.
        script: the worker's file.
        python: the interpreter that the robot's ROS belongs to.
        environment: what the worker finds set.
        address: of the robot.
        node: the name under which the worker appears on the graph; only one may have it.
    """

    name: str
    script: Path
    python: Path
    environment: Mapping[str, str]
    address: str
    node: str = "codebotler"


class RosRobot:
    """A robot that offers an action server for each skill.

    Args:
        ros: which ROS, and where.
        skills: what it can be asked to do; those without an action cannot be performed.
        speed: of its clock; above 1 only where the robot is a virtual one that is as fast.
        waits: for how long what is waited for.
    """

    if_tool_dies = "the worker then cancels the robot's goal, unless it was killed as well"

    def __init__(
        self, ros: Ros, skills: SkillTable = SKILLS, speed: float | None = 1.0, waits: Waits | None = None
    ) -> None:
        self.name, self.address, self.skills = ros.name, ros.address, skills
        self.clock = Clock(speed)
        self.missing: Mapping[str, str] = {}
        self._ros, self._waits = ros, waits or Waits()
        self._worker: RosWorker | None = None
        self._doubtful = False  # whether something may still go on that nobody looks after
        self._stopped, self._number = True, 0
        self._order = threading.Lock()  # what was asked for before a stop is sent before it
        self._rescue_lock = threading.RLock()

    def connect(self) -> None:
        """Start a worker, wait for the action servers, and set the clock to 0.

        Raises:
            NotReadyError: there is no ROS, no master, no action server, or somebody else has the robot.
        """
        self.disconnect()
        worker = self._start(cancel_all=self._doubtful)
        self.missing = worker.about["missing"]
        if self.missing and self.missing.keys() == actions_of(self.skills).keys():
            worker.leave()
            raise NotReadyError(f"the robot has no action server at all: {next(iter(self.missing.values()))}")
        self._worker, self._stopped, self._doubtful = worker, False, False
        self.clock.restart()

    def perform(self, skill: str, arguments: Sequence[Argument], told: Feedback = untold) -> Result:
        """Send a goal and wait for its end.

        Raises:
            RobotError: the server rejects or aborts it.
            CancelledError: it was cancelled, by us or by somebody else.
            RobotLostError: the server or the worker died, or does not answer.
        """
        row = self.skills[skill]
        if row.ros is None:
            raise RobotError("SkillWithoutAction", f"no ROS action is known for the skill {skill}")
        try:
            return self._perform(row, arguments, told)
        except _AnewError:
            self._restart()
            try:
                return self._perform(row, arguments, told)
            except _AnewError as error:
                raise RobotLostError(str(error)) from None

    def cancel(self) -> None:
        """Have the worker cancel the goal; if it cannot, have another one cancel all goals."""
        is_ours = self._order.acquire(timeout=CANCELS)  # a worker that hangs may not even take a long goal
        try:
            self._stopped = True
            worker = self._worker
            self.clock.stop()
            if worker is None or (is_ours and worker.cancel(CANCELS)):
                return
        finally:
            if is_ours:
                self._order.release()
        self._rescue(worker)

    def disconnect(self) -> None:
        """Have the worker cancel what goes on, and end it."""
        with self._order:
            self._stopped = True
            worker, self._worker = self._worker, None
        self.clock.stop()
        if worker is not None and not worker.leave():
            self._doubtful = True

    def _start(self, *, cancel_all: bool) -> RosWorker:
        start = {
            "node": self._ros.node,
            "actions": actions_of(self.skills),
            "cancel_all": cancel_all,
            "patience": self._waits.patience,
            "silence": self._waits.silence,
            "longest": self._waits.longest,
        }
        return RosWorker(self._ros.python, self._ros.script, start, self._ros.environment)

    def _perform(self, skill: Skill, arguments: Sequence[Argument], told: Feedback) -> Result:
        with self._order:
            if self._stopped:
                raise CancelledError
            assert self._worker is not None, "the robot is not connected"
            worker = self._worker
            self._number += 1
            number = self._number
            texts = [a if isinstance(a, str) else list(a) for a in arguments]
            worker.send({"do": "perform", "id": number, "skill": skill.name, "arguments": texts})
        while True:
            message = worker.receive(self._waits.patience * 2)
            if message is None or message["is"] in {ENDED, "gone"}:
                raise self._lost(worker, message)
            if message.get("id") == number and message["is"] == "feedback":
                told(message["text"])
            elif message.get("id") == number and message["is"] == "picture":
                told(Picture(base64.b64decode(message["data"])))
            elif message.get("id") == number:
                return self._end(skill, message)

    def _end(self, skill: Skill, message: Message) -> Result:
        """What a goal came to, as the worker tells it."""
        match message:
            case {"is": "result", "value": bool() | str() | list() | None as value}:
                return value
            case {"is": "result", "value": value}:
                raise RobotLostError(f"{skill.name} cannot return {value!r:.100}, as the robot's did")
            case {"is": "error", "text": str(text), "state": str(state)}:
                raise error_of(skill, text, state)
            case {"is": "cancelled"}:
                raise CancelledError
            case {"is": "unsent", "anew": True, "text": str(text)}:
                raise _AnewError(text)
        self._doubtful = self._doubtful or message["is"] == "lost"
        raise RobotLostError(message["text"])

    def _lost(self, worker: RosWorker, message: Message | None) -> Exception:
        """What to raise when nobody looks after the goal any more, after all goals were cancelled."""
        if message is not None and message["is"] == "gone":
            self._doubtful = True
            return RobotLostError(message["text"])
        how = "does not answer" if message is None else f"has died ({worker.epitaph()})"
        return RobotLostError(f"the worker of {self.name} {how}; {self._rescue(worker)}")

    def _rescue(self, worker: RosWorker) -> str:
        """Replace a lost worker by one that cancels all goals; what became of that, in words."""
        with self._rescue_lock:
            if self._worker is not worker:
                return "all goals were cancelled"
            worker.kill()
            self._worker, self._doubtful = None, True
            try:
                self._start(cancel_all=True).leave()
            except NotReadyError as error:
                return f"its goals could not be cancelled ({error.sentence}): STOP THE ROBOT BY HAND"
            self._doubtful = False
            return "another one has cancelled all goals"

    def _restart(self) -> None:
        """Become known to a master that was started anew."""
        with self._order:
            worker, self._worker = self._worker, None
        if worker is not None:
            worker.leave()
        try:
            fresh = self._start(cancel_all=False)
        except NotReadyError as error:
            raise RobotLostError(error.sentence) from None
        with self._order:
            self._worker = fresh


class _AnewError(Exception):
    """The master was started anew and does not know the worker."""


def actions_of(skills: SkillTable) -> Message:
    """What a worker needs to know of each skill that has an action, by name."""
    return {
        skill.name: {"type": ros.type, "server": ros.server, "definition": ros.definition}
        for skill in skills.rows
        if (ros := skill.ros) is not None
    }


def error_of(skill: Skill, text: str, state: str) -> RobotError:
    """The error that a server's words mean.

    Args:
        skill: which it was.
        text: the words; they may begin with the kind, such as `PickInvalidObject: there is no mug`.
        state: rejected or aborted.
    """
    assert skill.ros is not None
    named = NAMED.fullmatch(text)
    if named is not None:
        return RobotError(named[1], named[2])
    kind = skill.ros.failure or f"{skill.ros.type}Failed"
    return RobotError(kind, text or f"{skill.ros.server} {state} the goal without a reason")
