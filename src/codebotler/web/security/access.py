"""Control access to the page by tokens, roles, cookies, hosts and addresses."""

from __future__ import annotations

import errno
import hashlib
import hmac
import ipaddress
import os
import secrets
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from tempfile import NamedTemporaryFile

from codebotler.core.errors import UserError
from codebotler.core.files import make_folder
from codebotler.web.security.proxy import OuterAddress

MAX_WRONG_TOKENS, WRONG_TOKEN_SECONDS = 10, 60.0
"""The number of invalid tokens accepted from one address per period, and the period in seconds."""

MAX_ADDRESSES = 10_000
MIN_TOKEN_LENGTH = 16
SECRET_BYTES = 32
LOCAL_HOST_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
PAGE_PORTS = range(8080, 8100)
AGENT_PATH = "/mcp"
"""The path at which agents use the Model Context Protocol."""
_LISTEN_BACKLOG = 128  # connections


class Role(StrEnum):
    """The role of a visitor: an operator may do everything, a face may only answer questions and stop.

    An agent may only use `AGENT_PATH`, so that it cannot approve its own missions over the API.
    """

    OPERATOR = "operator"
    FACE = "face"
    AGENT = "agent"


class TooManyTriesError(Exception):
    """Raised if an address has sent too many invalid tokens. The address must wait for up to a minute."""


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Access:
    """Maps tokens and cookies to roles, and limits the number of invalid tokens per address."""

    operator: str | None = field(default_factory=new_token)  # None if operators need no token
    face: str = field(default_factory=new_token)
    agent: str = field(default_factory=new_token)
    unguessable: frozenset[Role] = frozenset()  # roles with random tokens, for which there is no limit
    now: Callable[[], float] = time.monotonic
    cookie_secret: bytes = field(default_factory=lambda: secrets.token_bytes(SECRET_BYTES))
    _wrong: dict[str, deque[float]] = field(default_factory=dict)
    _start: str = field(default_factory=new_token)  # of this process

    @classmethod
    def from_options(
        cls,
        operator: str | None,
        face: str | None = None,
        agent: str | None = None,
        *,
        open_to_all: bool = False,
        is_private: bool = True,
    ) -> Access:
        """Create an Access with these tokens, or random ones for None. Raise UserError if that is unsafe.

        With `open_to_all`, operators need no token. This requires `is_private`: only this machine has access.
        """
        options = {Role.OPERATOR: operator, Role.FACE: face, Role.AGENT: agent}
        given = [token for token in options.values() if token is not None]
        if open_to_all and (any(given) or not is_private):
            raise UserError("--no-token cannot be combined with --host, --behind-proxy or your own tokens")
        if any(len(token) < MIN_TOKEN_LENGTH for token in given):
            raise UserError(f"a token is too short; use at least {MIN_TOKEN_LENGTH} characters")
        if len({*given}) < len(given):
            raise UserError("two roles have the same token; choose another token for one of them")
        unguessable = frozenset(role for role, token in options.items() if token is None)
        of_operators = None if open_to_all else operator or new_token()
        return cls(of_operators, face or new_token(), agent or new_token(), unguessable)

    def of_token(self, token: str, address: str) -> Role | None:
        """Return a token's role, or None. Raise TooManyTriesError if `address` has sent many invalid ones."""
        role = self._of(token, lambda _, known: known)
        if role in self.unguessable:
            return role
        wrong = self._wrong.get(address, deque(maxlen=MAX_WRONG_TOKENS))
        while wrong and wrong[0] <= self.now() - WRONG_TOKEN_SECONDS:
            wrong.popleft()
        if len(wrong) >= MAX_WRONG_TOKENS:
            raise TooManyTriesError
        if role is None:
            if address not in self._wrong and len(self._wrong) >= MAX_ADDRESSES:
                self._wrong.pop(next(iter(self._wrong)))
            self._wrong.setdefault(address, wrong).append(self.now())
        return role

    def of_cookie(self, value: str) -> Role | None:
        """Return the role for a cookie, or None if the cookie is invalid."""
        return self._of(value, self._cookie)

    def cookie(self, role: Role) -> str:
        """Return a role's cookie, from which the token cannot be derived."""
        return self._cookie(role, self._tokens[role] or "")

    @property
    def path(self) -> str:
        """The page's secret path prefix. Cookies are limited to it, so servers on other ports get none."""
        return f"/{self._cookie_value('path')[:SECRET_BYTES]}"

    def _cookie(self, role: Role, token: str) -> str:
        # After the end of this process, others may take its port, and open pages send them their cookies.
        return self._cookie_value(token if role is Role.FACE else f"{token} {self._start}")

    def _cookie_value(self, token: str) -> str:
        return hmac.new(self.cookie_secret, token.encode(), hashlib.sha256).hexdigest()

    @property
    def _tokens(self) -> Mapping[Role, str | None]:
        return {Role.OPERATOR: self.operator, Role.FACE: self.face, Role.AGENT: self.agent}

    def _of(self, shown: str, form: Callable[[Role, str], str]) -> Role | None:
        for role, token in self._tokens.items():
            if token and hmac.compare_digest(form(role, token).encode(), shown.encode(errors="replace")):
                return role
        return None


def read_cookie_secret(home: Path) -> bytes:
    """Return the secret from which cookies are made. The first call creates and stores it.

    Raises:
        UserError: the file is damaged.
        OSError: the folder cannot be written.
    """
    make_folder(home)
    file = home / "cookie-secret"
    if not file.exists():
        with NamedTemporaryFile(dir=home) as new, suppress(FileExistsError):
            new.write(secrets.token_bytes(SECRET_BYTES))
            new.flush()
            os.link(new.name, file)  # whole at once, since another process may start, too
    secret = file.read_bytes()
    if len(secret) != SECRET_BYTES:
        raise UserError("this file does not contain a valid cookie secret; remove the file", file=file)
    return secret


@dataclass(frozen=True)
class PageAddress:
    """Where to serve the page: host and port, other host names, and addresses at reverse proxies."""

    host: str = "127.0.0.1"
    port: int | None = None  # 0 for any free port, None for the first free port of `PAGE_PORTS`
    names: tuple[str, ...] = ()  # additional host names
    proxies: tuple[OuterAddress, ...] = ()  # the page's addresses at reverse proxies

    @property
    def is_loopback(self) -> bool:
        """Whether the server listens only on a loopback interface."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host in LOCAL_HOST_NAMES

    @property
    def is_private(self) -> bool:
        """Whether no other machine can reach the page, even through a proxy."""
        return self.is_loopback and not self.proxies

    def listen(self) -> socket.socket:
        """Open a socket that listens at this address. Raise UserError if that fails."""
        ports = PAGE_PORTS if self.port is None else (self.port,)
        for port in ports:
            try:
                return self._bind(port)
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    why = str(error.strerror).partition(" (")[0]  # without the address once more
                    raise UserError(f"cannot listen on {self.host}, port {port}: {why}") from None
        raise UserError(f"port {ports[-1]} is already in use; choose another --port")

    def _bind(self, port: int) -> socket.socket:
        family, *_, address = socket.getaddrinfo(
            self.host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        both = family is socket.AF_INET6 and socket.has_dualstack_ipv6()  # `::` also means IPv4
        return socket.create_server(address, family=family, backlog=_LISTEN_BACKLOG, dualstack_ipv6=both)

    @property
    def hosts(self) -> frozenset[str]:
        """The host names that a Host header may have, in lower case and without ports."""
        named = {name.lower() for name in (self.host, *self.names)} | {one.name for one in self.proxies}
        return LOCAL_HOST_NAMES | named | (set() if self.is_loopback else {socket.gethostname().lower()})
