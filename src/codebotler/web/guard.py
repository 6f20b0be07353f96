"""Stands before the page and its API, the websocket included: hosts, origins, tokens, sizes, headers."""

from __future__ import annotations

import ipaddress
import json
import re
import secrets
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from posixpath import normpath
from typing import Any, TypeAlias
from urllib.parse import parse_qsl, quote, urlencode

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from codebotler.web.access import Access, Role, TooManyTriesError

MOST_BYTES = 2_000_000
"""Of a request's body."""

CHANGES_NOTHING = frozenset({"GET", "HEAD", "OPTIONS"})
FOR_FACES = ("/face", "/api/face", "/static", "/favicon.ico")
"""Where a face may go: not to NiceGUI's websocket, which takes messages for any page by its number."""

LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})

POLICY = (
    "default-src 'none'; script-src 'self' 'nonce-{nonce}' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; font-src 'self'; connect-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
"""`unsafe-eval` and inline styles are what NiceGUI needs: Vue builds its templates and handlers in the
browser, Quasar and CodeMirror write styles. No inline script runs but those that bear this answer's nonce."""

HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), payment=(), usb=(), microphone=(self)",
}
HOST = re.compile(r"(?:([a-z0-9._-]+)|\[([0-9a-f:.]+)\])(?::(\d{1,5}))?")
"""A name or an address, and perhaps a port: any, since a tunnel or a proxy in front has one of its own."""

MOST_PORT = 65_535
CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
NO_CONTROL = "there is no such page, and no address of ours has control characters"
SCRIPT = re.compile(rb"<script(?=[\s>])")
Headers: TypeAlias = Mapping[str, str]


@dataclass(frozen=True)
class Rules:
    """Whom the guard lets in.

    Args:
        access: knows the tokens.
        hosts: names by which the page may be called, without ports.
        any_address: whether numeric addresses of this machine will do besides, as from other machines.
        cookie: its name; that of another port is another one.
    """

    access: Access
    hosts: frozenset[str] = LOOPBACK
    any_address: bool = False
    cookie: str = "codebotler"


class RefusedError(Exception):
    """A request that is not answered.

    Args:
        status: of HTTP.
        sentence: why, and the mend.
    """

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(sentence)
        self.status, self.sentence = status, sentence

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.status, self.sentence), vars(self)


class Guard:
    """ASGI in front of ASGI.

    Args:
        app: what is behind it.
        rules: whom it lets in.
        has_page: whether anything is at a path, such as a page to which a link with a token may lead.
    """

    def __init__(self, app: ASGIApp, rules: Rules, has_page: Callable[[str], bool]) -> None:
        self._app, self._rules, self._has_page = app, rules, has_page

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        headers = {
            name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
        }
        try:
            self._expect_path(scope["path"])
            self._expect_host(scope)
            self._expect_origin(scope, headers)
            token = _given_token(scope)
            if token is not None and scope["type"] == "http":
                await self._let_in(token, scope, send)
                return
            role = self._role(scope, headers)
            _expect_allowed(role, scope["path"])
            _expect_small(headers)
        except RefusedError as error:
            await _refuse(scope, headers, error, receive, send)
            return
        scope.setdefault("state", {})["role"] = role
        if scope["type"] == "http":
            body = _Body(receive)
            await self._app(scope, body.receive, body.unless_too_large(_with_headers(send)))
        else:
            await self._app(scope, receive, send)

    # --- where to

    def _expect_path(self, path: str) -> None:
        """Control characters stand in names that people gave, which pages look up, and nowhere else."""
        if CONTROL.search(path) and not self._has_page(path):
            raise RefusedError(HTTPStatus.BAD_REQUEST, NO_CONTROL)

    # --- from where

    def _expect_host(self, scope: Scope) -> None:
        """A page of somebody else's whose name leads here (DNS rebinding) calls us by that name."""
        name = _host(scope)
        if name in self._rules.hosts or (self._rules.any_address and _is_address(name)):
            return
        raise RefusedError(
            HTTPStatus.MISDIRECTED_REQUEST,
            "this page does not go by that name; use the link that codebotler serve printed",
        )

    def _expect_origin(self, scope: Scope, headers: Headers) -> None:
        """A page of somebody else's may neither change anything nor listen."""
        origin, site = headers.get("origin"), headers.get("sec-fetch-site")
        changes = scope["type"] == "websocket" or scope["method"] not in CHANGES_NOTHING
        if origin is not None and not _is_same(origin, headers.get("host", ""), scope):
            raise RefusedError(HTTPStatus.FORBIDDEN, "this came from another page, which may not do that")
        from_browser = "cookie" in headers or scope["type"] == "websocket"
        if changes and origin is None and from_browser and "authorization" not in headers:
            raise RefusedError(HTTPStatus.FORBIDDEN, "a browser has to say from which page this comes")
        navigates = headers.get("sec-fetch-mode") == "navigate"
        if site in {"cross-site", "same-site"} and not navigates:
            raise RefusedError(HTTPStatus.FORBIDDEN, "this came from another page, which may not do that")

    # --- who

    def _role(self, scope: Scope, headers: Headers) -> Role | None:
        access = self._rules.access
        kind, _, given = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and given:
            role = self._of_token(given.strip(), scope)
            if role is None:
                raise RefusedError(HTTPStatus.UNAUTHORIZED, "this is not the token")
            return role
        role = access.of_cookie(_cookie(headers, self._rules.cookie))
        return Role.OPERATOR if role is None and access.operator is None else role

    def _of_token(self, token: str, scope: Scope) -> Role | None:
        try:
            return self._rules.access.of_token(token, (scope.get("client") or ("",))[0])
        except TooManyTriesError:
            raise RefusedError(
                HTTPStatus.TOO_MANY_REQUESTS, "too many wrong tokens came from there; wait a minute"
            ) from None

    async def _let_in(self, token: str, scope: Scope, send: Send) -> None:
        """Change a token in the link for a cookie, so that it stands in no history."""
        role = self._of_token(token, scope)
        if role is None and self._rules.access.operator is not None:
            raise RefusedError(HTTPStatus.UNAUTHORIZED, "this is not the token")
        rest = [(name, value) for name, value in _query(scope) if name != "token"]
        path = "/" + scope["path"].strip("/")  # two slashes would begin the name of another host
        if CONTROL.search(path):
            raise RefusedError(HTTPStatus.BAD_REQUEST, NO_CONTROL)
        if normpath(path) != path or not self._has_page(path):  # browsers follow ".."
            raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such page")
        where = quote(path) + (f"?{urlencode(rest)}" if rest else "")
        headers = {**HEADERS, "location": where, "cache-control": "no-store"}
        if role is not None:
            cookie = f"{self._rules.cookie}={self._rules.access.cookie(role)}"
            headers["set-cookie"] = f"{cookie}; Path=/; HttpOnly; SameSite=Strict"
        await _answer(send, HTTPStatus.SEE_OTHER, headers)


def _host(scope: Scope) -> str:
    """The name by which we are called."""
    told = [value.decode("latin-1").lower() for name, value in scope["headers"] if name.lower() == b"host"]
    found = HOST.fullmatch(told[0]) if len(told) == 1 else None
    if found is None or not 0 < int(found[3] or 80) <= MOST_PORT:
        raise RefusedError(
            HTTPStatus.BAD_REQUEST, "the header Host must stand there once, with a name and a port"
        )
    return found[1] or found[2]


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_same(origin: str, host: str, scope: Scope) -> bool:
    secure = scope["scheme"] in {"https", "wss"}
    return origin.lower() == f"http{'s' if secure else ''}://{host.lower()}"


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True)


def _given_token(scope: Scope) -> str | None:
    """The token in the link, for pages only."""
    if scope["path"].startswith(("/api/", "/_nicegui")):
        return None
    return next((value for name, value in _query(scope) if name == "token"), None)


def _cookie(headers: Headers, name: str) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _expect_allowed(role: Role | None, path: str) -> None:
    if role is None:
        raise RefusedError(
            HTTPStatus.UNAUTHORIZED, "open the link that codebotler serve printed; it has the token"
        )
    if role is Role.FACE and not any(path == place or path.startswith(f"{place}/") for place in FOR_FACES):
        raise RefusedError(HTTPStatus.FORBIDDEN, "this link is for the robot's face; it opens nothing else")


TOO_LARGE = f"at most {MOST_BYTES:,} bytes are taken"


def _expect_small(headers: Headers) -> None:
    told = headers.get("content-length", "0")
    if not told.isascii() or not told.isdigit() or int(told) > MOST_BYTES:
        raise RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, TOO_LARGE)


class _Body:
    """A request's body, up to what is taken; who does not tell its length is cut off there, and told why."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._taken = 0

    async def receive(self) -> Message:
        """The next piece."""
        message = await self._receive()
        self._taken += len(message.get("body", b""))
        return {"type": "http.disconnect"} if self._taken > MOST_BYTES else message

    def unless_too_large(self, send: Send) -> Send:
        """Send what is answered; but that it was too much, where what is behind knows only that it ended."""
        is_told = False

        async def instead(message: Message) -> None:
            nonlocal is_told
            if is_told:
                return
            if self._taken > MOST_BYTES and message["type"] == "http.response.start":
                is_told = True
                body = json.dumps({"detail": TOO_LARGE}).encode()
                kind = {
                    "content-type": "application/json",
                    "cache-control": "no-store",
                    "connection": "close",
                }
                await _answer(send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, kind, body)
                return
            await send(message)

        return instead


def _with_headers(send: Send) -> Send:
    """Add what browsers are to obey; a page's own scripts get the nonce."""
    nonce = secrets.token_urlsafe(16)
    is_page = False

    async def with_headers(message: Message) -> None:
        nonlocal is_page
        if message["type"] == "http.response.start":
            kept = list(message["headers"])
            is_page = any(
                name.lower() == b"content-type" and value.startswith(b"text/html") for name, value in kept
            )
            if is_page:
                kept = [(name, value) for name, value in kept if name.lower() != b"content-length"]
            ours = {**HEADERS, "content-security-policy": POLICY.format(nonce=nonce)}
            message = {**message, "headers": [*kept, *_raw(ours)]}
        elif is_page and message["type"] == "http.response.body":
            mark = f'<script nonce="{nonce}"'.encode()
            message = {**message, "body": SCRIPT.sub(mark, message.get("body", b""))}
        await send(message)

    return with_headers


def _raw(headers: Mapping[str, str]) -> Iterable[tuple[bytes, bytes]]:
    return [(name.encode(), value.encode()) for name, value in headers.items()]


async def _answer(send: Send, status: HTTPStatus, headers: Mapping[str, str], body: bytes = b"") -> None:
    start: dict[str, Any] = {"type": "http.response.start", "status": status.value}
    length = {"content-length": str(len(body))}
    await send({**start, "headers": list(_raw({**headers, **length}))})
    await send({"type": "http.response.body", "body": body})


REFUSAL = """<!doctype html><html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>CodeBotler</title>
<style>body{{font:18px/1.5 system-ui,sans-serif;color-scheme:light dark;max-width:34rem;margin:20vh auto;
padding:0 1.5rem}}h1{{font-size:1.4rem}}</style><h1>CodeBotler</h1><p>{sentence}</p></html>"""


async def _refuse(scope: Scope, headers: Headers, error: RefusedError, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": error.sentence[:100]})
        return
    wants_page = "text/html" in headers.get("accept", "")
    if wants_page:
        body, kind = REFUSAL.format(sentence=error.sentence).encode(), "text/html; charset=utf-8"
    else:
        body, kind = json.dumps({"detail": error.sentence}).encode(), "application/json"
    plain = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"
    answer = {**HEADERS, "content-type": kind, "content-security-policy": plain, "cache-control": "no-store"}
    if error.status is HTTPStatus.UNAUTHORIZED:
        answer["www-authenticate"] = "Bearer"
    if error.status is HTTPStatus.TOO_MANY_REQUESTS:
        answer["retry-after"] = "60"
    await _answer(send, error.status, answer, body)
