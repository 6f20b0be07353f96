"""A fork_server, seen from outside: forks a closed child whenever one is asked for."""

from __future__ import annotations

import marshal
import os
import socket
import sys

from codebotler.simulator.child import Child, LostChildError
from codebotler.simulator.isolated import start
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.sandbox import WITHOUT_REFERENCES
from codebotler.simulator.skill_protocol import SkillProtocol, described
from codebotler.simulator.warm_up import LESSONS, PLAY, STAGE

NUMBER = 8  # bytes of a number that it reports
REHEARSALS = 8
EMPTY = marshal.dumps(compile("task_program = int", "<program>", "exec"), WITHOUT_REFERENCES)


class ForkServer:
    """One fork server and the children it forks, one at a time.

    Args:
        role: of the three kinds of fork servers.

    Raises:
        LostChildError: it does not start.
    """

    def __init__(self, role: str) -> None:
        self._report, report = os.pipe()
        door, self._door = socket.socketpair()
        with door:
            self._process = start(role, door.fileno(), report)
        os.close(report)
        self._end_is_unread = False
        try:
            told = (described(SimulatedRobot(STAGE)), LESSONS)
            self._door.sendall(marshal.dumps(told, WITHOUT_REFERENCES))
            for _ in range(self._read_report()):
                self._teach()
            self.has_seccomp = self._read_report() == 1
            for _ in range(REHEARSALS):
                self._rehearse()
        except (LostChildError, OSError):
            self.close()
            raise LostChildError("the fork_server does not start") from None
        except BaseException:  # an interrupt
            self.close()
            raise

    def fork(self) -> Child:
        """A fresh child.

        Raises:
            LostChildError: the fork server has ended.
        """
        try:
            ours = self._ask_for_line()
        except OSError:
            raise LostChildError("the fork_server has ended") from None
        return Child(self._pid_of_child, ours, self._end_of_child, closes=self.has_seccomp)

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

    def forget(self) -> None:
        """Close its lines in a forked process, whose child it is not."""
        self._process.returncode = 0  # whatever becomes of it, nobody here waits for that
        os.close(self._report)
        self._door.close()

    def _teach(self) -> None:
        """Let the fork server itself run a program, so that its children have less to learn."""
        child = Child(lambda: self.pid, self._ask_for_line(), self._process.wait, closes=False)
        SkillProtocol(child, PLAY, SimulatedRobot(STAGE), may_import=True).talk()
        child.hang_up()

    def _rehearse(self) -> None:
        """Run an empty program: by then the heap of the fork server, which programs can see, has settled."""
        SkillProtocol(self.fork(), EMPTY, SimulatedRobot(STAGE), may_import=True).outcome()

    def _ask_for_line(self) -> socket.socket:
        ours, theirs = socket.socketpair()
        try:
            with theirs:
                socket.send_fds(self._door, [b"x"], [theirs.fileno()])
        except OSError:
            ours.close()
            raise
        return ours

    def _pid_of_child(self) -> int:
        if self._end_is_unread:
            self._end_of_child()  # of the last one, which nobody waited for
        self._end_is_unread = True
        pid = self._read_report()
        if pid <= 1:  # a signal to it would hit a whole group of processes
            raise LostChildError("the fork_server does not say which process it forked")
        return pid

    def _end_of_child(self) -> int:
        self._end_is_unread = False
        return self._read_report()

    def _read_report(self) -> int:
        data = os.read(self._report, NUMBER)
        if not data:
            raise LostChildError("the fork_server has ended")
        return int.from_bytes(data, sys.byteorder, signed=True)
