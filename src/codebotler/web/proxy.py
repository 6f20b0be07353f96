"""Addresses of the page behind a reverse proxy, and requests as the browser sent them to it."""

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
from codebotler.models.chosen import ConfigFile

ORIGIN = re.compile(
    r"(?P<scheme>https?)://(?P<host>[a-z0-9._-]+|\[[0-9a-f:.]+\])(?::0*(?P<port>[1-9]\d{0,4}))?"
    r"(?P<prefix>(?:/(?!\.{1,2}(?:/|$))[\w.~-]+)*)/?",
    re.IGNORECASE | re.ASCII,
)
PORTS: Mapping[str, str] = {"https": "443", "http": "80"}
SECURE: Mapping[str, str] = {"http": "https", "ws": "wss"}
FORWARDED_PREFIX = b"x-forwarded-prefix"  # NiceGUI would add it to the prefix, which the option names
LONGEST = 80  # characters of a wrong address that a message quotes


@dataclass(frozen=True)
class OuterAddress:
    """The address of the page in front of a reverse proxy.

    Args:
        scheme: https or http.
        host: name and port, as browsers write it in `Host`; without the scheme's own port.
        prefix: the path at which the proxy offers the page, such as /robot, or empty.
    """

    scheme: str
    host: str
    prefix: str = ""

    @classmethod
    def parse(cls, text: str) -> OuterAddress:
        """The address that a text names, such as https://host:8443/robot.

        Raises:
            UserError: it is none.
        """
        address = cls.found_in(text)
        if address is None:
            quoted = f'"{elide_middle(text, LONGEST)}" is no address of a proxy'
            raise UserError(f"{quoted}; write https://HOST, with :PORT and /PATH if it has them")
        return address

    @classmethod
    def found_in(cls, text: str) -> OuterAddress | None:
        """The address that a text names; None if it names none."""
        found = ORIGIN.fullmatch(text)
        if found is None:
            return None
        scheme, port = found["scheme"].lower(), found["port"]
        suffix = "" if port in {None, PORTS[scheme]} else f":{port}"
        return cls(scheme, found["host"].lower() + suffix, found["prefix"])

    @property
    def name(self) -> str:
        """The name of the host, or its address, without a port."""
        return name_of(self.host)

    @property
    def origin(self) -> str:
        """What browsers send as `Origin`."""
        return f"{self.scheme}://{self.host}"

    @property
    def page(self) -> str:
        """The address of the first page."""
        return f"{self.origin}{self.prefix}/"

    def seen_from_outside(self, scope: Scope) -> dict[str, Any]:
        """A request that the proxy passed on, with the scheme and the path that the browser sent.

        It does not matter whether the proxy removed the prefix from the path.
        """
        path, raw = scope["path"], scope.get("raw_path") or b""
        if self.prefix and path != self.prefix and not path.startswith(f"{self.prefix}/"):
            path, raw = self.prefix + path, self.prefix.encode() + raw
        if path == self.prefix:
            path, raw = f"{path}/", raw + b"/"
        headers = [(name, value) for name, value in scope["headers"] if name != FORWARDED_PREFIX]
        secure = SECURE.get(scope["scheme"], scope["scheme"]) if self.scheme == "https" else scope["scheme"]
        return {
            **scope,
            "path": path,
            "raw_path": raw,
            "root_path": self.prefix,
            "headers": headers,
            "scheme": secure,
        }


def outer_addresses(texts: Iterable[str]) -> tuple[OuterAddress, ...]:
    """The addresses that texts name, each once.

    Raises:
        UserError: one is no address, or two have the same host.
    """
    found = tuple(dict.fromkeys(map(OuterAddress.parse, texts)))
    hosts = [address.host for address in found]
    for address in found:
        if hosts.count(address.host) > 1:
            raise UserError(f"--behind-proxy names {address.host} twice; one address for each host and port")
    return found


def proxies_in_front(given: Sequence[str] | None) -> tuple[OuterAddress, ...]:
    """The addresses that the command line names, or else those of config.yaml.

    Args:
        given: what the command line names.

    Raises:
        UserError: one is no address, two have the same host, or config.yaml is wrong.
    """
    file = config_file()
    if given or file is None or not file.is_file():
        return outer_addresses(given or ())
    config = YamlFile.read(file)
    try:
        return outer_addresses(config.validate(ConfigFile).behind_proxy)
    except UserError as error:
        raise error if error.file else config.wrong(error.sentence, "behind_proxy") from None


def by_host(addresses: Iterable[OuterAddress]) -> Mapping[str, OuterAddress]:
    """Addresses by what `Host` may say: some clients write the scheme's own port, too."""
    found: dict[str, OuterAddress] = {}
    for address in addresses:
        found[address.host] = address
        if ":" not in address.host.rpartition("]")[2]:
            found[f"{address.host}:{PORTS[address.scheme]}"] = address
    return MappingProxyType(found)


def name_of(host: str) -> str:
    """A host without its port, and without the brackets of a numeric address."""
    bare = host[: host.rindex("]") + 1] if "]" in host else host.partition(":")[0]
    return bare.strip("[]")


def prefix_of(scope: Mapping[str, Any]) -> str:
    """The path at which the proxy offers the page; empty without one."""
    prefix: str = scope.get("app_root_path", scope.get("root_path", ""))  # a mounted app has its own root
    return prefix


def path_of(scope: Mapping[str, Any]) -> str:
    """The path of a request, without the prefix of a proxy."""
    path: str = scope["path"]
    return path.removeprefix(prefix_of(scope))
