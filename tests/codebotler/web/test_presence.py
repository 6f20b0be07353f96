"""An operator is present while a websocket is open, and for a moment after, in case of a reload."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from starlette.types import Message, Receive, Scope, Send

from codebotler.web.security.access import Role
from codebotler.web.server import _PAGE_SOCKETS, Presence

PAGE = f"{_PAGE_SOCKETS}socket.io/"
SECONDS = 10.0


class Loop(asyncio.SelectorEventLoop):
    """An event loop whose time passes when a test says so."""

    now = 0.0

    def time(self) -> float:
        return self.now


class Pages:
    """Websockets that stay open until a test closes them."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.left: list[float] = []
        self.presence = Presence(self._stay_open, SECONDS, lambda: self.left.append(loop.now))
        self._open: list[tuple[asyncio.Event, asyncio.Task[None]]] = []

    async def _stay_open(self, scope: Scope, _receive: Receive, _send: Send) -> None:
        await scope["until"].wait()
        if scope["breaks"]:
            raise ConnectionError

    async def come(self, *, role: Role = Role.OPERATOR, path: str = PAGE, breaks: bool = False) -> None:
        until = asyncio.Event()
        scope = {"type": "websocket", "path": path, "state": {"role": role}, "until": until, "breaks": breaks}
        self._open.append((until, asyncio.create_task(self.presence(scope, _receive, _send))))
        await asyncio.sleep(0)

    async def leave(self) -> None:
        until, task = self._open.pop(0)
        until.set()
        await asyncio.gather(task, return_exceptions=True)

    async def wait(self, seconds: float) -> None:
        self.loop.now += seconds
        await asyncio.sleep(0)
        await asyncio.sleep(0)


async def _receive() -> Message:
    return {}


async def _send(_message: Message) -> None:
    pass


async def stay_empty(pages: Pages) -> None:
    await pages.wait(100)
    assert pages.left == []


async def leave_one_by_one(pages: Pages) -> None:
    await pages.come()
    await pages.come()
    await pages.leave()
    await pages.wait(100)
    assert pages.left == []
    await pages.leave()
    await pages.wait(9.9)
    assert pages.left == []
    await pages.wait(0.2)
    assert len(pages.left) == 1
    await pages.wait(100)
    assert len(pages.left) == 1


async def reload_once(pages: Pages) -> None:
    await pages.come()
    await pages.leave()
    await pages.wait(9)
    await pages.come()
    await pages.wait(100)
    assert pages.left == []
    await pages.leave()
    await pages.wait(11)
    assert len(pages.left) == 1


async def break_connection(pages: Pages) -> None:
    await pages.come(breaks=True)
    await pages.leave()
    await pages.wait(11)
    assert len(pages.left) == 1


async def ignore_faces_and_other_sockets(pages: Pages) -> None:
    await pages.come()
    await pages.come(role=Role.FACE)
    await pages.come(path="/api/face/live")
    await pages.leave()
    await pages.wait(11)
    assert len(pages.left) == 1
    await pages.leave()
    await pages.leave()
    await pages.wait(11)
    assert len(pages.left) == 1


@pytest.mark.parametrize(
    "happens",
    [
        stay_empty,
        leave_one_by_one,
        reload_once,
        break_connection,
        ignore_faces_and_other_sockets,
    ],
)
def test_operator_leaves_once_the_last_page_stays_closed(happens: Callable[[Pages], Awaitable[None]]) -> None:
    loop = Loop()

    async def run() -> None:
        await happens(Pages(loop))

    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        runner.run(run())
