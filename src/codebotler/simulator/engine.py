"""Run programs in worlds: each pair in a child process of its own, equal pairs once, outcomes in order."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Self, TypeVar

from codebotler.simulator import sandbox
from codebotler.simulator.robot import Argument, Behaviour, RobotError, SimulatedRobot
from codebotler.simulator.rules import PAPER, Rules
from codebotler.skills import SKILLS, Skill, SkillTable
from codebotler.trace import Option, Outcome, RunError, Status
from codebotler.world import Room, World

MEMORY = 512 * 1024 * 1024
CPU_SECONDS = 5
MAX_SOURCE = 5_000_000
OVERRUN = 100  # requests beyond a limit, from `finally` and the like, before a child is ended
HEADER = sandbox.HEADER
REHEARSAL = World((Room("room"),), "room")

LOG = logging.getLogger("codebotler.engine")
NO_SECCOMP = "programs are less isolated here: the kernel refuses a list of allowed system calls (seccomp)"

Key = TypeVar("Key")
Value = TypeVar("Value")


class EngineError(RuntimeError):
    """The engine itself failed; no verdict on a program can be drawn from it."""


def run(
    pairs: Iterable[tuple[str, World]],
    *,
    workers: int | None = None,
    rules: Rules = PAPER,
    skills: SkillTable = SKILLS,
    behaviours: dict[str, Behaviour] | None = None,
    require_isolation: bool = False,
) -> Iterator[Outcome]:
    """Run programs in worlds and yield their outcomes in the order of the pairs.

    Args:
        pairs: source of a program and the world to run it in; read as they are needed.
        workers: how many runs go on at the same time; as many as there are processors by default.
        rules: how the worlds are simulated.
        skills: the skills that programs can call.
        behaviours: what each skill does; those of the eight skills by default.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.

    Raises:
        EngineError: no isolated process could be started.
    """
    with Lanes(workers or os.cpu_count() or 1, require_isolation=require_isolation) as lanes:

        def run_pair(pair: tuple[str, World]) -> Outcome:
            source, world = pair
            return simulate(lanes.here(), source, lambda: SimulatedRobot(world, rules, skills, behaviours))

        yield from lanes.map_distinct(run_pair, pairs)


def simulate(lane: Lane, source: str, new_robot: Callable[[], SimulatedRobot]) -> Outcome:
    """Run a program with a simulated robot, once more if its process was lost through no fault of its own.

    Args:
        lane: where to run it.
        source: the program, which need not even parse.
        new_robot: makes the robot, in the initial state of its world.

    Raises:
        EngineError: its process was lost twice.
    """
    try:
        return lane.run(source, new_robot())
    except LostChildError:
        try:
            return lane.run(source, new_robot())
        except LostChildError as error:
            raise EngineError(f"an isolated process was lost twice: {error}") from None


class Lanes:
    """Threads that each own one zygote; use as a context manager.

    Args:
        workers: how many.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.

    Raises:
        EngineError: no zygote can be started, or a wall is missing that is required.
    """

    def __init__(self, workers: int, *, require_isolation: bool = False) -> None:
        self.workers = workers
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="lane")
        self._local = threading.local()
        first = Lane()
        if not first.has_seccomp:
            if require_isolation:
                first.close()
                raise EngineError(NO_SECCOMP)
            LOG.warning(NO_SECCOMP)
        self._lanes = [first]
        self._idle = [first]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)
        for lane in self._lanes:
            lane.stop()
        self._pool.shutdown(wait=True)
        for lane in self._lanes:
            lane.close()

    def here(self) -> Lane:
        """The lane of the calling thread."""
        lane: Lane | None = getattr(self._local, "lane", None)
        if lane is None:
            try:
                lane = self._idle.pop()
            except IndexError:
                lane = Lane()
                self._lanes.append(lane)
            self._local.lane = lane
        return lane

    def map_distinct(self, function: Callable[[Key], Value], keys: Iterable[Key]) -> Iterator[Value]:
        """Like `map`, in threads, calling the function once for equal keys and reading ahead a little."""
        done: dict[Hashable, Future[Value]] = {}
        waiting: deque[Future[Value]] = deque()
        remaining = iter(keys)
        while True:
            for key in islice(remaining, max(0, 8 * self.workers - len(waiting))):
                if key not in done:
                    done[key] = self._pool.submit(function, key)
                waiting.append(done[key])
            if not waiting:
                return
            yield waiting.popleft().result()


@dataclass
class Ledger:
    """What a run has spent, kept on this side of the wall.

    Args:
        calls: skill calls.
        text: characters of all texts.
        limit: the limit that was reached, in words.
    """

    calls: int = 0
    text: int = 0
    limit: str | None = None


class Lane:
    """One zygote and the runs it forks, one at a time.

    Raises:
        EngineError: the zygote does not start.
    """

    def __init__(self) -> None:
        self._stopped = False
        self._start()

    def run(self, source: str, robot: SimulatedRobot) -> Outcome:
        """Run one program with one robot.

        Args:
            source: the program, which need not even parse.
            robot: who executes its skills; it has done nothing yet.

        Raises:
            LostChildError: the process ended through no fault of the program; the lane can be used again.
            EngineError: the lane was stopped.
        """
        if len(source) > MAX_SOURCE:
            error = RunError("MemoryError", f"the program is longer than {MAX_SOURCE:,} characters")
            return Outcome(Status.PYTHON_ERROR, (), error)
        try:
            return Conversation(self._fork(), source, robot).outcome()
        except (LostChildError, OSError) as error:
            if self._stopped:
                raise EngineError("the engine was stopped") from None
            self.close()
            self._start()
            raise LostChildError(str(error)) from None

    def stop(self) -> None:
        """End the zygote and with it a run that is still going on; its thread notices."""
        self._stopped = True
        self._zygote.kill()

    def close(self) -> None:
        """Give back all that the lane holds; nothing may be running."""
        self._zygote.kill()
        self._zygote.wait()
        for descriptor in (self._wake, self._report):
            os.close(descriptor)
        self._door.close()

    def _start(self) -> None:
        wake, self._wake = os.pipe()
        self._report, report = os.pipe()
        door, self._door = socket.socketpair()
        with door:
            inherited = (wake, door.fileno(), report)
            self._zygote = subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that runs us
                [sys.executable, *sandbox.FLAGS, str(Path(sandbox.__file__)), *map(str, inherited)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd="/",
                env={"PYTHONHASHSEED": "0", "TZ": "UTC", "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1"},
                pass_fds=inherited,
                start_new_session=True,
            )
        os.close(wake)
        os.close(report)
        try:
            self.has_seccomp = self._read_report() == 1
            self._rehearse()
        except (LostChildError, OSError):
            raise EngineError("the zygote of the engine does not start") from None

    def _rehearse(self) -> None:
        """Run an empty program: by then the heap of the zygote, which programs can see, has settled."""
        Conversation(self._fork(), "task_program = int", SimulatedRobot(REHEARSAL)).outcome()

    def _fork(self) -> Child:
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._door, [b"x"], [theirs.fileno()])
        try:
            os.write(self._wake, b"x")
            pid = self._read_report()
        except (LostChildError, OSError):
            ours.close()
            raise
        return Child(pid, ours, self._read_report)

    def _read_report(self) -> int:
        data = os.read(self._report, struct.calcsize("=q"))
        if not data:
            raise LostChildError("the zygote has ended")
        return int(struct.unpack("=q", data)[0])


class LostChildError(Exception):
    """A child ended before it could close its walls, through no fault of the program."""


class ProtocolError(Exception):
    """The program has got hold of the channel and says what the child never would."""


class Child:
    """One isolated process, seen from outside.

    Args:
        pid: its process id, which stays its own until the next run.
        channel: the socket to it.
        wait: waits for its end and returns its exit status, or minus the signal.
    """

    def __init__(self, pid: int, channel: socket.socket, wait: Callable[[], int]) -> None:
        self.pid, self._channel, self._wait = pid, channel, wait
        self._buffer = b""
        channel.settimeout(1.0)

    def send(self, message: object) -> None:
        """Send a frame; a child that is gone or does not listen is noticed when it is listened to."""
        data = json.dumps(message).encode()
        with contextlib.suppress(OSError):
            self._channel.sendall(struct.pack(">I", len(data)) + data)

    def receive(self) -> object:
        """The child's next message; None when it has hung up.

        Raises:
            ProtocolError: it is none.
            TimeoutError: the child waits for something that will never come.
        """
        stuck = Stuck(self.pid)
        while True:
            if len(self._buffer) >= HEADER:
                end = HEADER + int.from_bytes(self._buffer[:HEADER], "big")
                if end - HEADER > sandbox.MAX_FRAME:
                    raise ProtocolError("a frame is too long")
                if len(self._buffer) >= end:
                    frame, self._buffer = self._buffer[HEADER:end], self._buffer[end:]
                    return _parsed(frame)
            try:
                piece = self._channel.recv(1 << 16)
            except TimeoutError:
                stuck.check()
                continue
            except OSError:
                return None
            if not piece:
                return None
            self._buffer += piece

    def end(self) -> int:
        """End it, if it has not ended, and return its exit status, or minus the signal."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        try:
            return self._wait()
        finally:
            self._channel.close()

    def ended(self) -> int:
        """Wait a moment for it to end by itself; then like `end`."""
        for _ in range(50):
            if _state(self.pid) in (None, "Z"):
                break
            threading.Event().wait(0.002)
        return self.end()


def _parsed(frame: bytes) -> object:
    try:
        return json.loads(frame)
    except (ValueError, RecursionError):
        raise ProtocolError("a frame is no JSON") from None


class Stuck:
    """Tells a child that waits for nothing from one that computes: it sleeps and uses no processor time.

    Args:
        pid: the child's process id.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._used: float | None = None

    def check(self) -> None:
        """Compare with the last check.

        Raises:
            TimeoutError: it slept both times and has not used any processor time between them.
        """
        used = _processor_time(self._pid) if _state(self._pid) == "S" else None
        if used is not None and used == self._used:
            raise TimeoutError
        self._used = used


def _stat(pid: int) -> list[str]:
    try:
        return (
            Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        )
    except OSError:
        return []


def _state(pid: int) -> str | None:
    fields = _stat(pid)
    return fields[0] if fields else None


def _processor_time(pid: int) -> float | None:
    fields = _stat(pid)
    return float(int(fields[11]) + int(fields[12])) if fields else None


class Conversation:
    """One run: answers what the child asks until it ends, and says how it ended.

    Args:
        child: the fresh child.
        source: the program.
        robot: who executes its skills.

    Raises:
        LostChildError: the child ended before its walls were closed.
    """

    def __init__(self, child: Child, source: str, robot: SimulatedRobot) -> None:
        self.child, self.robot, self.limits = child, robot, robot.rules.limits
        self.ledger = Ledger()
        self.errors: list[RobotError] = []
        child.send(
            {
                "source": source,
                "literals": robot.rules.literals,
                "skills": [
                    [s.name, [[p.name, p.type.__name__] for p in s.parameters]] for s in robot.skills.values()
                ],
                "ticks": self.limits.ticks,
                "seconds": self.limits.seconds,
                "clock": robot.rules.clock_starts.timestamp(),
                "memory": MEMORY,
                "cpu": CPU_SECONDS,
            }
        )
        if child.receive() != "ready":
            child.end()
            raise LostChildError("a child ended before it was closed")

    def outcome(self) -> Outcome:
        """Talk to the end."""
        try:
            final = self._talk()
        except TimeoutError:
            self.ledger.limit = "it waits for something that can never come"
            final = None
        except ProtocolError as error:
            self.child.end()
            return self._outcome(Status.KILLED, "Crash", f"the program spoke on the robot's line: {error}")
        status = self.child.end() if final or self.ledger.limit else self.child.ended()
        if self.ledger.limit is not None:
            line = final.get("line") if final else None
            return self._outcome(Status.TIMEOUT, "TimeoutError", self.ledger.limit, line)
        return self._died(status) if final is None else self._ended(final)

    def _talk(self) -> dict[str, object] | None:
        overrun = 0
        while (message := self.child.receive()) is not None:
            if isinstance(message, dict):
                return message
            match message:
                case [str() as name, list() as values, int() | float() as now]:
                    self.child.send(self._answer(name, values, now))
                case _:
                    raise ProtocolError("a request is malformed")
            overrun += self.ledger.limit is not None
            if overrun > OVERRUN:
                return None
        return None

    def _answer(self, name: str, values: list[object], now: float) -> tuple[str, object]:
        if self.ledger.limit is None:
            self._let_time_pass(now)
        if self.ledger.limit is None:
            if name in self.robot.skills:
                return self._perform(self.robot.skills[name], values)
            if name != "too-long":
                raise ProtocolError("there is no such skill")
            self.ledger.limit = f"a text of more than {self.limits.text:,} characters"
        return ("stop", None)

    def _let_time_pass(self, now: float) -> None:
        if now > self.limits.seconds:
            now = self.limits.seconds
            self.ledger.limit = f"{self.limits.seconds:,.0f} seconds of simulated time"
        if now >= self.robot.now:  # else the program has found the channel, and deceives itself
            self.robot.now = float(now)

    def _perform(self, skill: Skill, values: list[object]) -> tuple[str, object]:
        arguments = _arguments(skill, values)
        self.ledger.calls += 1
        texts = [t for a in arguments for t in ([a] if isinstance(a, str) else [o.text for o in a])]
        self.ledger.text += sum(map(len, texts))
        if self.ledger.calls > self.limits.calls:
            self.ledger.limit = f"{self.limits.calls:,} skill calls"
        elif any(len(text) > self.limits.text for text in texts):
            self.ledger.limit = f"a text of more than {self.limits.text:,} characters"
        elif self.ledger.text > self.limits.trace:
            self.ledger.limit = f"texts of more than {self.limits.trace:,} characters in all"
        if self.ledger.limit is not None:
            return ("stop", None)
        try:
            return ("ok", self.robot.perform(skill.name, arguments))
        except RobotError as error:
            self.errors.append(error)
            return ("error", [len(self.errors) - 1, error.kind, str(error)])

    def _ended(self, final: dict[str, object]) -> Outcome:
        line = final.get("line")
        match final:
            case {"end": "finished"}:
                return Outcome(Status.FINISHED, self.robot.trace)
            case {"end": "timeout"}:
                return self._outcome(
                    Status.TIMEOUT, "TimeoutError", f"{self.limits.ticks:,} turns of loops", line
                )
            case {"end": "robot-error", "number": int(number)} if 0 <= number < len(self.errors):
                error = self.errors[number]
                return self._outcome(Status.ROBOT_ERROR, error.kind, str(error), line)
            case {"end": "python-error", "kind": str(kind), "message": str(message)}:
                name = kind if kind.isidentifier() else "Exception"
                return self._outcome(Status.PYTHON_ERROR, name[:100], message[:1000], line)
            case _:
                return self._outcome(Status.KILLED, "Crash", "the program spoke on the robot's line")

    def _died(self, status: int) -> Outcome:
        if status == -signal.SIGXCPU:
            return self._outcome(
                Status.TIMEOUT, "TimeoutError", f"{CPU_SECONDS} seconds of processor time in one step"
            )
        if status == -signal.SIGSYS:
            return self._outcome(
                Status.KILLED, "ForbiddenCall", "the program asked the kernel for what is forbidden"
            )
        if status == -signal.SIGKILL:
            return self._outcome(Status.KILLED, "MemoryError", "the process was killed from outside")
        how = f"signal {-status}" if status < 0 else f"exit status {status}"
        return self._outcome(Status.KILLED, "Crash", f"the process ended by itself ({how})")

    def _outcome(self, status: Status, kind: str, message: str, line: object = None) -> Outcome:
        where = line if isinstance(line, int) and line > 0 else None
        return Outcome(status, self.robot.trace, RunError(kind, message), where)


def _arguments(skill: Skill, values: list[object]) -> list[Argument]:
    if len(values) != len(skill.parameters):
        raise ProtocolError("a skill has other parameters")
    arguments: list[Argument] = []
    for parameter, value in zip(skill.parameters, values, strict=True):
        if parameter.type is str and isinstance(value, str):
            arguments.append(value)
        elif parameter.type is list and isinstance(value, list):
            arguments.append(tuple(_option(option) for option in value))
        else:
            raise ProtocolError("an argument is of another type")
    return arguments


def _option(value: object) -> Option:
    match value:
        case [str(text), bool(is_text)]:
            return Option(text, is_text)
        case _:
            raise ProtocolError("an option is malformed")
