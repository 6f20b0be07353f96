"""A zygote, seen from outside: forks a closed child whenever one is asked for."""

from __future__ import annotations

import marshal
import os
import socket
import sys

from codebotler.simulator.child import Child, LostChildError
from codebotler.simulator.conversation import Conversation, described
from codebotler.simulator.isolated import start
from codebotler.simulator.robot import SimulatedRobot
from codebotler.world import Room, World

NUMBER = 8  # bytes of a number that it reports
REHEARSALS = 8
REHEARSAL = World((Room("room"),), "room")
EMPTY = marshal.dumps(compile("task_program = int", "<program>", "exec"))


class Zygote:
    """One zygote and the children it forks, one at a time.

    Args:
        role: of the two kinds of zygotes.

    Raises:
        LostChildError: it does not start.
    """

    def __init__(self, role: str) -> None:
        self._report, report = os.pipe()
        door, self._door = socket.socketpair()
        with door:
            self._process = start(role, door.fileno(), report)
        os.close(report)
        self._has_child = False
        self._door.sendall(marshal.dumps(described(SimulatedRobot(REHEARSAL))))
        try:
            self.has_seccomp = self._read_report() == 1
            for _ in range(REHEARSALS):
                self._rehearse()
        except (LostChildError, OSError):
            self.close()
            raise LostChildError("the zygote does not start") from None

    def fork(self) -> Child:
        """A fresh child.

        Raises:
            LostChildError: the zygote has ended.
        """
        if self._has_child:
            self._read_report()  # how the last one ended
        ours, theirs = socket.socketpair()
        try:
            with theirs:
                socket.send_fds(self._door, [b"x"], [theirs.fileno()])
            pid = self._read_report()
        except (LostChildError, OSError):
            ours.close()
            raise LostChildError("the zygote has ended") from None
        self._has_child = True
        return Child(pid, ours, self._end_of_child, closes=self.has_seccomp)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def kill(self) -> None:
        """End it and with it a run that is still going on."""
        self._process.kill()

    def close(self) -> None:
        """Give back all that it holds; nothing may be running."""
        self._process.kill()
        self._process.wait()
        os.close(self._report)
        self._door.close()

    def _rehearse(self) -> None:
        """Run an empty program: by then the heap of the zygote, which programs can see, has settled."""
        Conversation(self.fork(), EMPTY, SimulatedRobot(REHEARSAL), may_import=True).outcome()

    def _end_of_child(self) -> int:
        status = self._read_report()
        self._has_child = False
        return status

    def _read_report(self) -> int:
        data = os.read(self._report, NUMBER)
        if not data:
            raise LostChildError("the zygote has ended")
        return int.from_bytes(data, sys.byteorder, signed=True)
