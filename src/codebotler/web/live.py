"""Pages that follow what changes."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from nicegui import background_tasks, ui

from codebotler.web.console import Notifier

_UPDATE_PAUSE = 0.1
"""Seconds between two updates of a page, however often something changes."""


async def follow(notifier: Notifier, update: Callable[[], Awaitable[None]]) -> None:
    """Wait for the browser, and from then on update the page that is being built, for as long as it is open.

    Args:
        notifier: says when something has changed.
        update: brings the page up to date; it is called once at the beginning.
    """
    client, here = ui.context.client, ui.context.slot.parent
    await client.connected()

    async def following() -> None:
        async for _ in notifier.changes():
            with here:
                await update()
            await asyncio.sleep(_UPDATE_PAUSE)

    client.on_delete(background_tasks.create(following()).cancel)
