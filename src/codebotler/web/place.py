"""Where the page is: an address, a port, and the names by which it may be called."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence
from dataclasses import dataclass

from codebotler.core.errors import UserError
from codebotler.web.access import Access
from codebotler.web.guard import LOOPBACK, Rules

WAITING = 128
"""So many may wait to be let in."""


@dataclass(frozen=True)
class Place:
    """Where the page is.

    Args:
        host: the address that is listened on.
        port: from 0, which takes a free one.
        names: under which it may be called besides.

    Raises:
        UserError: nobody can listen there.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    names: tuple[str, ...] = ()

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine gets there."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host in LOOPBACK

    def listening(self) -> socket.socket:
        """A socket that is open there."""
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(
                self.host, self.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            bound = socket.socket(family, kind, protocol)
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            bound.bind(address)
            bound.listen(WAITING)  # whoever opens the link at once waits, and is not turned away
        except OSError as error:
            raise UserError(
                f"nobody can listen on {self.host}, port {self.port}: {error.strerror}; "
                "choose another --port, or --host"
            ) from None
        return bound

    def rules(self, access: Access, port: int) -> Rules:
        """Whom the guard lets in."""
        named = {name.lower() for name in (self.host, *self.names)}
        hosts = LOOPBACK | named | (set() if self.is_loopback else {socket.gethostname().lower()})
        return Rules(access, frozenset(hosts), not self.is_loopback, f"codebotler-{port}")


def entrance(
    host: str, port: int, names: Sequence[str], token: str | None, face: str | None = None, *, no_token: bool
) -> tuple[Place, Access]:
    """Where a page is and who may open it, as somebody asked for it.

    Args:
        host: the address to listen on.
        port: the port, from 0, which takes a free one.
        names: under which the page may be called besides.
        token: that opens it; a new one by default.
        face: the token that opens a robot's face; a new one by default.
        no_token: whether everybody on this machine may open it.

    Raises:
        UserError: more people than that would get in.
    """
    place = Place(host, port, tuple(names))
    return place, Access.asked_for(token, face, open_to_all=no_token, is_loopback=place.is_loopback)
