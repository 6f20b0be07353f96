"""Keeps a robot for one mission at a time, also from the other tools on this machine."""

from __future__ import annotations

import fcntl
import json
import os
import stat
import threading
from contextlib import suppress
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from tempfile import gettempdir
from types import TracebackType
from typing import Self
from urllib.parse import quote

from codebotler.core.files import make_folder
from codebotler.robots.base import NotReadyError, Robot

LONGEST = 200  # characters of the name of a lock; no file system takes more than 255


class Reservation:
    """A connected robot that nobody else uses; as a context manager, from entering to leaving.

    The lock belongs to this process: it ends with it, however that ends. A robot with an address is kept from
    all tools of this user on this machine; one without is kept for the missions of one home.

    Args:
        robot: not yet connected.
        home: the folder of missions, where the lock of a robot without an address lies.

    Raises:
        NotReadyError: another tool uses the robot, it cannot be connected, or locks could be tampered with.
        OSError: the lock cannot be written.
    """

    def __init__(self, robot: Robot, home: Path) -> None:
        self.robot, self._home = robot, home
        self._lock = -1
        self._is_used = threading.Lock()

    def __enter__(self) -> Self:
        path = self._folder() / f"{self._name()}.lock"
        self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
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

    def _folder(self) -> Path:
        if self.robot.address:
            return machine_wide()
        folder = self._home / "robots"
        make_folder(folder)
        return folder

    def _name(self) -> str:
        name = quote(f"{self.robot.name} {self.robot.address}".strip(), safe=" ", errors="surrogatepass")
        if len(name) <= LONGEST:
            return name
        return f"{self.robot.name} {sha256(name.encode()).hexdigest()}"

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


def machine_wide() -> Path:
    """The folder of this user's locks on this machine, made if it is not there.

    Raises:
        NotReadyError: what is there is not ours alone.
        OSError: it cannot be made.
    """
    runtime = Path(os.environ.get("XDG_RUNTIME_DIR", ""))
    is_usable = runtime.is_absolute() and _is_ours(runtime)  # it may be that of whoever called `sudo`
    folder = runtime / "codebotler" if is_usable else Path(gettempdir()) / f"codebotler-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    if not _is_ours(folder):
        raise NotReadyError(
            f"{folder} keeps robots from being used by two tools, but it is no folder that only you can "
            "write in; remove it"
        )
    return folder


def _is_ours(folder: Path) -> bool:
    """Whether it is a folder and no link, it is this user's, and nobody else can write there."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    is_closed = not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and is_closed
