"""Choose a model by the environment or config.yaml, and open models by their names."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from codebotler.core.errors import UserError, installed
from codebotler.core.files import config_file
from codebotler.core.yaml_files import YamlFile
from codebotler.models.base import Model
from codebotler.models.recorded import is_recorded, open_recorded
from codebotler.models.sampling import SamplingSettings

MODEL_VARIABLE = "CODEBOTLER_MODEL"
DEFAULT_MODEL = "recorded:careful"
KINDS_WITHOUT_TOOLS = frozenset({"recorded", "completions", "hf"})
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
    if settings.base_url is not None:
        expect_server(name)
    # Each of these modules imports a large library, so import only the one that is needed.
    match kind:
        case "recorded":
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
    """Raise UserError if a base URL would have no effect, because none of these models is on a server."""
    if not any(map(runs_on_server, names)):
        fix = "leave it out, or choose a model such as openai-chat:NAME"
        raise UserError(f"{' and '.join(names)} cannot use a base URL; {fix}")


def runs_on_server(name: str) -> bool:
    """Return whether a model is reached over HTTP, unlike recorded models and models in this process."""
    return kind_of(name) not in {"recorded", "hf"}


def kind_of(name: str) -> str:
    """Return the kind in a model's name, such as `hf` in `hf:PATH`. Raise UserError if it is invalid."""
    kind, _, rest = name.partition(":")
    if kind == "recorded":
        open_recorded(name)
    elif not kind or not rest.strip():
        raise UserError(f'"{name}" is not the name of a model; write {MODEL_FORMS}')
    return kind


# --- the choice of a model


@dataclass(frozen=True)
class ChosenModel:
    """The name of a model, with the server and the token limit for its requests."""

    name: str  # the argument for `open_model`
    base_url: str | None = None  # None means the provider's own server
    max_tokens: int | None = None  # None means the default limit for a reply

    def add_server(self, settings: SamplingSettings) -> SamplingSettings:
        """Return the settings with this model's server, and with its token limit unless they set one."""
        limit = settings.max_tokens or self.max_tokens
        return replace(settings, base_url=self.base_url, max_tokens=limit)


class ConfigFile(BaseModel):
    """The contents of config.yaml: the default model with its settings, and addresses of the page."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: Annotated[str, Field(min_length=1)] = DEFAULT_MODEL
    base_url: str | None = None
    max_tokens: Annotated[int, Field(ge=1)] | None = None
    behind_proxy: tuple[str, ...] = ()  # addresses at which a reverse proxy serves the page

    @model_validator(mode="after")
    def _has_a_model_for_its_settings(self) -> Self:
        if self.model_fields_set & {"base_url", "max_tokens"} and "model" not in self.model_fields_set:
            raise ValueError("base_url and max_tokens need a model; add one, such as model: openai-chat:NAME")
        return self


def choose_model(name: str | None = None, base_url: str | None = None) -> ChosenModel:
    """Return the given model, or else the one from CODEBOTLER_MODEL or config.yaml, or a recorded model.

    The server and the token limit in config.yaml apply only to the model that is named there.

    Raises:
        UserError: config.yaml is invalid.
    """
    if name is not None and is_recorded(name):
        return ChosenModel(name, base_url)
    file = config_file()
    config = ConfigFile()
    if file is not None and file.is_file():
        config = YamlFile.read(file).validate(ConfigFile)
    name = name or os.environ.get(MODEL_VARIABLE, "").strip() or config.model
    if name != config.model:
        return ChosenModel(name, base_url)
    return ChosenModel(name, base_url or config.base_url, config.max_tokens)


def make_opener(
    models: Sequence[str], base_url: str | None, settings: SamplingSettings
) -> Callable[[str], Model]:
    """Return a function that opens models by name. Raise UserError now if a name in `models` is invalid."""
    for each in models:
        kind_of(each)
    if base_url is not None:
        expect_server(*models)

    def open_by_name(name: str) -> Model:
        if not runs_on_server(name):
            return open_model(name, settings)
        return open_model(name, choose_model(name, base_url).add_server(settings))

    return open_by_name
