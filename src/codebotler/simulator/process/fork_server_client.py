"""The engine's client of a fork server, which forks an isolated process for each run or batch."""

from __future__ import annotations

import contextlib
import marshal
import os
import socket
import subprocess
import sys
from io import FileIO
from pathlib import Path

from codebotler.core.world import Person, Room, World
from codebotler.simulator.batches.replay import message
from codebotler.simulator.process.errors import LostProcessError
from codebotler.simulator.process.isolated_process import IsolatedProcess, channel_pair
from codebotler.simulator.process.spawn import CHANNELS, start_fork_server, start_module
from codebotler.simulator.sandbox import HEADER, LIVE_RUN, SIMULATED_RUN, WITHOUT_REFERENCES
from codebotler.simulator.sandbox.fuel import prepared
from codebotler.simulator.skill_protocol import SkillProtocol, describe_skills
from codebotler.simulator.worlds.robot import SimulatedRobot

REPORT_BYTES = 8  # size of a reported number
EMPTY_PROGRAM = marshal.dumps(compile("task_program = int", "<program>", "exec"), WITHOUT_REFERENCES)
REHEARSALS = 8
BATCH_CODE = "from codebotler.simulator.batches.process import main; main(*sys.argv[1:])"

# Code typical of programs. The server of batches runs it first, so that children share specialized bytecode.
WARM_UP = Path(__file__).with_name("warm-up.txt").read_text()
WARM_UP_CODE = marshal.dumps(prepared(WARM_UP, lowercase=False)[0], WITHOUT_REFERENCES)
WARM_UP_WORLD = World((Room("hall"), Room("kitchen", ("mug",), (Person("ann", ("yes",)),))), "hall")
WARM_UP_RUNS = 20  # the interpreter specializes code that has run a few times


class ForkServer:
    """Starts a fork server: a process that forks an isolated child for each run, one at a time."""

    def __init__(self) -> None:
        ours, report = os.pipe()
        self._report = FileIO(ours)
        door, self._door = socket.socketpair()
        CHANNELS.update((self._door, self._report))
        try:
            with door:
                self._process = self._start(door.fileno(), report)
        except BaseException:
            self._report.close()
            self._door.close()
            raise
        finally:
            os.close(report)
        self._end_is_unread = False
        try:
            self._set_up()
        except (LostProcessError, OSError):
            self.close()
            raise LostProcessError("the fork server did not start; memory may have run out") from None
        except BaseException:  # such as an interrupt
            self.close()
            raise

    def _start(self, *descriptors: int) -> subprocess.Popen[bytes]:
        return start_fork_server(*descriptors)

    def fork(self, *, is_live: bool = False) -> IsolatedProcess:
        """Fork a child. If `is_live`, its program uses a live robot, and may take more processor time."""
        ours, theirs = channel_pair()
        try:
            with theirs:
                socket.send_fds(self._door, [LIVE_RUN if is_live else SIMULATED_RUN], [theirs.fileno()])
        except OSError:
            ours.close()
            raise LostProcessError("the fork server has ended; memory may have run out") from None
        return IsolatedProcess(self._pid_of_child, ours, self._end_of_child)

    @property
    def has_ended(self) -> bool:
        """Whether the fork server has ended."""
        return self._process.poll() is not None

    def kill(self) -> None:
        """Kill the fork server and its current run."""
        self._process.kill()

    def close(self) -> None:
        """Kill the fork server and close its descriptors. Call this only while nothing is running."""
        self._process.kill()
        self._process.wait()
        self._report.close()
        self._door.close()

    def _set_up(self) -> None:
        """Prepare the fork server, and learn whether its children will have a system call filter."""
        skills = describe_skills(SimulatedRobot(WARM_UP_WORLD))
        self._door.sendall(marshal.dumps(skills, WITHOUT_REFERENCES))
        self.has_seccomp = self._read_report() == 1
        for _ in range(REHEARSALS):  # until the heap, which programs can observe, is stable
            SkillProtocol(self.fork(), EMPTY_PROGRAM, SimulatedRobot(WARM_UP_WORLD)).outcome()

    def _pid_of_child(self) -> int:
        if self._end_is_unread:
            self._end_of_child()  # discards the exit status of the last child
        self._end_is_unread = True
        pid = self._read_report()
        if pid <= 1:  # a signal to such an id would reach a whole group of processes
            raise LostProcessError("the fork server reported an invalid process ID")
        return pid

    def _end_of_child(self) -> int:
        self._end_is_unread = False
        return self._read_report()

    def _read_report(self) -> int:
        data = self._report.read(REPORT_BYTES)
        if not data:
            raise LostProcessError("the fork server has ended; memory may have run out")
        return int.from_bytes(data, sys.byteorder, signed=True)


class BatchServer(ForkServer):
    """Starts a fork server for programs that may share a process. It forks each child in advance."""

    def __init__(self) -> None:
        self._next: IsolatedProcess | None = None
        super().__init__()

    def _start(self, *descriptors: int) -> subprocess.Popen[bytes]:
        return start_module(BATCH_CODE, (), descriptors)

    def fork(self, *, is_live: bool = False) -> IsolatedProcess:
        """Return the child that was forked in advance, or else a new one. `is_live` is False for batches."""
        child, self._next = self._next, None
        if child is not None and self.has_ended:  # another process may have the child's id now
            child.close_channel()
            child = None
        return child or super().fork(is_live=is_live)

    def fork_ahead(self) -> None:
        """Fork the next child in advance. Call this only after the previous child was killed."""
        with contextlib.suppress(LostProcessError):  # the next fork raises the error
            self._next = super().fork()

    def close(self) -> None:
        """Kill the fork server, and hang up on the child that was forked in advance."""
        super().close()
        if self._next is not None:
            self._next.close_channel()

    def _set_up(self) -> None:
        """Specialize the bytecode. The heap need not be stable, since tame programs cannot observe it."""
        rehearsal = message([(WARM_UP_CODE, [SimulatedRobot(WARM_UP_WORLD)])])
        setup = marshal.dumps((rehearsal, WARM_UP_RUNS), WITHOUT_REFERENCES)
        self._door.sendall(len(setup).to_bytes(HEADER, "big") + setup)
        self.has_seccomp = self._read_report() == 1
        self.fork_ahead()
