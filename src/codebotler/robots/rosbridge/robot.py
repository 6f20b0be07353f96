"""A robot behind a rosbridge: ROS over a websocket, with nothing of ROS on this machine."""

from __future__ import annotations

import json
import queue
import sys
import threading
import time
import uuid
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import ClientConnection, connect

from codebotler.core.skills import SKILLS, RosAction, Skill, SkillTable
from codebotler.core.terminal import visible
from codebotler.robots.address import endpoint
from codebotler.robots.base import (
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    Readiness,
    Result,
    RobotLostError,
    untold,
)
from codebotler.robots.clock import Clock
from codebotler.robots.ros import Waits, error_of
from codebotler.robots.rosbridge.protocol import Dialect, Message, News, Operations, Topics
from codebotler.robots.rosbridge.watchdog import CLOSES, Voice
from codebotler.robots.worker import RosWorker
from codebotler.simulator.robot import RobotError

ADDRESS = "ws://localhost:9090"
GUARD = Path(__file__).with_name("watchdog.py")
ASKS_VERSION = {"op": "call_service", "id": "version", "service": "/rosapi/get_ros_version", "args": {}}
VERSION = 2.0  # seconds that a rosbridge may take to tell which ROS it has; one without rosapi cannot
AGAIN = 0.5  # seconds after which what nobody has taken notice of is said again
SETTLES = 1.5  # seconds for which a server's status comes until its results come, too, on a busy machine
TICK = 0.005  # seconds between two looks whether a server is heard
TURN = 0.05  # seconds of one turn of waiting
NOTE = "robots of ROS 2 behind it were only tested against a stand-in for the protocol"


class Rosbridge:
    """A robot behind a rosbridge.

    Args:
        address: such as ws://robot:9090; empty for this machine.
        skills: what it can be asked to do.
        speed: of its clock.
        waits: for how long what is waited for.
    """

    name = "rosbridge"
    missing: Mapping[str, str] = MappingProxyType({})
    """It is seen only when a skill is performed."""

    if_tool_dies = "a process beside the tool then cancels the robot's goal, unless it was killed as well"

    def __init__(
        self,
        address: str = "",
        *,
        skills: SkillTable = SKILLS,
        speed: float | None = 1.0,
        waits: Waits | None = None,
    ) -> None:
        self._where = address or ADDRESS
        self.address, self.skills, self.clock = endpoint(self._where), skills, Clock(speed)
        self._waits = waits or Waits()
        self._line: Line | None = None
        self._guard: RosWorker | None = None
        self._going: tuple[RosAction, str] | None = None
        self._stopped = True
        self._order = threading.Lock()

    def connect(self) -> None:
        """Open the connection, and set the clock to 0.

        Raises:
            NotReadyError: there is no rosbridge.
        """
        self.disconnect()
        actions = [skill.ros for skill in self.skills.rows if skill.ros is not None]
        self._line, self._stopped = Line(self._where, actions, self._waits.patience), False
        start = {"address": self._where, "opening": _advertised(self._line.dialect, actions)}
        self._guard = RosWorker(Path(sys.executable), GUARD, start, {"PYTHONSAFEPATH": "1"})
        self.clock.restart()

    def perform(self, skill: str, arguments: Sequence[Argument], told: Feedback = untold) -> Result:
        """Send a goal and wait for its end.

        Raises:
            RobotError: the server rejects or aborts it.
            CancelledError: it was cancelled, by us or by somebody else.
            RobotLostError: the connection is lost, or the server does not answer.
        """
        row = self.skills[skill]
        if row.ros is None:
            raise RobotError("SkillWithoutAction", f"no ROS action is known for the skill {skill}")
        with self._order:
            if self._stopped:
                raise CancelledError
            assert self._line is not None, "the robot is not connected"
            assert self._guard is not None
            line, guard, goal = self._line, self._guard, str(uuid.uuid4())
            self._going = row.ros, goal
            guard.send({"say": line.dialect.cancel(row.ros, goal)})
            sent = line.dialect.goal(row.ros, goal, arguments)
        try:
            self._hold(line, row.ros.server)
            with self._order:
                if self._stopped:
                    raise CancelledError
                line.send(sent)
            return self._ended(line, row, sent, _Watch(goal, row.ros.server, self._waits), told)
        finally:
            with self._order:
                self._going = None
            guard.send({"say": None})

    def cancel(self) -> None:
        """Cancel the goal that goes on."""
        with self._order:
            self._stopped = True
            self.clock.stop()
            if self._line is not None and self._going is not None:
                self._line.send(self._line.dialect.cancel(*self._going))

    def disconnect(self) -> None:
        """Cancel what goes on, and close the connection."""
        self.cancel()
        with self._order:
            line, self._line = self._line, None
            guard, self._guard = self._guard, None
        if line is not None:
            line.close()
        if guard is not None:
            guard.leave()

    def _hold(self, line: Line, server: str) -> None:
        """Wait until a server is well heard; the result of a goal that is sent before may be lost."""
        until = time.monotonic() + self._waits.patience + SETTLES
        while line.dialect.is_heard and server not in line.well_heard and not (line.is_lost or self._stopped):
            if time.monotonic() > until:
                raise RobotLostError(line.absent(server))
            time.sleep(TICK)

    def _ended(self, line: Line, skill: Skill, sent: Message, watch: _Watch, told: Feedback) -> Result:
        """Wait for the end of a goal; what nobody takes notice of is said again."""
        while (news := line.news(watch.goal)) is None or news.what != "ended":
            if news is not None and news.what == "feedback":
                told(news.text)
            watch.is_taken = watch.is_taken or news is not None
            now = time.monotonic()
            if news is not None and news.state and watch.ends is None:
                watch.ends = now
            if self._stopped and watch.cancelled is None:
                watch.cancelled = now
            if news is None and line.is_lost:
                raise RobotLostError(self._rescue(line.dialect, skill, watch.goal))
            why = watch.fault(now, line)
            if why is not None:
                assert skill.ros is not None
                line.send(line.dialect.cancel(skill.ros, watch.goal))
                raise RobotLostError(why)
            if line.dialect.is_heard and now >= watch.again:
                watch.again = now + AGAIN
                assert skill.ros is not None
                if watch.cancelled is not None:
                    line.send(line.dialect.cancel(skill.ros, watch.goal))
                elif not watch.is_taken:
                    line.send(sent)
        return self._result(skill, news)

    def _result(self, skill: Skill, news: News) -> Result:
        if news.state == "cancelled" or (self._stopped and news.state != "lost"):
            raise CancelledError
        if news.state == "lost":
            raise RobotLostError(
                f"rosbridge could not have {skill.name} done: {visible(news.text) or 'it does not say why'}"
            )
        if news.state != "succeeded":
            raise error_of(skill, news.text, news.state)
        value = next(iter(news.values.values()), None)
        match value:
            case bool() | str() | list() | None:
                return value
        raise RobotLostError(f"{skill.name} cannot return {value!r:.100}, as the robot's did")

    def _rescue(self, dialect: Dialect, skill: Skill, goal: str) -> str:
        """Cancel a goal over another connection; what became of that, in words."""
        assert skill.ros is not None
        where, voice = self._where, Voice(self._where, _advertised(dialect, [skill.ros]))
        is_said = voice.insist(dialect.cancel(skill.ros, goal))
        voice.close()
        if is_said:
            return f"the connection with {where} was lost; its goal was cancelled over another one"
        return f"the connection with {where} was lost, and its goal goes on: STOP THE ROBOT BY HAND"


def _advertised(dialect: Dialect, actions: Sequence[RosAction]) -> list[Message]:
    """What is said on a connection that only speaks."""
    opening = (message for action in actions for message in dialect.opening(action))
    return [message for message in opening if message["op"] == "advertise"]


class _Watch:
    """What is known of a goal that goes on.

    Args:
        goal: its id.
        server: who executes it.
        waits: for how long what is waited for.
    """

    def __init__(self, goal: str, server: str, waits: Waits) -> None:
        self.goal, self.server, self.waits = goal, server, waits
        self.sent = time.monotonic()
        self.again = self.sent + AGAIN
        self.is_taken = False
        self.cancelled: float | None = None
        self.ends: float | None = None  # since when only its result is waited for

    def fault(self, now: float, line: Line) -> str | None:
        """Why it is not to be waited for any longer."""
        waits, heard = self.waits, line.heard.get(self.server)
        late = now - waits.patience
        faults = (
            (
                heard is not None and max(heard, self.sent) < now - waits.silence,
                f"the action server at {self.server} has died: no status for {waits.silence:g} s",
            ),
            (
                self.cancelled is not None and self.cancelled < late,
                f"{self.server} was told to stop, and did not say within {waits.patience:g} s that it has",
            ),
            (
                line.dialect.is_heard and not self.is_taken and self.sent < late,
                f"{self.server} did not take the goal within {waits.patience:g} s",
            ),
            (
                self.ends is not None and self.ends < late,
                f"{self.server} ended the goal, but sent no result within {waits.patience:g} s",
            ),
            (
                self.sent < now - waits.longest,
                f"{self.server} did not end within {waits.longest:g} s; the goal was cancelled",
            ),
        )
        return next((sentence for is_so, sentence in faults if is_so), None)


class Line:
    """An open connection with a rosbridge.

    Args:
        address: where it is.
        actions: which are spoken of.
        patience: seconds that it may take to answer.

    Raises:
        NotReadyError: nobody answers.
    """

    def __init__(self, address: str, actions: Sequence[RosAction], patience: float) -> None:

        self._opened = ExitStack()
        try:
            self._socket: ClientConnection = self._opened.enter_context(
                connect(address, open_timeout=patience, close_timeout=CLOSES, max_size=None)
            )
        except (OSError, TimeoutError, ValueError, WebSocketException) as error:
            raise NotReadyError(
                f"no rosbridge answers at {address} ({error}); start it, or name another by --address"
            ) from None
        self._news: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._version: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._heard: dict[str, float] = {}
        self._heard_first: dict[str, float] = {}
        self.well_heard: set[str] = set()
        """Servers whose status comes for a while: by then their results are connected as well."""
        self.is_lost, self.complaint = False, ""
        self.dialect: Dialect = Topics()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.send(ASKS_VERSION)
        try:
            if self._version.get(timeout=VERSION) == 2:  # noqa: PLR2004 - ROS 2
                self.dialect = Operations()
        except queue.Empty:  # it has no rosapi
            pass
        for action in actions:
            for message in self.dialect.opening(action):
                self.send(message)

    @property
    def heard(self) -> Mapping[str, float]:
        """When the last status of a server came, on a clock that nobody sets."""
        return self._heard

    def absent(self, server: str) -> str:
        """What to say where a server is not heard."""
        why = f" ({self.complaint})" if self.complaint else ""
        return f"there is no action server at {server}, or none that rosbridge could reach{why}"

    def send(self, message: Message) -> None:
        """Say something; in vain where the connection is lost."""
        try:
            self._socket.send(json.dumps(message))
        except ConnectionClosed:
            self.is_lost = True

    def news(self, goal: str) -> News | None:
        """What was heard of a goal within a turn; what concerns others is dropped."""
        until = time.monotonic() + TURN
        while (left := until - time.monotonic()) > 0:
            try:
                news = self._news.get(timeout=left)
            except queue.Empty:
                return None
            if news.goal == goal:
                return news
        return None

    def close(self) -> None:
        """End the connection."""
        self._opened.close()
        self._reader.join()

    def _read(self) -> None:

        try:
            for text in self._socket:
                self._take(text)
        except ConnectionClosed:
            pass
        finally:
            self.is_lost = True

    def _take(self, text: str | bytes) -> None:
        """Hear a message; what is none is remembered, should nothing else come."""
        try:
            self._hear(json.loads(text))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            self.complaint = f"it says what is no message of rosbridge: {visible(repr(text[:100]))}"

    def _hear(self, message: Message) -> None:
        match message:
            case {
                "op": "service_response",
                "id": "version",
                "result": True,
                "values": {"version": int(which)},
            }:
                self._version.put(which)
            case {"op": "service_response", "id": "version"}:
                self._version.put(1)
            case {"op": "status", "level": "error", "msg": str(complaint)}:
                self.complaint = visible(complaint)
        for news in self.dialect.news(message):
            if news.server and not news.goal:
                self._heard[news.server] = now = time.monotonic()
                if now - self._heard_first.setdefault(news.server, now) > SETTLES:
                    self.well_heard.add(news.server)
            if news.goal:
                self._news.put(news)


def readiness() -> Readiness:
    """It needs nothing here; whether there is a robot is seen when it is connected."""
    return Readiness("rosbridge", works=True, note=f"at --address, {ADDRESS} by default; {NOTE}")


def robot(options: Options) -> Rosbridge:
    """The robot that a user means."""
    return Rosbridge(options.address, skills=options.skills, speed=options.speed)
