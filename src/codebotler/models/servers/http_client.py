"""Configure HTTP clients to limit replies, refuse redirects, and use no proxies for local servers."""

from __future__ import annotations

import ipaddress
import json
import os
from collections.abc import AsyncIterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError
from codebotler.models.keys import hide_variables, redact
from codebotler.models.servers.server_errors import FIRST_ERROR, error_in_reply, error_text, model_error

HTTPClient = TypeVar("HTTPClient", bound=Any)  # of httpx or httpx2, which share no type

MIN_REPLY_BYTES = 8_000_000
BYTES_PER_TOKEN = 4_000  # each event of a stream is much longer than its token
ASSUMED_TOKENS = 100_000  # assumed for replies without a limit
CERTIFICATE_VARIABLES = ("SSL_CERT_FILE", "SSL_CERT_DIR")


def byte_limit(max_tokens: int | None) -> int:
    """Return a generous limit, in bytes, for a reply of up to `max_tokens` tokens (None for no limit)."""
    return max(MIN_REPLY_BYTES, BYTES_PER_TOKEN * (max_tokens or ASSUMED_TOKENS))


def limit_replies(client: HTTPClient, name: str, limit: int) -> HTTPClient:
    """Let an HTTP client accept at most `limit` bytes per reply of the model `name`. Return the client.

    The client raises ModelError for a longer reply, a compressed reply (which could expand without limit), a
    redirect (which could send the key to another server), and an error sent as JSON instead of a stream.
    """

    async def check(response: Any) -> None:  # noqa: ANN401 - see HTTPClient
        coding = response.headers.get("content-encoding", "identity")
        if coding != "identity":
            sentence = f"{name}: the server compressed its reply ({coding}); turn off its compression"
            raise ModelError(sentence, is_temporary=False)
        response.stream = _limit_stream(response.stream, name, limit)
        if response.has_redirect_location:
            # Leave out parts that may be secret.
            target = response.url.join(response.headers["location"])
            address = target.copy_with(userinfo=b"", query=None, fragment=None)
            sentence = f"{name}: the server redirects to {address}; change the base URL accordingly"
            raise ModelError(sentence, is_temporary=False)
        is_json = response.headers.get("content-type", "").startswith("application/json")
        if is_json and response.status_code < FIRST_ERROR and b'"stream":true' in response.request.content:
            raise _error_instead_of_stream(name, await response.aread())

    client.follow_redirects = False
    client.headers["accept-encoding"] = "identity"
    client.event_hooks["response"].append(check)
    return client


def _error_instead_of_stream(name: str, body: bytes) -> ModelError:
    try:
        reply = json.loads(body)
    except (ValueError, RecursionError):
        reply = None
    if isinstance(reply, dict) and reply.get("choices") is None:
        return error_in_reply(name, reply.get("error") or reply)
    sentence = "the server sent its reply in one piece, but only streams are supported"
    return model_error(name, sentence, is_temporary=False)


def _limit_stream(stream: Any, name: str, limit: int) -> Any:  # noqa: ANN401 - see HTTPClient
    # Each library accepts only streams of its own class.
    base = next(kind for kind in type(stream).__mro__ if kind.__name__ == "AsyncByteStream")

    class LimitedStream(base):  # type: ignore[misc,valid-type]  # one of two classes
        async def __aiter__(self) -> AsyncIterator[bytes]:
            remaining = limit
            async for piece in stream:
                remaining -= len(piece)
                if remaining < 0:
                    sentence = f"{name}: the server sent more than {limit:,} bytes for one reply"
                    raise ModelError(sentence, is_temporary=False)
                yield piece

        async def aclose(self) -> None:
            await stream.aclose()

    return LimitedStream()


# --- proxies


def without_proxy(url: str | None) -> AbstractContextManager[None]:
    """Return a context in which new HTTP clients use no proxy if `url` is on this machine."""
    is_local = url is not None and _is_loopback(urlsplit(url).hostname or "")
    return hide_variables([name for name in os.environ if is_local and name.lower().endswith("_proxy")])


def mention_proxy(error: ModelError, url: str | None) -> ModelError:
    """Add the proxy that requests to `url` use, if any, to the error's sentence. Return the same error."""
    parts = urlsplit(url or "https://provider.invalid")
    host = parts.hostname or ""
    proxies = getproxies()
    proxy = proxies.get(parts.scheme) or proxies.get("all")
    if proxy is None or _is_loopback(host) or proxy_bypass(host):
        return error
    shown = urlsplit(proxy if "://" in proxy else f"http://{proxy}")
    port = f":{shown.port}" if shown.port else ""
    error.sentence += f" (through the proxy {redact(f'{shown.scheme}://{shown.hostname}{port}')})"
    error.args = (error.sentence,)
    return error


def _is_loopback(host: str) -> bool:
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
    return address.is_loopback or address.is_unspecified


def opening_error(name: str, error: Exception) -> UserError:
    """Build the error for a model whose HTTP client cannot be created, such as for an invalid proxy."""
    for variable in CERTIFICATE_VARIABLES:
        if (path := os.environ.get(variable)) and not Path(path).exists():
            return UserError(f"{name} cannot be used: {variable} names {path}, which does not exist")
    return UserError(f"{name} cannot be used: {error_text(error)}")
