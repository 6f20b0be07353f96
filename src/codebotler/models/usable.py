"""Which models can be asked here and now: keys that are set, servers on this machine, recorded programs."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from threading import Thread
from time import monotonic

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from codebotler.models.keys import key_in
from codebotler.models.recorded import NAMES, is_recorded

SERVERS: Mapping[str, int] = {"Ollama": 11434, "LM Studio": 1234, "vLLM": 8000, "llama.cpp": 8080}
"""Servers of models with the ports at which they listen by default; each knows OpenAI's protocol."""

KEYS: Mapping[str, str] = {
    "OPENAI_API_KEY": "openai-chat:gpt-5.1",
    "ANTHROPIC_API_KEY": "anthropic:claude-sonnet-4-5",
    "GOOGLE_API_KEY": "google:gemini-3-pro",
}
"""Variables that hold a key, each with a model that it opens."""

PATIENCE_S, LONGEST_LIST = 0.5, 1_000_000  # bytes that a server may list
SETUP = "set OPENAI_API_KEY or another provider's key, or start a model server such as Ollama"


@dataclass(frozen=True)
class UsableModel:
    """A model that can be asked.

    Args:
        name: as `--model` takes it.
        why: what makes it usable, such as `OPENAI_API_KEY is set`.
        base_url: as `--base-url` takes it; None where it needs none.
    """

    name: str
    why: str
    base_url: str | None = None

    @property
    def is_recorded(self) -> bool:
        """Whether no language model stands behind it."""
        return is_recorded(self.name)

    @property
    def options(self) -> str:
        """The options that choose it, for a shell."""
        server = "" if self.base_url is None else f" --base-url {self.base_url}"
        return f"--model {shlex.quote(visible(self.name))}{server}"


def usable_models(servers: Mapping[str, int] = SERVERS) -> list[UsableModel]:
    """The models of servers on this machine, then an example for each key, then the recorded ones."""
    listed: dict[str, list[UsableModel]] = {}

    def ask(server: str) -> None:
        listed[server] = _served(server, servers[server])

    asking = [Thread(target=ask, args=(server,), daemon=True) for server in servers]
    for thread in asking:
        thread.start()
    until = monotonic() + 2 * PATIENCE_S  # some servers trickle
    for thread in asking:
        thread.join(max(0.0, until - monotonic()))
    served = [model for server in servers for model in listed.get(server, ())]
    keyed = [UsableModel(name, f"{key} is set") for key, name in KEYS.items() if _is_set(key)]
    recorded = [UsableModel(f"recorded:{name}", "written by hand, for known instructions") for name in NAMES]
    return [*served, *keyed, *recorded]


def how_to_use_a_model(servers: Mapping[str, int] = SERVERS) -> str:
    """The options for the first model that is found here, or else how to get one."""
    first = usable_models(servers)[0]
    return SETUP if first.is_recorded else f"add {first.options}"


def _is_set(key: str) -> bool:
    try:
        return key_in(key) is not None
    except UserError:  # no header can hold it
        return False


def _served(server: str, port: int) -> list[UsableModel]:
    """What a server lists; nothing where none answers, or where it is something else."""
    connection = HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
    try:
        connection.request("GET", "/v1/models", headers={"Accept": "application/json"})
        listed = json.loads(connection.getresponse().read(LONGEST_LIST))
        names = [str(one["id"]) for one in listed["data"]]
    except (OSError, HTTPException, ValueError, LookupError, TypeError, RecursionError):
        return []
    finally:
        connection.close()
    url = f"http://127.0.0.1:{port}/v1"
    return [
        UsableModel(f"openai-chat:{name}", f"{server} answers on this machine", url)
        for name in names
        if "embed" not in name
    ]
