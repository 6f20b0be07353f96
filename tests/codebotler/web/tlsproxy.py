"""A reverse proxy that speaks TLS to browsers and HTTP to a page, as nginx and Caddy do."""

from __future__ import annotations

import asyncio
import ipaddress
import re
import ssl
import threading
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Self

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

REQUEST_LINE = re.compile(rb"^(\S+) (\S+) ")
HOST = re.compile(rb"^host:.*$", re.IGNORECASE | re.MULTILINE)
CONNECTION = re.compile(rb"^connection:(?! *upgrade)[^\r]*\r\n", re.IGNORECASE | re.MULTILINE)


def write_certificate(folder: Path) -> Path:
    """Write a certificate for this machine that is signed by its own key, with the key."""
    key, name = (
        ec.generate_private_key(ec.SECP256R1()),
        x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "test")]),
    )
    names = [x509.DNSName("localhost"), x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]
    now = datetime.now(UTC)
    signed = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .sign(key, hashes.SHA256())
    )
    form = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    path = folder / "proxy.pem"
    path.write_bytes(key.private_bytes(*form) + signed.public_bytes(serialization.Encoding.PEM))
    return path


class TLSProxy:
    """The proxy, on a thread of its own. As a context manager, it ends the thread.

    Args:
        folder: the folder for its certificate.
        inner: returns the port of the page, once the page has started.
        prefix: the path at which it offers the page; other paths get 404.
        strips: whether it removes the prefix before it passes a request on.
        passes_host: whether it passes `Host` on.
    """

    def __init__(
        self,
        folder: Path,
        inner: Callable[[], int],
        prefix: str = "",
        *,
        strips: bool = False,
        passes_host: bool = True,
    ) -> None:
        self._inner, self._prefix, self._strips, self._passes_host = (
            inner,
            prefix.encode(),
            strips,
            passes_host,
        )
        self._tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._tls.load_cert_chain(write_certificate(folder))
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self.port = 0

    def __enter__(self) -> Self:
        self._thread.start()
        self._server = asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result(30)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    def __exit__(self, *_: object) -> None:
        asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(30)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(30)
        self._loop.close()

    @property
    def address(self) -> str:
        """The address that browsers open, without a slash at the end."""
        return f"https://localhost:{self.port}{self._prefix.decode()}"

    async def _listen(self) -> asyncio.Server:
        return await asyncio.start_server(self._serve, "127.0.0.1", 0, ssl=self._tls)

    async def _end(self) -> None:
        self._server.close()
        while others := asyncio.all_tasks() - {asyncio.current_task()}:  # A handshake may begin one.
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Pass one request on, and after an upgrade all that follows."""
        with suppress(OSError, asyncio.IncompleteReadError):
            try:
                head = self._rewrite_head(await reader.readuntil(b"\r\n\r\n"))
                if head is None:
                    writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                    return
                inside, outside = await asyncio.open_connection("127.0.0.1", self._inner())
                outside.write(head)
                up = asyncio.create_task(_copy(reader, outside))
                try:
                    await _copy(inside, writer)
                finally:
                    up.cancel()
                    outside.close()
            finally:
                writer.close()

    def _rewrite_head(self, head: bytes) -> bytes | None:
        """Return the head of a request for the page, or None for another path."""
        method, target = REQUEST_LINE.findall(head)[0]
        path = target.partition(b"?")[0]
        if path != self._prefix and not path.startswith(self._prefix + b"/"):
            return None
        inner = (target[len(self._prefix) :] or b"/") if self._strips else target
        head = head.replace(method + b" " + target, method + b" " + inner, 1)
        if not self._passes_host:
            head = HOST.sub(b"Host: 127.0.0.1:%d\r" % self._inner(), head)
        head = CONNECTION.sub(b"", head)
        if b"upgrade:" not in head.lower():
            head = head.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n", 1)
        return head


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while piece := await reader.read(65_536):
            writer.write(piece)
            await writer.drain()
