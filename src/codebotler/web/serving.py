"""What `codebotler serve` does: puts the page and its API on a port, behind a guard, and says how to open."""

from __future__ import annotations

import logging
import socket
import threading
from contextlib import nullcontext
from pathlib import Path
from types import FrameType

import nicegui
import uvicorn
from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles
from nicegui import core, ui

from codebotler import __version__
from codebotler.terminal import note
from codebotler.web import api, apipage, operate
from codebotler.web.access import Access
from codebotler.web.desk import Desk
from codebotler.web.frame import ROBOT, Frame
from codebotler.web.further import Further, Site
from codebotler.web.guard import Guard
from codebotler.web.place import Place

STATIC = Path(__file__).with_name("static")
RUNS = Path("runs")
LINGER = 3
"""Seconds that streams have to end when the tool does."""


def serve(desk: Desk | None, place: Place, access: Access, further: Further = (), runs: Path = RUNS) -> None:
    """Serve the page until Ctrl-C; a robot that runs is stopped then.

    Args:
        desk: not yet entered; None where there are only further pages, and no robot.
        place: where the page is.
        access: who may open it.
        further: pages that other packages add.
        runs: the folder of runs for those.

    Raises:
        BadInput: nobody can listen there.
        OSError: the missions cannot be written.
    """
    with place.listening() as bound, desk or nullcontext():
        port = bound.getsockname()[1]
        app = application(desk, further, runs)
        guard = Guard(app, place.rules(access, port))
        settings = uvicorn.Config(
            guard,
            log_level=logging.WARNING,
            access_log=False,
            proxy_headers=False,
            server_header=False,
            ws_max_size=2_000_000,
            timeout_graceful_shutdown=LINGER,
        )
        for summary in desk.interrupted if desk else ():
            note(f"mission {summary.id} was interrupted: {summary.reason}")
        shown = "localhost" if place.is_loopback else socket.gethostname()
        address = f"http://{shown}:{port}/"
        query = "" if access.operator is None else f"?token={access.operator}"
        ends = "ends the page and stops the robot" if desk else "ends the page"
        note(f"open this link in a browser; Ctrl-C {ends}:\n")
        note(f"    {address}{query}\n")
        _Server(settings, desk).run([bound])


def application(desk: Desk | None, further: Further = (), runs: Path = RUNS) -> FastAPI:
    """The page and its API, without the guard.

    Args:
        desk: what they show; None where there is no robot.
        further: pages that other packages add.
        runs: the folder of runs for those.
    """
    links = tuple((pages.name, pages.address) for pages in further)
    frame = Frame((*ROBOT, *links)) if desk else Frame(links, further[0].brand, has_robot=False)
    app = FastAPI(
        title="CodeBotler",
        version=__version__,
        description="What the page does, for programs.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    if desk:
        app.include_router(api.router(desk))
        operate.add(desk, frame)
    for pages in further:
        pages.add(Site(app, frame, runs))
    apipage.add(app)
    app.mount("/static", StaticFiles(directory=STATIC))
    core.sio.eio.cors_allowed_origins = []  # NiceGUI invites all pages; the guard lets in ours alone
    nicegui.app.config.socket_io_js_transports = ["websocket"]
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


class _Server(uvicorn.Server):
    """Stops the robot as soon as somebody wants to end the tool, before anything else ends."""

    def __init__(self, config: uvicorn.Config, desk: Desk | None) -> None:
        super().__init__(config)
        self._desk = desk

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Called for a signal."""
        if self._desk:
            threading.Thread(target=self._desk.stop, args=("the end of the page",), daemon=True).start()
        super().handle_exit(sig, frame)
