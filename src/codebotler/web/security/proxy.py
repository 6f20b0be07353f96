"""Support reverse proxies: parse the page's public addresses, and restore requests that they changed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from starlette.types import Scope

from codebotler.core.errors import UserError, elide_middle
from codebotler.core.files import config_file
from codebotler.core.yaml_files import YamlFile
from codebotler.models.open import ConfigFile

_ADDRESS = re.compile(
    r"(?P<scheme>https?)://(?P<host>[a-z0-9._-]+|\[[0-9a-f:.]+\])(?::0*(?P<port>[1-9]\d{0,4}))?"
    r"(?P<prefix>(?:/(?!\.{1,2}(?:/|$))[\w.~-]+)*)/?",
    re.IGNORECASE | re.ASCII,
)
_SCHEME_PORTS: Mapping[str, str] = {"https": "443", "http": "80"}
_SECURE_SCHEMES: Mapping[str, str] = {"http": "https", "ws": "wss"}
_FORWARDED_PREFIX = b"x-forwarded-prefix"  # NiceGUI would add it to the prefix from --behind-proxy
_MAX_QUOTED = 80  # characters


@dataclass(frozen=True)
class OuterAddress:
    """The address of the page at a reverse proxy.

    Args:
        scheme: https or http.
        host: the name and port, as in the Host header, without the scheme's default port.
        prefix: the path of the page, such as /robot; empty if there is none.
    """

    scheme: str
    host: str
    prefix: str = ""

    @classmethod
    def parse(cls, text: str) -> OuterAddress:
        """Parse an address such as https://host:8443/robot. Raise UserError if it is invalid."""
        found = _ADDRESS.fullmatch(text)
        if found is None:
            quoted = f'"{elide_middle(text, _MAX_QUOTED)}" is not the address of a proxy'
            raise UserError(f"{quoted}; write https://HOST, with :PORT and /PATH if needed")
        scheme, port = found["scheme"].lower(), found["port"]
        suffix = "" if port in {None, _SCHEME_PORTS[scheme]} else f":{port}"
        return cls(scheme, found["host"].lower() + suffix, found["prefix"])

    @property
    def name(self) -> str:
        """The name or IP address of the host, without the port."""
        bare = self.host[: self.host.rindex("]") + 1] if "]" in self.host else self.host.partition(":")[0]
        return bare.strip("[]")

    @property
    def page(self) -> str:
        """The address of the start page."""
        return f"{self.scheme}://{self.host}{self.prefix}/"

    def seen_from_outside(self, scope: Scope) -> dict[str, Any]:
        """Return a reverse proxy's request with the browser's scheme and path, such as https and `/robot`."""
        path, raw = scope["path"], scope.get("raw_path") or b""
        if self.prefix and path != self.prefix and not path.startswith(f"{self.prefix}/"):
            path, raw = self.prefix + path, self.prefix.encode() + raw
        if path == self.prefix:
            path, raw = f"{path}/", raw + b"/"
        headers = [(name, value) for name, value in scope["headers"] if name != _FORWARDED_PREFIX]
        secure = _SECURE_SCHEMES if self.scheme == "https" else {}
        return {
            **scope,
            "path": path,
            "raw_path": raw,
            "root_path": self.prefix,
            "headers": headers,
            "scheme": secure.get(scope["scheme"], scope["scheme"]),
        }


def outer_addresses(texts: Iterable[str]) -> tuple[OuterAddress, ...]:
    """Parse addresses. Raise UserError if an address is invalid or two addresses have the same host."""
    found = tuple(dict.fromkeys(map(OuterAddress.parse, texts)))
    hosts = [address.host for address in found]
    for address in found:
        if hosts.count(address.host) > 1:
            raise UserError(f"--behind-proxy names {address.host} twice; use one address per host and port")
    return found


def proxies_in_front(given: Sequence[str] | None) -> tuple[OuterAddress, ...]:
    """Parse the proxies' addresses in the options or else config.yaml. Raise UserError if one is invalid."""
    file = config_file()
    if given or file is None or not file.is_file():
        return outer_addresses(given or ())
    config = YamlFile.read(file)
    try:
        return outer_addresses(config.validate(ConfigFile).behind_proxy)
    except UserError as error:
        raise error if error.file else config.wrong(error.sentence, "behind_proxy") from None


def addresses_by_host(addresses: Iterable[OuterAddress]) -> Mapping[str, OuterAddress]:
    """Map Host headers, with and without the default port that some clients add, to the addresses."""
    found: dict[str, OuterAddress] = {}
    for address in addresses:
        found[address.host] = address
        if ":" not in address.host.rpartition("]")[2]:
            found[f"{address.host}:{_SCHEME_PORTS[address.scheme]}"] = address
    return MappingProxyType(found)


def prefix_of(scope: Mapping[str, Any]) -> str:
    """Return what precedes our paths in the browser: a proxy's prefix and, if used, the secret path."""
    prefix: str = scope.get("app_root_path", scope.get("root_path", ""))  # a mounted app changes root_path
    return prefix


def path_of(scope: Mapping[str, Any]) -> str:
    """Return the path of a request without the prefix from `prefix_of`, such as `/missions`."""
    path: str = scope["path"]
    return path.removeprefix(prefix_of(scope))
