"""Streams of servers that speak OpenAI's protocol, some of them loosely."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any, TypeVar

import openai
from openai._streaming import ServerSentEvent, SSEDecoder

Client = TypeVar("Client", bound=openai.AsyncOpenAI)
ERROR = "error: "
FAILED = {"abort", "error", "insufficient_system_resource"}  # reasons for the end that are failures


class LenientDecoder(SSEDecoder):
    """A decoder that skips events without data, which the protocol allows, and remembers the last mark."""

    is_done = False

    def decode(self, line: str) -> ServerSentEvent | None:
        """The event that a line completes; None if it completes none, or one without data."""
        if line.startswith(ERROR):  # a field of llama.cpp's, which no standard has
            line = f'data: {{"error": {line.removeprefix(ERROR)}}}'
        event = super().decode(line)
        if event is None or not event.data:
            return None
        self.is_done = self.is_done or event.data.startswith("[DONE]")
        return event


def make_lenient(client: Client) -> Client:
    """Have a client decode streams leniently, and also each copy that a library makes of it."""
    theirs = type(client)
    client.__class__ = type(
        theirs.__name__, (theirs,), {"_make_sse_decoder": lambda _client: LenientDecoder()}
    )
    return client


class Chunks:
    """The chunks of a stream, with what they say of the end and of tokens.

    Servers count tokens in the last chunk, or up to now in each; so the last count is right. Some send a last
    chunk without `delta`, or no reason for the end but the mark `[DONE]`.
    """

    def __init__(self, stream: Any) -> None:  # noqa: ANN401 - of chat or text completions, or a wrapper of it
        self._stream = stream
        self.source = getattr(stream, "source", stream)  # which pydantic-ai closes
        self.usage: Any = None
        self.finish_reason: str | None = None
        self.error: object = None  # what came in the place of a chunk
        self._has_choice = False

    async def __aiter__(self) -> AsyncIterator[Any]:
        async for chunk in self._stream:
            self.usage = chunk.usage or self.usage
            chunk.usage = None
            if chunk.choices is None and self.usage is None and chunk.model_extra:
                self.error = dict(chunk.model_extra)
            for choice in chunk.choices or ():
                self._has_choice = True
                if choice.finish_reason is not None:
                    self.finish_reason = self.finish_reason or choice.finish_reason
            yield chunk

    @property
    def is_whole(self) -> bool:
        """Whether the server said that the reply has ended, in whatever words."""
        if not self._has_choice or self.finish_reason in FAILED:
            return False
        return bool(self.finish_reason) or bool(getattr(self.source._decoder, "is_done", False))  # noqa: SLF001 - no public way
