"""A limit on the bytes that a server may send for one request, counted as they arrive."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any, TypeVar

from codebotler.models.base import ModelError

Client = TypeVar("Client", bound=Any)  # of httpx or httpx2, which share no type

FLOOR = 8_000_000  # bytes
PER_TOKEN = 4_000  # bytes; a piece of a stream holds much more than its token


def limit_of(max_tokens: int) -> int:
    """The bytes that a reply of so many tokens may have, generously."""
    return max(FLOOR, PER_TOKEN * max_tokens)


def bound(client: Client, name: str, limit: int) -> Client:
    """Limit the bytes that a client of HTTP takes for any request of a model, and return the client.

    Replies are requested without compression, and compressed ones are refused: a few bytes of them could
    become any number. Both raise a ModelError that does not pass.
    """

    async def bounded(response: Any) -> None:  # noqa: ANN401 - see Client
        coding = response.headers.get("content-encoding", "identity")
        if coding != "identity":
            sentence = f"{name}: the server compressed its reply ({coding}), which was not requested"
            raise ModelError(sentence, may_pass=False)
        response.stream = _stream(response.stream, name, limit)

    client.headers["accept-encoding"] = "identity"
    client.event_hooks["response"].append(bounded)
    return client


def _stream(stream: Any, name: str, limit: int) -> Any:  # noqa: ANN401 - see Client
    # Each library takes only streams of its own class.
    theirs = next(base for base in type(stream).__mro__ if base.__name__ == "AsyncByteStream")

    class Bounded(theirs):  # type: ignore[misc,valid-type]  # one of two classes
        async def __aiter__(self) -> AsyncIterator[bytes]:
            left = limit
            async for piece in stream:
                left -= len(piece)
                if left < 0:
                    raise ModelError(
                        f"{name}: the server sent more than {limit:,} bytes for one reply", may_pass=False
                    )
                yield piece

        async def aclose(self) -> None:
            await stream.aclose()

    return Bounded()
