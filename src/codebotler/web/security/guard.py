"""Middleware that checks the host, origin, token and size of each request, and sets security headers."""

from __future__ import annotations

import ipaddress
import re
import secrets
from collections.abc import Callable, Mapping
from http import HTTPStatus
from posixpath import normpath
from urllib.parse import quote, urlencode

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from codebotler.core.terminal import note
from codebotler.web.security.access import AGENT_PATH, Access, PageAddress, Role, TooManyTriesError
from codebotler.web.security.proxy import OuterAddress, addresses_by_host, path_of, prefix_of

MAX_BODY_BYTES = 2_000_000
"""The maximum size of a request body."""

MAX_AGENT_BODY_BYTES = 200_000
"""The maximum size of an agent's request, which has a program or a contract."""

MAX_AGENT_REQUESTS = 200
"""The number of agents' requests that are answered at a time, so that there is room for STOP."""

_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_FACE_PATHS = ("/face", "/api/face", "/static", "/favicon.ico")
"""The paths that faces may use, without NiceGUI's websocket, which accepts messages for any page."""

_PAGE_POLICY = (
    "default-src 'none'; script-src 'self' 'nonce-{nonce}' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; font-src 'self'; connect-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
"""NiceGUI needs `unsafe-eval`, because Vue compiles templates in the browser, and inline styles for Quasar
and CodeMirror. Inline scripts get a nonce, because their content, and so their hash, varies."""

_REFUSAL_POLICY = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"
_SECURITY_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), payment=(), usb=(), microphone=(self)",
}
_HOST_HEADER = re.compile(r"(?:([a-z0-9._-]+)|\[([0-9a-f:.]+)\])(?::(\d{1,5}))?")
"""Any port is allowed, because tunnels and proxies use ports of their own."""

_MAX_PORT = 65_535
_CONTROL_CHARACTERS = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_SCRIPT_TAG = re.compile(rb"<script(?=[\s>])")
_NO_SCRIPT = "script-src 'none'"  # pages with this policy get no nonce

_NO_CONTROL_CHARACTERS = "there is no such page; addresses cannot contain control characters"
NO_PAGE = "there is no such page"
_WRONG = "this token is wrong; use the printed link or token"
_OTHER_SITE = (
    "this request came from another site; behind a proxy, use --behind-proxy and keep the Host header"
)
_TOO_MANY = f"{MAX_AGENT_REQUESTS} requests of agents are being answered already; wait for their answers"

_REFUSAL_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{brand}</title>
<style>body{{font:18px/1.5 system-ui,sans-serif;color-scheme:light dark;max-width:34rem;margin:20vh auto;
padding:0 1.5rem}}h1{{font-size:1.4rem}}</style><h1>{brand}</h1><p>{sentence}</p></html>"""


class RefusedError(Exception):
    """Raised to refuse a request with a status and a reason."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(status, sentence)
        self.status, self.sentence = status, sentence


class Guard:
    """ASGI middleware that refuses a request with a wrong host, origin, token, role or size."""

    def __init__(
        self, app: ASGIApp, access: Access, place: PageAddress, port: int, has_page: Callable[[str], bool]
    ) -> None:
        self._app, self._access, self._has_page = app, access, has_page
        self._hosts, self._takes_addresses = place.hosts, not place.is_loopback
        self._proxies, self._port = addresses_by_host(place.proxies), port
        self._has_noted = False
        self._agent_requests = 0  # that are being answered

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Accept or refuse a request."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        is_http = scope["type"] == "http"
        proxy = self._proxies.get(_named_host(scope))
        if proxy is not None:
            scope = proxy.seen_from_outside(scope)
        inside = prefix_of(scope) + self._access.path
        if f"{scope['path']}/".startswith(f"{inside}/"):
            scope = {**scope, "root_path": inside}
        request = HTTPConnection(scope)
        try:
            self._check_path(path_of(scope))
            self._check_host(request)
            self._check_origin(request, proxy)
            if is_http and (token := _token_in_link(request)) is not None:
                await self._let_in(token, request)(scope, receive, send)
                return
            role = self._role(request)
            _check_role(role, path_of(scope))
            is_agents = path_of(scope) == AGENT_PATH
            limit = MAX_AGENT_BODY_BYTES if is_agents else MAX_BODY_BYTES
            _check_length(request, limit)
            self._check_agents(is_new=is_agents)
        except RefusedError as error:
            closing = WebSocketClose(code=1008, reason=error.sentence[:100])
            await (_refusal(request, error) if is_http else closing)(scope, receive, send)
            return
        scope.setdefault("state", {})["role"] = role
        if is_http:
            limited = _LimitedBody(scope, receive, send, limit)
            receive, send = limited.receive, limited.send
        self._agent_requests += is_agents
        try:
            await self._app(scope, receive, send)
        finally:
            self._agent_requests -= is_agents

    def _check_agents(self, *, is_new: bool) -> None:
        """Refuse an agent's request if too many are being answered."""
        if is_new and self._agent_requests >= MAX_AGENT_REQUESTS:
            raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, _TOO_MANY)

    def _check_path(self, path: str) -> None:
        if _CONTROL_CHARACTERS.search(path) and not self._has_page(path):  # names of runs may contain them
            raise RefusedError(HTTPStatus.BAD_REQUEST, _NO_CONTROL_CHARACTERS)

    def _check_host(self, request: HTTPConnection) -> None:
        """Refuse unknown host names, which a foreign page could use to reach us (DNS rebinding)."""
        name = _host(request)
        if name not in self._hosts and not (self._takes_addresses and _is_address(name)):
            raise RefusedError(
                HTTPStatus.MISDIRECTED_REQUEST,
                "unknown host name; open the printed link, or add the name with --name or --behind-proxy",
            )

    def _check_origin(self, request: HTTPConnection, proxy: OuterAddress | None) -> None:
        """Refuse requests from pages of other sites."""
        headers, is_socket = request.headers, request.scope["type"] == "websocket"
        origin = headers.get("origin")
        host = headers.get("host", "") if proxy is None else proxy.host
        if origin is not None and not _is_same(origin, host, request.scope):
            if not self._has_noted:  # also in the terminal, because the browser shows only a lost connection
                self._has_noted = True
                note(_OTHER_SITE)
            raise RefusedError(HTTPStatus.FORBIDDEN, _OTHER_SITE)
        changes = is_socket or request.scope["method"] not in _SAFE_METHODS
        from_browser = "cookie" in headers or is_socket
        if changes and origin is None and from_browser and "authorization" not in headers:
            raise RefusedError(
                HTTPStatus.FORBIDDEN, "the request has a cookie but no Origin header; send a token instead"
            )
        navigates = headers.get("sec-fetch-mode") == "navigate"
        if headers.get("sec-fetch-site") in {"cross-site", "same-site"} and not navigates:
            raise RefusedError(HTTPStatus.FORBIDDEN, _OTHER_SITE)

    def _role(self, request: HTTPConnection) -> Role | None:
        kind, _, given = request.headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and given:
            role = self._of_token(given.strip(), request)
            if role is None:
                raise RefusedError(HTTPStatus.UNAUTHORIZED, _WRONG)
            return role
        cookies = (request.cookies.get(self._cookie(role), "") for role in (Role.OPERATOR, Role.FACE))
        role = next(filter(None, map(self._access.of_cookie, cookies)), None)
        return Role.OPERATOR if role is None and self._access.operator is None else role

    def _cookie(self, role: Role) -> str:
        """Return the name of a role's cookie, which no server on another port can guess."""
        return f"codebotler-{self._port}-{role}-{self._access.path[1:9]}"

    def _of_token(self, token: str, request: HTTPConnection) -> Role | None:
        try:
            return self._access.of_token(token, request.client.host if request.client else "")
        except TooManyTriesError:
            raise RefusedError(
                HTTPStatus.TOO_MANY_REQUESTS, "too many wrong tokens came from your address; wait a minute"
            ) from None

    def _let_in(self, token: str, request: HTTPConnection) -> Response:
        """Exchange the token in a link for a cookie, to keep the token out of the browser's history."""
        role = self._of_token(token, request)
        if (role is None and self._access.operator is not None) or role is Role.AGENT:
            raise RefusedError(HTTPStatus.UNAUTHORIZED, _WRONG)
        path = "/" + path_of(request.scope).strip("/")  # a double slash would start a host name
        if _CONTROL_CHARACTERS.search(path):
            raise RefusedError(HTTPStatus.BAD_REQUEST, _NO_CONTROL_CHARACTERS)
        if normpath(path) != path or not self._has_page(path):  # browsers resolve ".."
            raise RefusedError(HTTPStatus.NOT_FOUND, NO_PAGE)
        rest = [(name, value) for name, value in request.query_params.multi_items() if name != "token"]
        secret = self._access.path
        prefix = prefix_of(request.scope).removesuffix(secret) + (secret if role else "")
        where = prefix + quote(path) + (f"?{urlencode(rest)}" if rest else "")
        answer = RedirectResponse(
            where, HTTPStatus.SEE_OTHER, {**_SECURITY_HEADERS, "cache-control": "no-store"}
        )
        answer.headers["location"] = where
        if role is not None:
            value = self._access.cookie(role)
            is_secure = request.scope["scheme"] == "https"
            answer.set_cookie(
                self._cookie(role),
                value,
                path=prefix,
                secure=is_secure,
                httponly=True,
                samesite="strict",
            )
        return answer


def _named_host(scope: Scope) -> str:
    """Return the Host header, or an empty string if there is none or more than one."""
    named = [value for name, value in scope["headers"] if name == b"host"]
    return named[0].decode("latin-1").lower() if len(named) == 1 else ""


def _host(request: HTTPConnection) -> str:
    found = _HOST_HEADER.fullmatch(_named_host(request.scope))
    if found is None or not 0 < int(found[3] or 80) <= _MAX_PORT:
        raise RefusedError(HTTPStatus.BAD_REQUEST, "send exactly one Host header, with a name and a port")
    return found[1] or found[2]


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_same(origin: str, host: str, scope: Scope) -> bool:
    secure = "s" if scope["scheme"] in {"https", "wss"} else ""
    return origin.lower() == f"http{secure}://{host.lower()}"


def _token_in_link(request: HTTPConnection) -> str | None:
    if path_of(request.scope).startswith(("/api/", "/_nicegui")):
        return None
    return request.query_params.get("token")


def _check_role(role: Role | None, path: str) -> None:
    if role is None:
        raise RefusedError(HTTPStatus.UNAUTHORIZED, "open the printed link, which contains the token")
    if role is Role.FACE and not any(path == place or path.startswith(f"{place}/") for place in _FACE_PATHS):
        raise RefusedError(HTTPStatus.FORBIDDEN, "your link opens only the face; use the operator's link")
    if role is Role.AGENT and path != AGENT_PATH:
        raise RefusedError(HTTPStatus.FORBIDDEN, f"the token of agents opens only {AGENT_PATH}")


def _check_length(request: HTTPConnection, limit: int) -> None:
    length = request.headers.get("content-length", "0")
    if not length.isascii() or not length.isdigit() or int(length) > limit:
        raise _too_large(limit)


def _too_large(limit: int) -> RefusedError:
    sentence = f"this request is too large; the limit is {limit:,} bytes"
    return RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, sentence)


class _LimitedBody:
    """Rejects request bodies that are too large, and adds security headers to responses."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, limit: int) -> None:
        self._scope, self._receive, self._send = scope, receive, send
        self._limit, self._length = limit, 0
        self._nonce = secrets.token_urlsafe(16)
        self._is_page = self._is_refused = False

    async def receive(self) -> Message:
        message = await self._receive()
        self._length += len(message.get("body", b""))
        return {"type": "http.disconnect"} if self._length > self._limit else message

    async def send(self, message: Message) -> None:
        if self._is_refused:
            return
        if message["type"] == "http.response.start":
            if self._length > self._limit:
                self._is_refused = True
                answer = _refusal(HTTPConnection(self._scope), _too_large(self._limit))
                answer.headers["connection"] = "close"  # the rest of the body is unread
                await answer(self._scope, self._receive, self._send)
                return
            headers = MutableHeaders(raw=list(message["headers"]))
            own = headers.get("content-security-policy", "")
            self._is_page = headers.get("content-type", "").startswith("text/html") and _NO_SCRIPT not in own
            if self._is_page:
                del headers["content-length"]
            for name, value in _SECURITY_HEADERS.items():
                headers[name] = value
            headers.append("content-security-policy", _PAGE_POLICY.format(nonce=self._nonce))
            message = {**message, "headers": headers.raw}
        elif self._is_page and message["type"] == "http.response.body":
            marked = _SCRIPT_TAG.sub(f'<script nonce="{self._nonce}"'.encode(), message.get("body", b""))
            message = {**message, "body": marked}
        await self._send(message)


def _refusal(request: HTTPConnection, error: RefusedError) -> Response:
    headers = {**_SECURITY_HEADERS, "content-security-policy": _REFUSAL_POLICY, "cache-control": "no-store"}
    if error.status is HTTPStatus.UNAUTHORIZED:
        headers["www-authenticate"] = "Bearer"
    if error.status is HTTPStatus.TOO_MANY_REQUESTS:
        headers["retry-after"] = "60"
    return refusal(request, error.status, error.sentence, headers)


def refusal(
    request: HTTPConnection,
    status: HTTPStatus,
    sentence: str,
    headers: Mapping[str, str],
    brand: str = "CodeBotler",
) -> Response:
    """Build a response that refuses a request: a page for browsers, and JSON for other clients."""
    if "text/html" in request.headers.get("accept", ""):
        return HTMLResponse(_REFUSAL_PAGE.format(sentence=sentence, brand=brand), status, headers)
    return JSONResponse({"detail": sentence}, status, headers)
