"""Find the models that can be used now: those with an API key, on local servers, or recorded."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException

from codebotler.core.terminal import visible
from codebotler.models.recorded import RECORDED_NAMES, is_recorded

MODEL_SERVERS: Mapping[str, int] = {"Ollama": 11434, "LM Studio": 1234, "vLLM": 8000, "llama.cpp": 8080}
"""Model servers and their default ports. All of them support OpenAI's protocol."""

KEY_VARIABLES: Mapping[str, str] = {
    "OPENAI_API_KEY": "openai-chat:gpt-5.1",
    "ANTHROPIC_API_KEY": "anthropic:claude-sonnet-4-5",
    "GOOGLE_API_KEY": "google:gemini-3-pro",
}
"""The environment variables for API keys, each with an example model."""

SERVER_TIMEOUT = 0.5  # seconds
MAX_LIST_BYTES = 1_000_000
MODEL_HINT = "set OPENAI_API_KEY or another provider's key, or start a model server such as Ollama"


@dataclass(frozen=True)
class UsableModel:
    """A model that can be used now: its `--model` name, why it can be used, and its server if local."""

    name: str  # the value for `--model`
    why: str  # why the model can be used, such as `OPENAI_API_KEY is set`
    base_url: str | None = None  # the value for `--base-url`; None if not needed

    @property
    def options(self) -> str:
        """The command-line options that select this model, quoted for a shell."""
        server = "" if self.base_url is None else f" --base-url {self.base_url}"
        return f"--model {shlex.quote(visible(self.name))}{server}"


def find_usable_models(servers: Mapping[str, int] = MODEL_SERVERS) -> list[UsableModel]:
    """Return usable models: those on local `servers` (name to port), one per API key, and recorded ones."""
    local = [model for server, port in servers.items() for model in _list_models(server, port)]
    keys = [key for key in KEY_VARIABLES if os.environ.get(key, "").strip()]
    by_key = [UsableModel(KEY_VARIABLES[key], f"{key} is set") for key in keys]
    why = "written by hand, for known instructions"
    recorded = [UsableModel(f"recorded:{name}", why) for name in RECORDED_NAMES]
    return [*local, *by_key, *recorded]


def suggest_model(servers: Mapping[str, int] = MODEL_SERVERS) -> str:
    """Return advice: `add --model NAME` for the first usable model, or else how to set up a model."""
    first = find_usable_models(servers)[0]
    return MODEL_HINT if is_recorded(first.name) else f"add {first.options}"


def _list_models(server: str, port: int) -> list[UsableModel]:
    """Ask a server for its models. Return an empty list if it is not a running model server."""
    connection = HTTPConnection("127.0.0.1", port, timeout=SERVER_TIMEOUT)
    try:
        connection.request("GET", "/v1/models", headers={"Accept": "application/json"})
        reply = json.loads(connection.getresponse().read(MAX_LIST_BYTES))
        names = [str(one["id"]) for one in reply["data"]]
    except (OSError, HTTPException, ValueError, LookupError, TypeError, RecursionError):
        return []
    finally:
        connection.close()
    url = f"http://127.0.0.1:{port}/v1"
    why = f"{server} answers on this machine"
    return [UsableModel(f"openai-chat:{name}", why, url) for name in names if "embed" not in name]
