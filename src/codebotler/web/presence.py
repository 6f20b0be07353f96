"""Knows whether an operator's page is open anywhere, and tells when the last was closed some time ago."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from starlette.types import ASGIApp, Receive, Scope, Send

from codebotler.web.access import Role

SOCKETS = "/_nicegui_ws/"
"""Where each page of an operator holds a websocket open, for as long as it is there."""


class Presence:
    """ASGI in front of ASGI, behind the guard, on one event loop.

    Args:
        app: what is behind it.
        seconds: for so long may nobody be there, above 0; a page that is reloaded is away for a moment.
        alone: called when nobody came back; back at once.
    """

    def __init__(self, app: ASGIApp, seconds: float, alone: Callable[[], object]) -> None:
        self._app, self._seconds, self._alone = app, seconds, alone
        self._pages = 0
        self._leaving: asyncio.TimerHandle | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass it on; what is an operator's page is counted for as long as it is there."""
        if not is_page(scope):
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


def is_page(scope: Scope) -> bool:
    """Whether this is the websocket of an operator's page."""
    role = scope.get("state", {}).get("role")
    return scope["type"] == "websocket" and scope["path"].startswith(SOCKETS) and role is Role.OPERATOR
