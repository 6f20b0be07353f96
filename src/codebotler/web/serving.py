"""What `codebotler serve` does: puts the page and its API on a port, behind a guard, and says how to open."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
from http import HTTPStatus
from pathlib import Path
from types import FrameType
from urllib.parse import urlencode

import nicegui
import uvicorn
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from fastapi.staticfiles import StaticFiles
from nicegui import core, ui
from starlette.routing import BaseRoute, Match, Mount
from starlette.types import ASGIApp

from codebotler import __version__
from codebotler.core.terminal import note
from codebotler.core.words import listed
from codebotler.web import api, apipage, facepage, operate
from codebotler.web.access import Access
from codebotler.web.console import Console
from codebotler.web.frame import FACE, ROBOT, Frame
from codebotler.web.further import Further, Site
from codebotler.web.guard import MOST_BYTES, REFUSAL, Guard
from codebotler.web.place import Place
from codebotler.web.presence import Presence

STATIC = Path(__file__).with_name("static")
LEAVING = "the leaving of the last operator"
RUNS = Path("runs")
METHODS = ("GET", "POST", "PUT", "PATCH", "DELETE")
LINGER = 3
"""Seconds that streams have to end when the tool does."""


def serve(
    console: Console | None,
    place: Place,
    access: Access,
    further: Further = (),
    runs: Path = RUNS,
    *,
    alone_for: float | None = None,
) -> None:
    """Serve the page until Ctrl-C; a robot that runs is stopped then.

    Args:
        console: not yet entered; None where there are only further pages, and no robot.
        place: where the page is.
        access: who may open it.
        further: pages that other packages add.
        runs: the folder of runs for those.
        alone_for: a robot that runs is stopped so many seconds after the last operator left; None: never.

    Raises:
        UserError: nobody can listen there.
        OSError: the missions cannot be written.
    """
    with place.listening() as bound, console or nullcontext():
        port = bound.getsockname()[1]
        pages = application(console, further, runs)
        app: ASGIApp = pages
        if console and alone_for is not None:
            app = Presence(app, alone_for, partial(console.stop_soon, LEAVING, only_moving=True))
        guard = Guard(app, place.rules(access, port), partial(_has_page, pages))
        settings = uvicorn.Config(
            guard,
            log_config=None,  # what it logs is noted like all else
            log_level=logging.WARNING,
            access_log=False,
            proxy_headers=False,
            server_header=False,
            ws_max_size=MOST_BYTES,
            timeout_graceful_shutdown=LINGER,
        )
        for summary in console.interrupted if console else ():
            note(f"mission {summary.id} was interrupted: {summary.reason}")
        note(_links(place, port, access, console))  # at once, for those who read it through a pipe
        _Server(settings, console).run([bound])


def _links(place: Place, port: int, access: Access, console: Console | None) -> str:
    shown = "localhost" if place.is_loopback else socket.gethostname()
    address = f"http://{shown}:{port}/"

    def query(token: str) -> str:
        return "" if access.operator is None else f"?{urlencode({'token': token})}"

    ends = "ends the page and stops the robot" if console else "ends the page"
    told = [
        f"open this link in a browser; Ctrl-C {ends}:\n",
        f"    {address}{query(access.operator or '')}\n",
    ]
    if not place.is_loopback:
        told.append(
            "other machines get in as well, by this link only; what they send and see is not encrypted\n"
        )
    if console and console.face is not None:
        where = "here; --host lets other machines in" if place.is_loopback else "on the robot's tablet"
        told.append(f"the robot's face, which can run nothing, to be opened {where}:\n")
        told.append(f"    {address}face{query(access.face)}\n")
    return "\n".join(told)


def application(console: Console | None, further: Further = (), runs: Path = RUNS) -> FastAPI:
    """The page and its API, without the guard.

    Args:
        console: what they show; None where there is no robot.
        further: pages that other packages add.
        runs: the folder of runs for those.
    """
    links = tuple((pages.name, pages.address) for pages in further)
    face = (FACE,) if console and console.face else ()
    frame = Frame((*ROBOT, *face, *links)) if console else Frame(links, further[0].brand, has_robot=False)
    app = FastAPI(
        title="CodeBotler",
        version=__version__,
        description="What the page does, for programs.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    if console:
        app.include_router(api.router(console))
        if console.face is not None:
            app.include_router(facepage.router(console, console.face))
        operate.add(console, frame)
    for pages in further:
        pages.add(Site(app, frame, runs))
    app.add_exception_handler(RequestValidationError, api.refused)
    apipage.add(app)
    app.mount("/static", StaticFiles(directory=STATIC))
    core.sio.eio.cors_allowed_origins = []  # NiceGUI invites all pages; the guard lets in ours alone
    nicegui.app.config.socket_io_js_transports = ["websocket"]
    nicegui.app.add_exception_handler(HTTPStatus.NOT_FOUND.value, partial(_not_found, app))
    ui.run_with(
        app,
        title="CodeBotler",
        favicon=STATIC / "icon.svg",
        dark=None,
        language="en-US",
        tailwind=False,
        reconnect_timeout=20.0,
        gzip_middleware_factory=None,  # the guard marks the page's own scripts, which it has to read for that
        show_welcome_message=False,
    )
    return app


def _not_found(app: FastAPI, request: Request, _error: Exception) -> Response:
    """In a sentence, as a person or a program wants it.

    NiceGUI takes every address that the API does not, and so also each that the API has for another method.
    """
    status, sentence, headers = HTTPStatus.NOT_FOUND, "there is no such page", {}
    if allowed := _methods(app, request):
        status, sentence = HTTPStatus.METHOD_NOT_ALLOWED, f"this address takes {listed(allowed)} only"
        headers = {"allow": ", ".join(allowed)}
    if "text/html" in request.headers.get("accept", ""):
        return HTMLResponse(REFUSAL.format(sentence=sentence), status, headers)
    return JSONResponse({"detail": sentence}, status, headers)


def _methods(app: FastAPI, request: Request) -> list[str]:
    """The methods that the API takes at an address; none where it has no such address."""
    return [method for method in METHODS if _is_taken(app.routes, method, request.scope["path"])]


def _has_page(app: FastAPI, path: str) -> bool:
    """Whether something answers at a path, of the pages or of what is beside them."""
    return _is_taken([*app.routes, *nicegui.app.routes], "GET", path)


def _is_taken(routes: Sequence[BaseRoute], method: str, path: str) -> bool:
    scope = {"type": "http", "method": method, "path": path, "headers": []}
    return any(route.matches(scope)[0] is Match.FULL for route in routes if not isinstance(route, Mount))


class _Server(uvicorn.Server):
    """Stops the robot as soon as somebody wants to end the tool, before anything else ends."""

    def __init__(self, config: uvicorn.Config, console: Console | None) -> None:
        super().__init__(config)
        self._console = console

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Called for a signal."""
        if self._console:
            threading.Thread(target=self._console.stop, args=("the end of the page",), daemon=True).start()
        super().handle_exit(sig, frame)
