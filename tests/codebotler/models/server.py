"""A server on loopback that speaks OpenAI's chat and text completions, and misbehaves on demand.

`python server.py` serves until its standard input ends, and prints its URL first.
"""

import asyncio
import contextlib
import gzip
import json
import sys
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum, auto
from types import TracebackType
from typing import Any, Self

TASK = "def task_program():\n"
CHUNK = 24  # A streamed piece has this many characters.
DRIP = 0.2  # A reply without an end sends a piece this often, in seconds.
HUGE = 1_000_000
UNPACKED = 20_000_000
PAGE = "<html><body>This is a proxy. Please log in.</body></html>"


class Fault(Enum):
    """Ways in which the server misbehaves."""

    TOO_MANY = auto()
    TOO_MANY_FOR_A_WHILE = auto()
    NO_MONEY = auto()
    SERVER_ERROR = auto()
    SLOW = auto()
    STALLED = auto()
    HUNG_UP = auto()
    CUT = auto()
    CUT_IN_ORDER = auto()
    ERROR_IN_STREAM = auto()
    INVALID_JSON = auto()
    NOTHING = auto()
    WRONG_TYPE = auto()
    UNAUTHORIZED = auto()
    NOT_FOUND = auto()
    TOO_LONG = auto()
    EMPTY = auto()
    WITHOUT_CODE = auto()
    HUGE = auto()
    DRIP = auto()
    COMPRESSED = auto()
    COMPRESSED_ERROR = auto()
    ENDLESS = auto()
    TOOL_CALL = auto()
    REFUSAL = auto()
    FILTERED = auto()


REFUSALS: dict[Fault | None, tuple[int, str, str | None]] = {
    Fault.TOO_MANY: (429, "Too many requests.", "rate_limit_exceeded"),
    Fault.TOO_MANY_FOR_A_WHILE: (429, "Too many requests.", "rate_limit_exceeded"),
    Fault.NO_MONEY: (429, "You exceeded your current quota.", "insufficient_quota"),
    Fault.SERVER_ERROR: (500, "Something went wrong.", None),
    Fault.UNAUTHORIZED: (401, "Incorrect API key provided: {key}.", "invalid_api_key"),
    Fault.NOT_FOUND: (404, "The model does not exist.", "model_not_found"),
    Fault.FILTERED: (400, "The prompt triggered the content policy.", "content_filter"),
    Fault.TOO_LONG: (400, "The maximum context length is 2048 tokens.", "context_length_exceeded"),
}
CALL = {"name": "go_to", "arguments": '{"location": "kitchen"}'}
REFUSAL = "I can't help with weapons."
BODIES: dict[Fault | None, tuple[bytes, str]] = {
    Fault.NOTHING: (b"", "text/event-stream"),
    Fault.WRONG_TYPE: (PAGE.encode(), "text/html"),
}
BOMB = gzip.compress(b" " * UNPACKED, 1)
TOO_MUCH: dict[Fault | None, tuple[int, bytes, str]] = {
    Fault.COMPRESSED: (200, BOMB, "gzip"),
    Fault.COMPRESSED_ERROR: (400, BOMB, "gzip"),
    Fault.ENDLESS: (200, b"data: " * 100_000, "identity"),
}


@dataclass(frozen=True)
class Request:
    """A request that the server received.

    Args:
        path: the path below the base URL, for example `/chat/completions`.
        headers: the headers, with names in lower case.
        body: the parsed JSON.
        at: when it arrived, in seconds of the monotonic clock.
    """

    path: str
    headers: dict[str, str]
    body: dict[str, Any]
    at: float = field(default_factory=time.monotonic)

    @property
    def is_chat(self) -> bool:
        return self.path.startswith("/chat")


def program(request: Request) -> str:
    """Reply with a program that says the seed of the request."""
    body = f'    go_to("lobby")\n    say("reply {request.body.get("seed", 0)}")\n'
    return f"Here it is.\n\n```python\n{TASK}{body}```\n" if request.is_chat else body


@dataclass
class Server:
    """A server in a thread of its own.

    Args:
        answer: returns the model's reply to a request.
        fault: chooses how it misbehaves at a request once `faults` is empty.
        retry_after: the value of `Retry-After`, in seconds.
        delay: the seconds that a slow reply takes.
        pause: the seconds that any reply takes.
        counts: whether it reports how many tokens it used.
        limits: whether it cuts off replies at the limit of a request.
        sends: returns status, headers and body to send instead of its own answer, or None.
    """

    answer: Callable[[Request], str] = program
    fault: Callable[[Request], Fault | None] = lambda _request: None
    retry_after: float | str = 1
    delay: float = 30.0
    pause: float = 0.0
    counts: bool = True
    limits: bool = False
    sends: Callable[[Request], tuple[int, dict[str, str], bytes] | None] = lambda _request: None
    faults: deque[Fault | None] = field(default_factory=deque)
    """The faults of the next requests."""
    requests: list[Request] = field(default_factory=list)
    """All requests so far."""
    open: int = 0
    """The number of requests in progress."""
    most_open: int = 0
    url: str = ""

    def __enter__(self) -> Self:
        self._loop = asyncio.new_event_loop()
        started = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(started,), daemon=True)
        self._thread.start()
        started.wait()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._loop.call_soon_threadsafe(self._main.cancel)
        self._thread.join()

    def _run(self, started: threading.Event) -> None:
        self._main = self._loop.create_task(self._serve(started))
        with contextlib.suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._main)
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(self._wait_for_tasks())
        self._loop.close()

    async def _serve(self, started: threading.Event) -> None:
        server = await asyncio.start_server(self._serve_client, "127.0.0.1", 0)
        self.url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/v1"
        started.set()
        try:
            await asyncio.Event().wait()
        finally:
            server.close()  # Do not wait: clients may keep their connections.

    @staticmethod
    async def _wait_for_tasks() -> None:
        """Wait until the other tasks have ended and their connections are closed."""
        others = asyncio.all_tasks() - {asyncio.current_task()}
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.sleep(0)

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError, asyncio.CancelledError):
            while await self._answer_one(reader, writer):
                await writer.drain()
        writer.close()

    async def _answer_one(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Answer a request; return whether the connection stays open."""
        first, *lines = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines)}
        body = json.loads(await reader.readexactly(int(headers.get("content-length", 0))) or b"{}")
        request = Request(first.split()[1].removeprefix("/v1"), headers, body)
        fault = self.faults.popleft() if self.faults else self.fault(request)
        self.requests.append(request)
        self.open += 1
        self.most_open = max(self.most_open, self.open)
        try:
            return await _Answer(self, request, fault, writer).send()
        finally:
            self.open -= 1


@dataclass
class _Answer:
    server: Server
    request: Request
    fault: Fault | None
    writer: asyncio.StreamWriter

    async def send(self) -> bool:
        """Answer; return whether the connection stays open."""
        if (sent := self.server.sends(self.request)) is not None:
            status, headers, body = sent
            kind = headers.pop("Content-Type", "text/event-stream")
            extra = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
            return self._send_body(status, body, kind, extra)
        if not self.request.body:  # of a page, say, whose own server had this port before
            return self._refuse(404, "there is no such page", None)
        return await self._send_own()

    async def _send_own(self) -> bool:
        if self.fault is Fault.HUNG_UP:
            return False
        if self.fault in REFUSALS:
            return self._refuse(*REFUSALS[self.fault])
        if self.fault in TOO_MUCH:
            status, body, coding = TOO_MUCH[self.fault]
            return self._send_body(status, body, "text/event-stream", f"Content-Encoding: {coding}\r\n")
        if self.fault in BODIES:
            return self._send_body(200, *BODIES[self.fault])
        await asyncio.sleep(self.server.delay if self.fault is Fault.SLOW else self.server.pause)
        if self.request.body.get("stream"):
            return await self._stream()
        whole = json.dumps(self._object(self._text(), self._reason()) | {"usage": self._usage()}).encode()
        return self._send_body(
            200, whole[:40] if self.fault is Fault.INVALID_JSON else whole, "application/json"
        )

    def _text(self) -> str:
        match self.fault:
            case Fault.EMPTY | Fault.TOOL_CALL | Fault.REFUSAL:
                return ""
            case Fault.WITHOUT_CODE:
                return "I am afraid that I cannot help with that."
            case Fault.HUGE:
                return ("    say('again')\n" * HUGE)[:HUGE]
        return self.server.answer(self.request)[: self._limit()]

    def _limit(self) -> int | None:
        """Return the most characters that a reply may have."""
        body = self.request.body
        tokens = body.get("max_completion_tokens") or body.get("max_tokens")
        return 4 * tokens if self.server.limits and tokens else None

    def _reason(self) -> str:
        """Return why the reply ends."""
        if self.fault is Fault.TOOL_CALL:
            return "tool_calls"
        limit = self._limit()
        is_cut_off = limit is not None and len(self.server.answer(self.request)) > limit
        return "length" if is_cut_off else "stop"

    def _refuse(self, status: int, message: str, code: str | None) -> bool:
        key = self.request.headers.get("authorization", "")
        error = {"message": message.format(key=key), "type": "error", "param": None, "code": code}
        again = f"Retry-After: {self.server.retry_after}\r\n"
        extra = again if self.fault is Fault.TOO_MANY_FOR_A_WHILE else ""
        return self._send_body(status, json.dumps({"error": error}).encode(), "application/json", extra)

    def _send_body(self, status: int, body: bytes, kind: str, extra: str = "") -> bool:
        self._send_head(status, kind, f"Content-Length: {len(body)}\r\n{extra}")
        self.writer.write(body)
        return True

    def _send_head(self, status: int, kind: str, extra: str) -> None:
        # A careless server sends the key back.
        echo = f"X-Echo: {self.request.headers.get('authorization', '')}\r\n"
        self.writer.write(f"HTTP/1.1 {status} X\r\nContent-Type: {kind}\r\n{echo}{extra}\r\n".encode())

    async def _stream(self) -> bool:
        self._send_head(200, "text/event-stream", "Transfer-Encoding: chunked\r\n")
        async for event in self._events():
            data = f"data: {event}\n\n".encode()
            self.writer.write(b"%x\r\n%s\r\n" % (len(data), data))
            await self.writer.drain()
        if self.fault is Fault.CUT:
            return False
        self.writer.write(b"0\r\n\r\n")
        return True

    async def _events(self) -> AsyncIterator[str]:
        pieces = [*self._pieces()]
        for number, piece in enumerate(pieces):
            if number == len(pieces) // 2:
                match self.fault:
                    case Fault.CUT | Fault.CUT_IN_ORDER:
                        return
                    case Fault.INVALID_JSON:
                        yield '{"choices": [{"te'
                    case Fault.ERROR_IN_STREAM:
                        yield json.dumps({"error": {"message": "The engine died.", "code": 500}})
                        return
                    case Fault.STALLED:
                        await asyncio.sleep(self.server.delay)
                    case Fault.DRIP:
                        while True:
                            yield json.dumps(self._object(piece, None))
                            await asyncio.sleep(DRIP)
            yield json.dumps(self._object(piece, None))
        yield json.dumps(self._object("", self._reason()))
        if self.server.counts and self.request.body.get("stream_options", {}).get("include_usage"):
            yield json.dumps(self._object("", None) | {"choices": [], "usage": self._usage()})
        yield "[DONE]"

    def _pieces(self) -> Iterator[str]:
        text = self._text()
        size = max(CHUNK, len(text) // 64)
        for start in range(0, len(text), size):
            yield text[start : start + size]

    def _object(self, text: str, finish_reason: str | None) -> dict[str, Any]:
        streamed = bool(self.request.body.get("stream"))
        choice: dict[str, Any] = {"index": 0, "finish_reason": finish_reason, "logprobs": None}
        if self.request.is_chat:
            kind = "chat.completion.chunk" if streamed else "chat.completion"
            choice["delta" if streamed else "message"] = {"role": "assistant", "content": text} | self._more()
        else:
            kind = "text_completion"
            choice["text"] = text
        model = self.request.body.get("model", "")
        return {"id": "1", "object": kind, "created": 1_700_000_000, "model": model, "choices": [choice]}

    def _more(self) -> dict[str, Any]:
        """Return the parts of a message other than text."""
        match self.fault:
            case Fault.TOOL_CALL:
                return {"tool_calls": [{"index": 0, "id": "1", "type": "function", "function": CALL}]}
            case Fault.REFUSAL:
                return {"refusal": REFUSAL}
        return {}

    def _usage(self) -> dict[str, int]:
        asked, said = len(json.dumps(self.request.body)) // 4, len(self._text()) // 4
        return {"prompt_tokens": asked, "completion_tokens": said, "total_tokens": asked + said}


def main() -> None:
    with Server() as server:
        print(server.url, flush=True)  # noqa: T201 - the parent process waits for this line
        sys.stdin.read()


if __name__ == "__main__":
    main()
