"""Where the Ray cluster is that RAY_ADDRESS names, and whether it answers; Ray would ask it for minutes."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

from codebotler.badinput import BadInput
from codebotler.terminal import busy

LOCAL = "local"
"""In RAY_ADDRESS, a cluster that is started here, also where this machine is part of one."""

ADDRESS = re.compile(r"(?P<host>\[[^\[\]\s/]+\]|[^:\[\]\s/]+):(?P<port>[0-9]{1,5})", re.ASCII)
LAST_PORT = 65535
PATIENCE_S = 5  # until something must have taken a connection
PING_PATIENCE_S = 40  # until a cluster must have answered Ray, which a busy machine must load before

OR_LOCAL = f"or set RAY_ADDRESS={LOCAL} to use the cores of this machine"
START = f"start its head with `ray start --head`, {OR_LOCAL}"
TOKEN = "set RAY_AUTH_MODE=token, and RAY_AUTH_TOKEN unless the token is in ~/.ray/auth_token"  # noqa: S105


def named_address() -> str:
    """What RAY_ADDRESS says; empty where it leaves it to Ray to find a cluster."""
    address = os.environ.get("RAY_ADDRESS", "")
    return "" if address == "auto" else address


def is_here_only() -> bool:
    """Whether the cluster is one that only this machine reaches, or one that is yet to be started."""
    if address := named_address():
        return address == LOCAL or address.startswith(("127.", "localhost:", "[::1]"))
    return not _current().exists()


def expect_cluster() -> None:
    """Refuse an address at which no Ray cluster answers; Ray is installed.

    Raises:
        BadInput: RAY_ADDRESS is no address, no Ray cluster answers there or where Ray remembers one, or it
            lets nobody in without its token or from this machine.
    """
    address = named_address()
    if address == LOCAL or (not address and not _current().exists()):
        return
    if address:
        expect_listener(address)
    with busy("asking the Ray cluster"):
        answer = ping()
    if answer == SILENT:
        raise BadInput(_silence(address))
    if answer == LOCKED and address:
        raise BadInput(f"RAY_ADDRESS: the Ray cluster at {address} wants its token: {TOKEN}")
    if answer == OUTSIDE and address:
        raise outside(address)


def outside(address: str) -> BadInput:
    """The error that this machine is no part of a cluster, from which alone Ray takes work.

    Args:
        address: of the cluster.
    """
    joins = f"join it with `ray start --address={address}`"
    return BadInput(f"RAY_ADDRESS: this machine is no node of the Ray cluster at {address}; {joins}")


def expect_listener(address: str) -> None:
    """Refuse what is no address of a machine and a port, or one where nothing takes a connection.

    Args:
        address: as it stands in RAY_ADDRESS.

    Raises:
        BadInput: it is none, or nothing listens there.
    """
    found = ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) <= LAST_PORT:
        client = "Ray Client is not supported; " if address.startswith("ray://") else ""
        sentence = (
            f'"{address}" is no address of a Ray cluster: {client}write HOST:PORT, such as 10.0.0.5:6379'
        )
        raise BadInput(f"RAY_ADDRESS: {sentence}, {OR_LOCAL}")
    try:
        socket.create_connection((found["host"].strip("[]"), int(found["port"])), PATIENCE_S).close()
    except (OSError, UnicodeError) as error:  # the latter is of names that are none
        why = getattr(error, "strerror", None) or str(error)
        raise BadInput(f"RAY_ADDRESS: there is no Ray cluster at {address} ({why}); {START}") from None


# --- asking

LOCKED, SILENT, OUTSIDE = 3, 4, 5

PING = f"""
import sys
from ray._private.services import canonicalize_bootstrap_address, find_node_ids
from ray._raylet import GcsClient
from ray.exceptions import AuthenticationError, RpcError
try:
    GcsClient(address=canonicalize_bootstrap_address("auto"))
except AuthenticationError:
    sys.exit({LOCKED})
except RpcError:
    sys.exit({SILENT})
sys.exit(0 if find_node_ids() else {OUTSIDE})
"""
"""Asks the cluster that Ray would connect to for its name; anything unforeseen is left to Ray to tell."""


def ping() -> int:
    """Have Ray's own client ask the cluster, in a process that can be ended, as this one could not be."""
    command = [sys.executable, "-P", "-c", PING]
    none = subprocess.DEVNULL  # Ray warns of each attempt
    try:
        return subprocess.run(  # noqa: S603 - our own words
            command, stdin=none, stdout=none, stderr=none, timeout=PING_PATIENCE_S, check=False
        ).returncode
    except subprocess.TimeoutExpired:
        return SILENT


def _silence(address: str) -> str:
    if address:
        return f"RAY_ADDRESS: what listens at {address} does not answer as a Ray cluster; {START}"
    sentence = (
        f"the Ray cluster of this machine does not answer; `ray stop` ends what is left of it, {OR_LOCAL}"
    )
    return f"{_current()}: {sentence}"


def _current() -> Path:
    """Ray's note of the cluster that this machine is part of."""
    return Path(os.environ.get("RAY_TMPDIR", "/tmp"), "ray", "ray_current_cluster")  # noqa: S108 - Ray's own
