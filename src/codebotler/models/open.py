"""Opens a model by its name."""

from __future__ import annotations

from codebotler.core.errors import UserError, installed
from codebotler.models.base import Model
from codebotler.models.recorded import recorded_model
from codebotler.models.sampling import SamplingSettings

KINDS = (
    "recorded, recorded:hasty, PROVIDER:NAME such as openai-chat:gpt-5.1, "
    "completions:NAME with --base-url, or hf:PATH"
)


def open_model(name: str, settings: SamplingSettings) -> Model:
    """Open a model by its name.

    Args:
        name: `recorded`, `recorded:hasty`, `provider:name` as in pydantic-ai, `completions:name` for a
            text-completion endpoint, or `hf:PATH` for a folder or a name on the Hugging Face hub.
        settings: how it is asked.

    Raises:
        UserError: there is no such model, a key is not in the environment, or something is not installed.
    """
    kind, rest = kind_of(name), name.partition(":")[2]
    # Each of the modules imports a large library, and is imported only where it is used.
    match kind:
        case "recorded":
            if settings.base_url is not None:
                expect_server(name)
            return recorded_model(name)
        case "completions":
            with installed():
                from codebotler.models.completions import CompletionsModel  # noqa: PLC0415 - see above

            return CompletionsModel(rest, settings)
        case "hf":
            with installed():
                from codebotler.models.local import LocalModel  # noqa: PLC0415 - see above
            return LocalModel(rest, settings)
        case _:
            with installed():
                from codebotler.models.chat import ChatModel  # noqa: PLC0415 - see above
            return ChatModel(name, settings)


def expect_server(*names: str) -> None:
    """Refuse a base URL where none of the models runs on a server."""
    if not any(map(runs_on_server, names)):
        raise UserError(
            f"a base URL is given, but {' and '.join(names)} {'does' if len(names) == 1 else 'do'} not use "
            "a server; use a model that does, such as openai-chat:NAME"
        )


def runs_on_server(name: str) -> bool:
    """Whether a model is asked over HTTP, rather than recorded or on this machine."""
    return kind_of(name) not in {"recorded", "hf"}


def kind_of(name: str) -> str:
    """The part of a model's name before the colon, checked without importing a large library."""
    kind, _, rest = name.partition(":")
    if kind == "recorded":
        recorded_model(name)
    elif not kind or not rest.strip():
        raise UserError(f'"{name}" is not the name of a model; write {KINDS}')
    return kind
