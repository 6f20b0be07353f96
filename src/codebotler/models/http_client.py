"""Clients of HTTP: bounded replies, no silent redirects, no proxy for this machine."""

from __future__ import annotations

import ipaddress
import json
import os
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError
from codebotler.models.keys import redacted
from codebotler.models.server_errors import FIRST_ERROR, error_in_reply, error_text, failure

Client = TypeVar("Client", bound=Any)  # of httpx or httpx2, which share no type

FLOOR = 8_000_000  # bytes
PER_TOKEN = 4_000  # bytes; a piece of a stream holds much more than its token
UNKNOWN_TOKENS = 100_000  # for which room is left where no limit is set
CERTIFICATES = ("SSL_CERT_FILE", "SSL_CERT_DIR")
ENDPOINTS = ("/chat/completions", "/completions", "/responses", "/messages")


def limit_of(max_tokens: int | None) -> int:
    """The bytes that a reply of so many tokens may have, generously."""
    return max(FLOOR, PER_TOKEN * (max_tokens or UNKNOWN_TOKENS))


def bound(client: Client, name: str, limit: int) -> Client:
    """Limit the bytes that a client of HTTP takes for any request of a model, and return the client.

    Replies are requested without compression, and compressed ones are refused: a few bytes of them could
    become any number. A redirect is refused with the new address, since following it would take the key to
    another server or lose the request. An error that comes as JSON although a stream was requested is raised
    in the server's words. All of these raise a ModelError.
    """

    async def check(response: Any) -> None:  # noqa: ANN401 - see Client
        coding = response.headers.get("content-encoding", "identity")
        if coding != "identity":
            sentence = f"{name}: the server compressed its reply ({coding}), which was not requested"
            raise ModelError(sentence, may_pass=False)
        response.stream = _stream(response.stream, name, limit)
        if response.has_redirect_location:
            address = _address(str(response.url.join(response.headers["location"])))
            mend = f"set the base URL to {address}"
            raise ModelError(f"{name}: the server has moved to {address}; {mend}", may_pass=False)
        is_json = response.headers.get("content-type", "").startswith("application/json")
        if is_json and response.status_code < FIRST_ERROR and b'"stream":true' in response.request.content:
            raise _error_instead_of_stream(name, await response.aread())

    client.follow_redirects = False
    client.headers["accept-encoding"] = "identity"
    client.event_hooks["response"].append(check)
    return client


def _address(url: str) -> str:
    """The base URL to which a redirect leads, without what may be a secret."""
    parts = urlsplit(url)
    path = parts.path.rstrip("/")
    for endpoint in ENDPOINTS:
        path = path.removesuffix(endpoint)
    port = f":{parts.port}" if parts.port else ""
    return f"{parts.scheme}://{parts.hostname}{port}{path}"


def _error_instead_of_stream(name: str, body: bytes) -> ModelError:
    try:
        said = json.loads(body)
    except (ValueError, RecursionError):
        said = None
    if isinstance(said, dict) and said.get("choices") is None:
        return error_in_reply(name, said.get("error") or said)
    return failure(name, "the server sent its reply in one piece; only streams are supported", may_pass=False)


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


# --- proxies


@contextmanager
def without_proxy(url: str | None) -> Iterator[None]:
    """Exempt a server on this machine from proxies, for clients that are made inside."""
    host = urlsplit(url).hostname if url is not None else None
    if host is None or not _is_loopback(host):
        yield
        return
    proxies = {name: value for name, value in os.environ.items() if name.lower().endswith("_proxy")}
    for name in proxies:
        del os.environ[name]
    try:
        yield
    finally:
        os.environ.update(proxies)


def with_proxy(error: ModelError, url: str | None) -> ModelError:
    """The error, with the proxy through which a request to a server goes, if any."""
    parts = urlsplit(url or "https://provider.invalid")
    host = parts.hostname or ""
    proxies = getproxies()
    proxy = proxies.get(parts.scheme) or proxies.get("all")
    if proxy is None or _is_loopback(host) or proxy_bypass(host):
        return error
    shown = urlsplit(proxy if "://" in proxy else f"http://{proxy}")
    port = f":{shown.port}" if shown.port else ""
    error.sentence += f" (through the proxy {redacted(f'{shown.scheme}://{shown.hostname}{port}')})"
    error.args = (error.sentence,)
    return error


def _is_loopback(host: str) -> bool:
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
    return address.is_loopback or address.is_unspecified


def cannot_open(name: str, error: Exception) -> UserError:
    """The error for a client that cannot be made: a proxy, certificates or settings are wrong."""
    for variable in CERTIFICATES:
        if (path := os.environ.get(variable)) and not Path(path).exists():
            return UserError(f"{name} cannot be used: {variable} names {path}, which does not exist")
    return UserError(f"{name} cannot be used: {error_text(error)}")
