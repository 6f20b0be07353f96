"""A lane: one zygote, and the runs it forks one at a time."""

from __future__ import annotations

import os
import socket
import struct
import subprocess
import sys

from codebotler.simulator.child import Child, LostChildError
from codebotler.simulator.conversation import Conversation
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.sandbox import FLAGS, ZYGOTE
from codebotler.trace import Outcome, RunError, Status
from codebotler.world import Room, World

MAX_SOURCE = 5_000_000
REHEARSAL = World((Room("room"),), "room")


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
                [sys.executable, *FLAGS, str(ZYGOTE), *map(str, inherited)],
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
        try:
            with theirs:
                socket.send_fds(self._door, [b"x"], [theirs.fileno()])
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


class EngineError(RuntimeError):
    """The engine itself failed; no verdict on a program can be drawn from it."""
