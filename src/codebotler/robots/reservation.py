"""Lock a robot so that only one process on this machine uses it at a time."""

from __future__ import annotations

import fcntl
import os
import socket
import stat
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from datetime import datetime
from hashlib import sha256
from ipaddress import ip_address
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

from codebotler.core.files import make_folder
from codebotler.robots.base import NotReadyError, Robot

DEFAULT_PORTS = {"ws": 80, "wss": 443, "http": 80, "https": 443}
LOOPBACK_ADDRESS, LOCKS_IN = "127.0.0.1", Path("/tmp")  # noqa: S108 - a private folder there


class Reservation:
    """A context manager that locks and connects a robot, and disconnects and unlocks it at the end.

    For a robot with an address, the lock excludes all other processes of this user on this machine. Without
    an address, it excludes missions in the same folder. The lock ends with this process at the latest.

    Args:
        robot: the robot, not yet connected.
        home: the folder that contains the missions.
        on_lock: a function to call once the robot is locked, before it is connected.

    Raises:
        NotReadyError: another process uses the robot, connecting fails, or other users can change the locks.
        OSError: the lock file cannot be written.
    """

    def __init__(self, robot: Robot, home: Path, on_lock: Callable[[], object] = bool) -> None:
        self.robot, self._home, self._on_lock = robot, home, on_lock
        self._lock = -1
        self._is_used = threading.Lock()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._lock = os.open(self._path(), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
            stack.callback(os.close, self._lock)
            self._take()
            stack.callback(self.robot.disconnect)
            self._on_lock()
            self.robot.connect()
            self._at_end = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._at_end.close()

    def use(self) -> None:
        """Claim this connection for a mission, or raise NotReadyError if a mission has already used it."""
        if not self._is_used.acquire(blocking=False):
            raise NotReadyError(f"the robot {self.robot.name} has already run a mission; connect it again")

    def holder(self) -> str:
        """Return who has locked the robot, such as `process 417, since 10:02:11`, or "" if nobody has."""
        with suppress(OSError, NotReadyError), self._path().open("rb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return file.read(1_000).decode(errors="replace")
        return ""

    def _path(self) -> Path:
        if self.robot.address:
            return robot_file(self.robot.name, self.robot.address, "lock")
        folder = self._home / "robots"
        make_folder(folder)
        return folder / f"{self.robot.name}.lock"

    def _take(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(self._lock, 1_000, 0).decode(errors="replace") or "just started"
            why = f"another tool ({holder}) has a mission open with the robot {self.robot.name}"
            raise NotReadyError(f"{why}; wait until that mission has ended, or stop it there") from None
        os.truncate(self._lock, 0)
        holder = f"process {os.getpid()}, since {datetime.now().astimezone():%H:%M:%S}"
        os.pwrite(self._lock, holder.encode(), 0)


def robot_file(robot: str, address: str, kind: str) -> Path:
    """Return the path of this user's file for the robot at `address`. `kind` is a suffix such as `lock`."""
    digest = sha256(normalize_address(address).encode(errors="surrogatepass")).hexdigest()
    return lock_folder() / f"{robot} {digest}.{kind}"


def lock_folder() -> Path:
    """Return this user's lock folder, created if missing. Raise NotReadyError if others can write to it."""
    # No variable chooses it, since clients of agents start their servers without those of a shell, and it is
    # not below /run/user, which begins and ends with logins.
    folder = LOCKS_IN / f"codebotler-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    if not _is_ours(folder):
        needed = "must be a folder that only you can write to"
        raise NotReadyError(f"{folder}, which holds robot locks, {needed}; remove it")
    return folder


def _is_ours(folder: Path) -> bool:
    """Return whether a path is a folder (not a link) of this user that nobody else can write to."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    is_private = not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and is_private


def normalize_address(address: str) -> str:
    """Return an address in a comparable form: with a port, a lower-case host, and no user or final slash.

    Names of this machine become 127.0.0.1, and invalid addresses stay unchanged. Connect to the original
    address, since a server may listen on only one of its machine's names.
    """
    try:
        parts = urlsplit(address.strip())
        host, port = parts.hostname, parts.port
    except ValueError:  # for an invalid port or an unmatched bracket
        return address
    if not host or parts.scheme not in DEFAULT_PORTS:
        return address
    host = _normalize_host(host.rstrip("."))
    host = f"[{host}]" if ":" in host else host
    path = parts.path.rstrip("/") + (f"?{parts.query}" if parts.query else "")
    return f"{parts.scheme}://{host}:{port or DEFAULT_PORTS[parts.scheme]}{path}"


def _normalize_host(host: str) -> str:
    if host in {"localhost", socket.gethostname().lower()}:
        return LOOPBACK_ADDRESS
    with suppress(ValueError):  # a host name is not an IP address
        number = ip_address(host)
        number = getattr(number, "ipv4_mapped", None) or number
        return LOOPBACK_ADDRESS if number.is_loopback or number.is_unspecified else number.compressed
    return host
