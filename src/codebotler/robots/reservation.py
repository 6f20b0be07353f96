"""Keeps a robot for one mission at a time, also from the other tools on this machine."""

from __future__ import annotations

import fcntl
import json
import os
import threading
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import quote

from codebotler.robots.base import NotReadyError, Robot


class Reservation:
    """A connected robot that nobody else uses; as a context manager, from entering to leaving.

    The lock belongs to this process: it ends with it, however that ends.

    Args:
        robot: not yet connected.
        home: the folder of missions, where the lock lies.

    Raises:
        NotReadyError: another tool uses the robot, or it cannot be connected.
        OSError: the lock cannot be written.
    """

    def __init__(self, robot: Robot, home: Path) -> None:
        self.robot = robot
        name = f"{robot.name} {robot.address}".strip()
        self._path = home / "robots" / f"{quote(name, safe=' ')}.lock"
        self._lock = -1
        self._is_used = threading.Lock()

    def __enter__(self) -> Self:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            self._take()
            try:
                self.robot.connect()
            except BaseException:
                self.robot.disconnect()
                raise
        except BaseException:
            os.close(self._lock)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.robot.disconnect()
        finally:
            os.close(self._lock)

    def use(self) -> None:
        """Take the robot for a mission, the only one: after its end the robot has to be connected again.

        Raises:
            NotReadyError: it was taken before.
        """
        if not self._is_used.acquire(blocking=False):
            raise NotReadyError(
                f"the robot {self.robot.name} is on another mission, or was; connect it again"
            )

    def _take(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise NotReadyError(
                f"{self._holder()} uses the robot {self.robot.name}; wait until its mission has ended, "
                "or stop it there"
            ) from None
        mine = {"process": os.getpid(), "since": f"{datetime.now().astimezone():%H:%M:%S}"}
        os.truncate(self._lock, 0)
        os.pwrite(self._lock, json.dumps(mine).encode(), 0)

    def _holder(self) -> str:
        try:
            said = json.loads(os.pread(self._lock, 1_000, 0))
            return f"another tool (process {said['process']}, since {said['since']})"
        except (ValueError, KeyError, TypeError):  # it is just writing that
            return "another tool"
