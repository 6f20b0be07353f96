"""A lock that keeps a robot for one mission at a time, also from other tools on this machine."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import stat
import threading
from contextlib import suppress
from datetime import datetime
from hashlib import sha256
from ipaddress import ip_address
from pathlib import Path
from tempfile import gettempdir
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

from codebotler.core.files import make_folder
from codebotler.robots.base import NotReadyError, Robot

PORTS = {"ws": 80, "wss": 443, "http": 80, "https": 443}
HERE = "127.0.0.1"


class Reservation:
    """A context manager that locks a robot and connects it.

    The lock ends with this process, however that ends. A robot with an address is locked for all tools of
    this user on this machine; one without is locked for the missions of one home.

    Args:
        robot: not yet connected.
        home: the folder of missions.

    Raises:
        NotReadyError: another tool uses the robot, it cannot be connected, or others can write locks.
        OSError: the lock cannot be written.
    """

    def __init__(self, robot: Robot, home: Path) -> None:
        self.robot, self._home = robot, home
        self._lock = -1
        self._is_used = threading.Lock()

    def __enter__(self) -> Self:
        self._lock = os.open(self._path(), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
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
        """Take the robot for a mission; it has to be connected again for the next one.

        Raises:
            NotReadyError: it was taken before.
        """
        if not self._is_used.acquire(blocking=False):
            raise NotReadyError(
                f"the robot {self.robot.name} has already run another mission; connect it again"
            )

    def _path(self) -> Path:
        if self.robot.address:
            return file_of(self.robot.name, self.robot.address, "lock")
        folder = self._home / "robots"
        make_folder(folder)
        return folder / f"{self.robot.name}.lock"

    def _take(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise NotReadyError(
                f"{self._holder()} is using the robot {self.robot.name}; wait until its mission has ended, "
                "or stop it there"
            ) from None
        holder = {"process": os.getpid(), "since": f"{datetime.now().astimezone():%H:%M:%S}"}
        os.truncate(self._lock, 0)
        os.pwrite(self._lock, json.dumps(holder).encode(), 0)

    def _holder(self) -> str:
        try:
            holder = json.loads(os.pread(self._lock, 1_000, 0))
            return f"another tool (process {holder['process']}, since {holder['since']})"
        except ValueError:  # it is being written
            return "another tool"


def file_of(robot: str, address: str, kind: str) -> Path:
    """A file of this user on this machine about the robot at an address.

    Raises:
        NotReadyError: others could write there.
        OSError: its folder cannot be created.
    """
    digest = sha256(endpoint(address).encode(errors="surrogatepass")).hexdigest()
    return lock_folder() / f"{robot} {digest}.{kind}"


def lock_folder() -> Path:
    """The folder of this user's locks on this machine, created if necessary.

    Raises:
        NotReadyError: others could write there.
        OSError: it cannot be created.
    """
    runtime = Path(os.environ.get("XDG_RUNTIME_DIR", ""))
    is_usable = runtime.is_absolute() and _is_ours(runtime)  # with `sudo` it may be the caller's
    folder = runtime / "codebotler" if is_usable else Path(gettempdir()) / f"codebotler-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    if not _is_ours(folder):
        raise NotReadyError(
            f"{folder} holds the locks of robots, but is not a folder that only you can write to; remove it"
        )
    return folder


def _is_ours(folder: Path) -> bool:
    """Whether it is a real folder of this user in which nobody else can write."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    is_closed = not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and is_closed


def endpoint(address: str) -> str:
    """An address with its port, and without user, capitals and trailing slashes.

    All names of this machine become one, and text that is no address stays as it is. Connect to what the user
    wrote, since a server may listen at only one name of its machine.
    """
    try:
        parts = urlsplit(address.strip())
        host, port = parts.hostname, parts.port
    except ValueError:  # the port is no number, or a bracket is open
        return address
    if not host or parts.scheme not in PORTS:
        return address
    where = _machine(host.rstrip("."))
    where = f"[{where}]" if ":" in where else where
    path = parts.path.rstrip("/") + (f"?{parts.query}" if parts.query else "")
    return f"{parts.scheme}://{where}:{port or PORTS[parts.scheme]}{path}"


def _machine(host: str) -> str:
    if host in {"localhost", socket.gethostname().lower()}:
        return HERE
    with suppress(ValueError):  # it is a name
        number = ip_address(host)
        number = getattr(number, "ipv4_mapped", None) or number
        return HERE if number.is_loopback or number.is_unspecified else number.compressed
    return host
