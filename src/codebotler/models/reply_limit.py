"""A limit on the bytes a server may send for one request, counted as they arrive, after decompression."""

from __future__ import annotations

import zlib
from collections.abc import AsyncIterator
from typing import Any, TypeVar

from codebotler.models.base import ModelError

Client = TypeVar("Client", bound=Any)  # of httpx or httpx2, which share no type

FLOOR = 8_000_000  # bytes
PER_TOKEN = 4_000  # bytes; a piece of a stream holds much more than its token
PIECE = 65_536  # bytes
GZIP = ("gzip", "x-gzip")
PACKED = (*GZIP, "deflate", "br", "zstd")  # what the libraries would unpack, however much comes out


def limit_of(max_tokens: int) -> int:
    """The bytes that a reply of so many tokens may have, generously."""
    return max(FLOOR, PER_TOKEN * max_tokens)


def bound(client: Client, name: str, limit: int) -> Client:
    """Limit the bytes that a client of HTTP takes for any request of a model, and return the client.

    Whoever reads more gets a ModelError that does not pass.
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
    # Each library takes only streams of its own class.
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
    """The content of a gzip stream in small pieces, each unpacked only when it is taken."""
    unpacker = zlib.decompressobj(zlib.MAX_WBITS | 16)  # 16: with the header of gzip
    async for packed in stream:
        rest, piece = packed, b""
        while (rest or len(piece) == PIECE) and not unpacker.eof:
            try:
                piece = unpacker.decompress(rest, PIECE)
            except zlib.error:
                raise ModelError(f"{name}: the server sent invalid gzip", may_pass=True) from None
            yield piece
            rest = unpacker.unconsumed_tail
