"""Open a model by its name."""

from __future__ import annotations

from codebotler.core.errors import UserError, installed
from codebotler.models.base import Model
from codebotler.models.recorded import open_recorded
from codebotler.models.sampling import SamplingSettings

NOT_CALLING = frozenset({"recorded", "completions", "hf"})
"""The kinds of models that cannot call tools."""

MODEL_FORMS = (
    "recorded, recorded:hasty, PROVIDER:NAME such as openai-chat:gpt-5.1, "
    "completions:NAME with --base-url, or hf:PATH"
)


def open_model(name: str, settings: SamplingSettings) -> Model:
    """Open a model by its name.

    Args:
        name: `recorded`, `recorded:hasty`, `provider:name` as in pydantic-ai, `completions:name` for a
            text-completion endpoint, or `hf:PATH` for a folder or a name on the Hugging Face hub.
        settings: the settings of requests to the model.

    Raises:
        UserError: the model does not exist, or a key or a package is missing.
    """
    kind, rest = kind_of(name), name.partition(":")[2]
    # Each of these modules imports a large library, so import only the one that is needed.
    match kind:
        case "recorded":
            if settings.base_url is not None:
                expect_server(name)
            return open_recorded(name)
        case "completions":
            with installed():
                from codebotler.models.servers.completions import CompletionsModel  # noqa: PLC0415 - see above
            return CompletionsModel(rest, settings)
        case "hf":
            with installed():
                from codebotler.models.local import LocalModel  # noqa: PLC0415 - see above
            return LocalModel(rest, settings)
        case _:
            with installed():
                from codebotler.models.servers.chat import ChatModel  # noqa: PLC0415 - see above
            return ChatModel(name, settings)


def expect_server(*names: str) -> None:
    """Raise UserError if no model runs on a server, because a base URL would then have no effect."""
    if not any(map(runs_on_server, names)):
        raise UserError(
            f"a base URL is given, but {' and '.join(names)} {'does' if len(names) == 1 else 'do'} not use "
            "a server; use a model that does, such as openai-chat:NAME"
        )


def runs_on_server(name: str) -> bool:
    """Whether a model is reached over HTTP, unlike recorded models and models in this process."""
    return kind_of(name) not in {"recorded", "hf"}


def kind_of(name: str) -> str:
    """Validate a model's name without importing large libraries, and return the part before the colon."""
    kind, _, rest = name.partition(":")
    if kind == "recorded":
        open_recorded(name)
    elif not kind or not rest.strip():
        raise UserError(f'"{name}" is not the name of a model; write {MODEL_FORMS}')
    return kind
