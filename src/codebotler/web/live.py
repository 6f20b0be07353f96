"""Update open pages when something changes."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from nicegui import background_tasks, ui

from codebotler.web.notifier import Notifier

_UPDATE_PAUSE = 0.1  # the shortest time between two updates of a page, in seconds


async def follow(notifier: Notifier, update: Callable[[], Awaitable[None]]) -> None:
    """Once the browser connects, call `update` immediately and after each change, until it disconnects."""
    client, here = ui.context.client, ui.context.slot.parent
    await client.connected()

    async def update_at_changes() -> None:
        async for _ in notifier.changes():
            if client.is_deleted:
                return
            with here:
                await update()
            await asyncio.sleep(_UPDATE_PAUSE)

    client.on_delete(background_tasks.create(update_at_changes()).cancel)
