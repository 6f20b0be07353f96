"""A limit on what a server may send for one request, counted after it is unpacked, while it comes in."""

from __future__ import annotations

import zlib
from collections.abc import AsyncIterator
from typing import Any, TypeVar

from codebotler.models.base import ModelError

Client = TypeVar("Client", bound=Any)
"""Of httpx or httpx2, which share no type."""

FLOOR = 8_000_000
PER_TOKEN = 4_000
"""Bytes of a reply for each token that it may have: a piece of a stream tells much more than its token."""

PIECE = 65_536
GZIP = ("gzip", "x-gzip")
PACKED = (*GZIP, "deflate", "br", "zstd")
"""What the libraries would unpack by themselves, however much comes out of it."""

AS_GZIP = zlib.MAX_WBITS | 16


def limit_of(max_tokens: int) -> int:
    """How many bytes a reply of so many tokens may have, generously."""
    return max(FLOOR, PER_TOKEN * max_tokens)


def bound(client: Client, name: str, limit: int) -> Client:
    """Let a client of HTTP take no more than a limit for any request, and return it.

    Where more comes, whoever reads it gets a ModelError that does not pass.

    Args:
        client: an `AsyncClient` of httpx, in whichever version a library has it.
        name: of the model.
        limit: in bytes, of an answer whether it is a reply or an error.
    """

    async def bounded(response: Any) -> None:  # noqa: ANN401 - see Client
        told = response.headers.get("content-encoding", "").lower()
        packed = [coding for part in told.split(",") if (coding := part.strip()) in PACKED]
        if packed and (len(packed) > 1 or packed[0] not in GZIP):
            raise ModelError(
                f"{name}: the server packed its reply as {', '.join(packed)}, not as gzip", may_pass=False
            )
        if packed:
            del response.headers["content-encoding"]
        response.stream = _stream(response.stream, name, limit, is_packed=bool(packed))

    client.headers["accept-encoding"] = "gzip"
    client.event_hooks["response"].append(bounded)
    return client


def _stream(stream: Any, name: str, limit: int, *, is_packed: bool) -> Any:  # noqa: ANN401 - see Client
    """A stream of the same library, since each takes only its own."""
    theirs = next(base for base in type(stream).__mro__ if base.__name__ == "AsyncByteStream")

    class Bounded(theirs):  # type: ignore[misc,valid-type]  # one of two classes
        async def __aiter__(self) -> AsyncIterator[bytes]:
            left = limit
            async for piece in _unpacked(stream, name) if is_packed else stream:
                left -= len(piece)
                if left < 0:
                    raise ModelError(
                        f"{name}: the server sent more than {limit:,} bytes for one reply", may_pass=False
                    )
                yield piece

        async def aclose(self) -> None:
            await stream.aclose()

    return Bounded()


async def _unpacked(stream: Any, name: str) -> AsyncIterator[bytes]:  # noqa: ANN401 - see Client
    """What comes out of gzip, in small pieces; nothing is unpacked before somebody takes it."""
    unpacker = zlib.decompressobj(AS_GZIP)
    async for packed in stream:
        rest, piece = packed, b""
        while (rest or len(piece) == PIECE) and not unpacker.eof:
            try:
                piece = unpacker.decompress(rest, PIECE)
            except zlib.error:
                raise ModelError(f"{name}: the server sent what is no gzip", may_pass=True) from None
            yield piece
            rest = unpacker.unconsumed_tail
