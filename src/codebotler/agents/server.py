"""Serve agents by the Model Context Protocol, over standard input and output or over HTTP."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import stat
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import asdict
from functools import partial
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import Any, NamedTuple, cast

import anyio
from mcp.server import MCPServer
from mcp.server.mcpserver.exceptions import ResourceError, ResourceNotFoundError
from mcp.server.stdio import stdio_server
from mcp.server.transport_security import TransportSecuritySettings
from mcp_types import ToolAnnotations
from starlette.routing import Route

from codebotler import __version__
from codebotler.agents.gatekeeper import READING_PAST, Gatekeeper
from codebotler.agents.tools import ACTING, READING
from codebotler.core.errors import UserError
from codebotler.core.files import read_text
from codebotler.core.terminal import shortened
from codebotler.missions.mission import MissionError
from codebotler.missions.storage.log import EVENTS_FILE, SUMMARY_FILE
from codebotler.missions.storage.store import RECENT_MISSIONS, find_mission, read_missions
from codebotler.web.security.access import AGENT_PATH
from codebotler.web.server import Companion

MAX_MESSAGE_BYTES = 2_000_000
"""The limit for one message on standard input."""

MAX_SESSIONS = 100
"""The limit for clients over HTTP that have not ended their sessions."""

MAX_READ_BYTES = 1_000_000
"""The limit for reading a mission's file. While the event loop sends a large file, STOP would wait."""


class Streams(NamedTuple):
    """Standard input and output, reserved for the messages of an MCP client."""

    received: FileIO
    sent: BufferedWriter


_INSTRUCTIONS = """CodeBotler runs programs on a robot, but only programs that a person has approved.
Call read_robot first. Then propose_mission, tell the person what you propose, and call run_mission with the
digest: it waits for the person's approval, which you cannot give. Call stop whenever anything is wrong."""


def make_server(gatekeeper: Gatekeeper) -> MCPServer[Gatekeeper]:
    """Create the MCP server with all tools, and with past missions as resources."""

    @asynccontextmanager
    async def lifespan(_: MCPServer[Gatekeeper]) -> AsyncIterator[Gatekeeper]:
        yield gatekeeper

    handlers = logging.root.handlers[:]
    server = MCPServer(
        "codebotler",
        title="CodeBotler",
        instructions=_INSTRUCTIONS,
        version=__version__,
        lifespan=lifespan,
        log_level="WARNING",
        subscriptions=False,  # nothing is published, and idle streams would use up the limit for requests
    )
    logging.root.handlers[:] = handlers  # our own log escapes control characters
    for tools, only_reads in ((READING, True), (ACTING, False)):
        for tool in tools:
            server.add_tool(tool, annotations=ToolAnnotations(read_only_hint=only_reads))
    _add_resources(server, gatekeeper)
    return server


def _add_resources(server: MCPServer[Gatekeeper], gatekeeper: Gatekeeper) -> None:
    home = gatekeeper.console.home

    async def read(work: Callable[[], str]) -> str:
        try:
            return await gatekeeper.run_exclusively(READING_PAST, work)
        except UserError as error:
            raise ResourceNotFoundError(error.sentence) from None
        except MissionError as error:
            raise ResourceError(error.sentence) from None

    @server.resource("codebotler://missions", mime_type="application/json")
    async def missions() -> str:
        """List the latest missions as JSON, oldest first, without their programs and problems."""
        return await read(partial(_list_missions, home))

    @server.resource("codebotler://missions/{mission}", mime_type="application/json")
    async def mission(mission: str) -> str:
        """Return a mission as JSON: its program, its state and the reason for the state."""
        return await read(partial(_read_file, home, mission, SUMMARY_FILE))

    @server.resource("codebotler://missions/{mission}/log", mime_type="application/jsonl")
    async def log(mission: str) -> str:
        """Return the log of a mission as JSON Lines, one event per line."""
        return await read(partial(_read_file, home, mission, EVENTS_FILE))


def _list_missions(home: Path) -> str:
    rows = [
        {
            name: shortened(value) if isinstance(value, str) else value
            for name, value in asdict(one).items()
            if name not in {"program", "problems"}
        }
        for one in read_missions(home, RECENT_MISSIONS)
    ]
    return json.dumps(rows)


def _read_file(home: Path, mission: str, name: str) -> str:
    return read_text(find_mission(home, mission) / name, limit=MAX_READ_BYTES)


# --- transports


def over_http(server: MCPServer[Gatekeeper], announce: Callable[[str], None]) -> Companion:
    """Return a server for agents at `/mcp` on the page's port; `announce` receives the page's address."""
    security = TransportSecuritySettings(enable_dns_rebinding_protection=False)  # the page's guard has it
    (route,) = server.streamable_http_app(
        streamable_http_path=AGENT_PATH, transport_security=security, max_sessions=MAX_SESSIONS
    ).routes
    assert isinstance(route, Route)
    without_stream = Route(AGENT_PATH, route.endpoint, methods=["POST", "DELETE"])  # GET opens an idle one

    async def run() -> None:
        async with server.session_manager.run():
            await asyncio.Event().wait()

    return Companion((without_stream,), run, announce)


def over_stdio(server: MCPServer[Gatekeeper], streams: Streams, announce: Callable[[str], None]) -> Companion:
    """Return a server for one agent over `streams`. When the client closes them, the page shuts down."""
    server.streamable_http_app()  # makes the session manager, the public way to the server below
    running = server.session_manager.app

    async def serve_client(lines: asyncio.StreamReader) -> None:
        output = await _open_output(streams.sent)
        async with stdio_server(stdin=cast("Any", lines), stdout=output) as (reading, writing):
            await running.run(reading, writing, running.create_initialization_options())

    async def run() -> None:
        lines = asyncio.StreamReader(limit=MAX_MESSAGE_BYTES)  # needs no thread, so that signals interrupt it
        is_closed = asyncio.Event()
        loop, protocol = asyncio.get_running_loop(), _Input(lines, is_closed)
        await loop.connect_read_pipe(lambda: protocol, streams.received)
        tasks = [asyncio.create_task(serve_client(lines)), asyncio.create_task(is_closed.wait())]
        try:  # a client that has gone must not keep the robot busy, even if it has not read our answers
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
        if tasks[0] in done:
            await tasks[0]

    return Companion((), run, announce)


class _Input(asyncio.StreamReaderProtocol):
    """Reads standard input, and tells when the client has closed it."""

    def __init__(self, lines: asyncio.StreamReader, is_closed: asyncio.Event) -> None:
        super().__init__(lines)
        self._is_closed = is_closed

    def eof_received(self) -> bool | None:
        """Record that the client has closed standard input."""
        self._is_closed.set()
        return super().eof_received()


class _Output:
    """Writes standard output without a thread, which a client that reads nothing would block."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer

    async def write(self, text: str) -> None:
        """Write text, and wait if the client is slow to read."""
        self._writer.write(text.encode())
        await self._writer.drain()

    async def flush(self) -> None:
        """Do nothing, since `write` buffers no text here."""


async def _open_output(sent: BufferedWriter) -> Any:  # noqa: ANN401 - the SDK wants a file of anyio
    loop = asyncio.get_running_loop()
    try:
        transport, protocol = await loop.connect_write_pipe(asyncio.streams.FlowControlMixin, sent)
    except ValueError:  # a file, which is never full of unread answers
        return anyio.wrap_file(TextIOWrapper(sent, encoding="utf-8"))
    return _Output(asyncio.StreamWriter(transport, protocol, None, loop))


def take_streams() -> Streams:
    """Reserve standard input and output for an MCP client, and send all prints to standard error.

    Raise UserError if standard input is neither a pipe nor a socket, which means that no client started us.
    """
    kind = os.fstat(0).st_mode
    if not (stat.S_ISFIFO(kind) or stat.S_ISSOCK(kind)):
        raise UserError("only an MCP client can start this command; use --http to serve agents over HTTP")
    # uvloop closes the descriptors as well as the files, and in between another thread may reuse the numbers.
    received = os.fdopen(os.dup(0), "rb", buffering=0, closefd=False)
    streams = Streams(received, os.fdopen(os.dup(1), "wb", closefd=False))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return streams
