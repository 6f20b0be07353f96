"""Addresses of robots, so written that two which lead to the same robot are equal."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from contextlib import suppress
from ipaddress import ip_address
from urllib.parse import urlsplit

PORTS: Mapping[str, int] = {"ws": 80, "wss": 443, "http": 80, "https": 443}
"""Where each kind of server is if its address does not say so."""

HERE = "127.0.0.1"


def endpoint(address: str) -> str:
    """An address with its port, and without what makes no difference; what is no address stays as it is.

    All names of this machine become one. It is what a lock is called by; to connect, take what the user
    wrote, since a server may listen at one of these names only.

    Args:
        address: such as ws://robot:9090/ or http://localhost:11311.
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
    """A machine by one of its names; `host` is in small letters."""
    if host in {"localhost", socket.gethostname().lower()}:
        return HERE
    with suppress(ValueError):  # it is a name
        number = ip_address(host)
        number = getattr(number, "ipv4_mapped", None) or number
        return HERE if number.is_loopback or number.is_unspecified else number.compressed
    return host
