"""Decode streams of OpenAI's protocol, even from servers that deviate from it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any, TypeVar

import openai
from openai._streaming import ServerSentEvent, SSEDecoder

OpenAIClient = TypeVar("OpenAIClient", bound=openai.AsyncOpenAI)
ERROR_FIELD = "error: "
FAILURE_REASONS = {"abort", "error", "insufficient_system_resource"}  # finish reasons that mean a failure


class LenientDecoder(SSEDecoder):
    """A decoder of server-sent events that skips events without data. `is_done` is True after `[DONE]`."""

    is_done = False

    def decode(self, line: str) -> ServerSentEvent | None:
        """Return the event that a line completes, or None if there is no event or it has no data."""
        if line.startswith(ERROR_FIELD):  # a nonstandard field of llama.cpp
            line = f'data: {{"error": {line.removeprefix(ERROR_FIELD)}}}'
        event = super().decode(line)
        if event is None or not event.data:
            return None
        self.is_done = self.is_done or event.data.startswith("[DONE]")
        return event


def make_lenient(client: OpenAIClient) -> OpenAIClient:
    """Make a client and its copies accept streams that deviate from the protocol. Return the client."""
    kind = type(client)
    client.__class__ = type(kind.__name__, (kind,), {"_make_sse_decoder": lambda _client: LenientDecoder()})
    return client


class Chunks:
    """Iterates over the chunks of a stream, and collects the usage and the finish reason.

    Servers report usage in the last chunk or cumulatively in each, so the last report counts. Some send a
    last chunk without `delta`, or only `[DONE]` instead of a finish reason.
    """

    def __init__(self, stream: Any) -> None:  # noqa: ANN401 - of chat or text completions, or a wrapper
        self._stream = stream
        self.source = getattr(stream, "source", stream)  # pydantic-ai closes the source
        self.usage: Any = None
        self.finish_reason: str | None = None
        self.error: object = None  # an error body that came instead of a chunk
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
        """Whether the server has marked the end of the reply, with a finish reason or `[DONE]`."""
        if not self._has_choice or self.finish_reason in FAILURE_REASONS:
            return False
        return bool(self.finish_reason) or bool(getattr(self.source._decoder, "is_done", False))  # noqa: SLF001 - no public way
