"""Serve the page and its API behind the guard, and print the link that opens the page."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import signal
import socket
import time
from collections.abc import Callable, Coroutine, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from pathlib import Path
from types import FrameType
from typing import Any
from urllib.parse import urlencode

import nicegui
import uvicorn
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from fastapi.staticfiles import StaticFiles
from nicegui import core, ui
from starlette.routing import BaseRoute, Match, Mount
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.auto import AutoHTTPProtocol

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.terminal import note
from codebotler.core.text.words import listed
from codebotler.missions.mission import BY_SHUTDOWN
from codebotler.web import api, face, page
from codebotler.web.console import Console
from codebotler.web.frame import FACE_LINK, ROBOT_LINKS, Frame, Pages, Site
from codebotler.web.security.access import Access, PageAddress, Role
from codebotler.web.security.guard import MAX_BODY_BYTES, NO_PAGE, Guard, refusal
from codebotler.web.security.proxy import path_of

STATIC_FOLDER = Path(__file__).with_name("static")
BY_LEAVING = "CodeBotler, because the last operator closed the page"
RUNS_FOLDER = Path("runs")
_HTTP_METHODS = ("GET", "POST", "PUT", "PATCH", "DELETE")
_PAGE_SOCKETS = "/_nicegui_ws/"
"""An operator's page keeps a websocket open below this path."""

_MAX_WAITING_CONNECTIONS = 100
_STREAM_END_SECONDS = 3
"""The time that streams have to end when the server stops, in seconds."""


@dataclass(frozen=True)
class Companion:
    """A second server that shares the page's process, port and robot, such as the one for agents."""

    routes: Sequence[BaseRoute]  # on the page's port, behind the guard
    run: Callable[[], Coroutine[Any, Any, None]]  # returns at its end
    announce: Callable[[str], None]  # receives the page's address before the start


def serve(
    console: Console | None,
    place: PageAddress,
    access: Access,
    further: Sequence[Pages] = (),
    runs: Path = RUNS_FOLDER,
    *,
    alone_for: float | None = None,
    companion: Companion | None = None,
) -> None:
    """Serve the page at `place` until Ctrl-C, which also stops the robot of `console`.

    Without a console, serve only the `further` pages. `access` holds the tokens of visitors, and `runs` the
    runs of benchmarks. If `alone_for` is given, the robot stops that many seconds after the last operator
    has closed the page. If `companion`, a second server, is given, the page ends when it ends.
    """
    with place.listen() as bound, console or nullcontext():
        port = bound.getsockname()[1]
        pages = application(console, further, runs, () if companion is None else companion.routes)
        _check_prefixes(pages, place)
        app: ASGIApp = pages
        if console and alone_for is not None:
            app = Presence(app, alone_for, partial(console.stop, BY_LEAVING, only_moving=True))
        guard = Guard(app, access, place, port, partial(_has_page, pages))
        settings = uvicorn.Config(
            guard,
            log_config=None,  # its messages go to our own log
            log_level=logging.WARNING,
            access_log=False,
            proxy_headers=False,
            server_header=False,
            http=_Connection,
            ws_max_size=MAX_BODY_BYTES,
            timeout_graceful_shutdown=_STREAM_END_SECONDS,
        )
        address = _address(place, bound)
        note(_links(place, address, access, console))
        if companion is not None:
            companion.announce(address)
        server = _Server(settings, console, companion)
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as it is with `nohup`
            signal.signal(signal.SIGHUP, server.handle_exit)
        server.run([bound])


def _links(place: PageAddress, own: str, access: Access, console: Console | None) -> str:
    addresses = [*(proxy.page for proxy in place.proxies), own]

    def links(page: str, token: str) -> list[str]:
        query = "" if access.operator is None else f"?{urlencode({'token': token})}"
        return [f"    {address}{page}{query}\n" for address in addresses]

    ends = "stops the robot and closes the page" if console else "closes the page"
    which = "one of these links" if place.proxies else "this link"
    lines = [f"Open {which} in a browser; Ctrl-C {ends}:\n", *links("", access.operator or "")]
    if not place.is_loopback:
        lines.append("Other machines can open this link, too. The connection is not encrypted.\n")
    if console and console.face is not None:
        here = "on this machine (others need --host)"
        where = here if place.is_private else "on the robot's tablet"
        lines.append(f"Open the robot's face, which cannot run programs, {where}:\n")
        lines += links("face", access.face)
    return "\n".join(lines)


def _address(place: PageAddress, bound: socket.socket) -> str:
    """Return the page's own address. Where `localhost` or this machine's name leads, others may listen."""
    own, port = bound.getsockname()[:2]
    is_every = ipaddress.ip_address(own).is_unspecified  # and its name leads to one of them
    host = own if place.is_loopback else socket.gethostname() if is_every else place.host
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/"


def _check_prefixes(app: FastAPI, place: PageAddress) -> None:
    """Refuse prefixes that look like our own paths, because proxies may or may not remove them."""
    routes = (*app.routes, *nicegui.app.routes)
    own = {path.split("/")[1] for route in routes if (path := getattr(route, "path", ""))}
    for proxy in place.proxies:
        first = proxy.prefix.split("/")[1] if proxy.prefix else ""
        if first and first in own:
            raise UserError(
                f"--behind-proxy {proxy.page}: /{first} is already used by the page; choose another path"
            )


def application(
    console: Console | None,
    further: Sequence[Pages] = (),
    runs: Path = RUNS_FOLDER,
    routes: Sequence[BaseRoute] = (),
) -> FastAPI:
    """Create the web application with all its pages and routes, but without `Guard`."""
    links = tuple((pages.name, pages.address) for pages in further)
    to_face = (FACE_LINK,) if console and console.face else ()
    frame = (
        Frame((*ROBOT_LINKS, *to_face, *links))
        if console
        else Frame(links, further[0].brand, has_robot=False)
    )
    app = FastAPI(
        title="CodeBotler",
        version=__version__,
        description="Controls missions, checks programs and describes the robot.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    if console:
        app.include_router(api.router(console))
        if console.face is not None:
            app.include_router(face.router(console, console.face))
        page.add(console, frame)
    for pages in further:
        pages.add(Site(app, frame, runs))
    app.add_exception_handler(RequestValidationError, api.invalid_request)
    app.router.routes.extend(routes)
    app.mount("/static", StaticFiles(directory=STATIC_FOLDER))
    core.sio.eio.cors_allowed_origins = []  # NiceGUI allows all origins, but the guard only ours
    nicegui.app.config.socket_io_js_transports = ["websocket"]
    nicegui.app.add_exception_handler(HTTPStatus.NOT_FOUND.value, partial(_not_found, app, frame.brand))
    ui.run_with(
        app,
        title="CodeBotler",
        favicon=STATIC_FOLDER / "icon.svg",
        dark=None,
        language="en-US",
        tailwind=False,
        reconnect_timeout=20.0,
        gzip_middleware_factory=None,  # the guard can add nonces only to uncompressed pages
        show_welcome_message=False,
    )
    return app


def _not_found(app: FastAPI, brand: str, request: Request, _error: Exception) -> Response:
    """Return 404, or 405 if the API has this path for another method."""
    status, sentence, headers = HTTPStatus.NOT_FOUND, NO_PAGE, {}
    allowed = [method for method in _HTTP_METHODS if _is_taken(app.routes, method, path_of(request.scope))]
    if allowed:
        status, sentence = HTTPStatus.METHOD_NOT_ALLOWED, f"this address accepts only {listed(allowed)}"
        headers = {"allow": ", ".join(allowed)}
    return refusal(request, status, sentence, headers, brand)


def _has_page(app: FastAPI, path: str) -> bool:
    return _is_taken([*app.routes, *nicegui.app.routes], "GET", path)


def _is_taken(routes: Sequence[BaseRoute], method: str, path: str) -> bool:
    scope = {"type": "http", "method": method, "path": path, "headers": []}
    return any(route.matches(scope)[0] is Match.FULL for route in routes if not isinstance(route, Mount))


class Presence:
    """ASGI middleware that calls `alone` when no operator has had a page open for `seconds`.

    `alone` must return at once. The delay lets operators reload their page.
    """

    def __init__(self, app: ASGIApp, seconds: float, alone: Callable[[], object]) -> None:
        self._app, self._seconds, self._alone = app, seconds, alone
        self._pages = 0
        self._leaving: asyncio.TimerHandle | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on a request, and count the open pages."""
        is_operator = scope.get("state", {}).get("role") is Role.OPERATOR
        if not is_operator or scope["type"] != "websocket" or not path_of(scope).startswith(_PAGE_SOCKETS):
            await self._app(scope, receive, send)
            return
        self._pages += 1
        if self._leaving is not None:
            self._leaving.cancel()
        try:
            await self._app(scope, receive, send)
        finally:
            self._pages -= 1
            if not self._pages:
                self._leaving = asyncio.get_running_loop().call_later(self._seconds, self._alone)


class _Connection(AutoHTTPProtocol):  # type: ignore[misc,valid-type]  # depends on what is installed
    """A connection that is closed for newer ones while it waits for its client.

    Otherwise, clients that send nothing could take all file descriptors, and STOP could not connect.
    """

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """If more than 100 connections are idle, close the oldest, so that new clients can connect."""
        super().connection_made(transport)
        self.since = time.monotonic()
        waiting = [one for one in self.connections if isinstance(one, _Connection) and one.is_waiting]
        for one in sorted(waiting, key=lambda one: one.since)[:-_MAX_WAITING_CONNECTIONS]:
            one.transport.abort()

    @property
    def is_waiting(self) -> bool:
        """Whether the server is waiting for the client to send (the rest of) a request."""
        cycle = self.cycle
        return cycle is None or cycle.more_body or cycle.response_complete


class _Server(uvicorn.Server):
    """A server that stops the robot before it handles a signal."""

    def __init__(
        self, config: uvicorn.Config, console: Console | None, companion: Companion | None = None
    ) -> None:
        super().__init__(config)
        self._console, self._companion = console, companion
        self._accompanying: asyncio.Task[None] | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the companion before the first request can arrive."""
        if self._companion is not None:
            self._accompanying = asyncio.create_task(self._accompany(self._companion))
        await super().startup(sockets)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the companion, which may keep connections open, then the server. Wait until the robot stops."""
        if self._accompanying is not None:
            self._accompanying.cancel()
        if self._console is not None:
            self._console.notifier.close()
        await super().shutdown(sockets)
        if self._console is not None:
            await asyncio.to_thread(self._console.end)

    async def _accompany(self, companion: Companion) -> None:
        try:
            await companion.run()
        finally:
            self.should_exit = True
            if self._console:
                self._console.stop(BY_SHUTDOWN)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if self._console:
            self._console.stop(BY_SHUTDOWN, holds=self._console.view.is_running)
        super().handle_exit(sig, frame)
