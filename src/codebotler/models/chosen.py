"""Choose the default model from the environment or config.yaml, or else a recorded model."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from codebotler.core.files import config_file
from codebotler.core.yaml_files import YamlFile
from codebotler.models.base import Model
from codebotler.models.open import expect_server, kind_of, open_model, runs_on_server
from codebotler.models.recorded import is_recorded
from codebotler.models.sampling import SamplingSettings

MODEL_VARIABLE = "CODEBOTLER_MODEL"
DEFAULT_MODEL = "recorded:careful"


@dataclass(frozen=True)
class ChosenModel:
    """A model with its default settings."""

    name: str  # the argument for `open_model`
    base_url: str | None = None  # None means the provider's own server
    max_tokens: int | None = None  # None means the default limit for a reply

    def add_server(self, settings: SamplingSettings) -> SamplingSettings:
        """Return the settings with this model's server and, if they have no token limit, with its limit."""
        limit = settings.max_tokens or self.max_tokens
        return replace(settings, base_url=self.base_url, max_tokens=limit)


class ConfigFile(BaseModel):
    """The contents of config.yaml."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: Annotated[str, Field(min_length=1)] = DEFAULT_MODEL
    base_url: str | None = None
    max_tokens: Annotated[int, Field(ge=1)] | None = None
    behind_proxy: tuple[str, ...] = ()  # addresses at which a reverse proxy serves the page

    @model_validator(mode="after")
    def _has_a_model_for_its_settings(self) -> Self:
        if self.model_fields_set & {"base_url", "max_tokens"} and "model" not in self.model_fields_set:
            raise ValueError("base_url and max_tokens apply to a model; name the model as model:")
        return self


def choose_model(name: str | None = None, base_url: str | None = None) -> ChosenModel:
    """Choose the given model, or else the model in CODEBOTLER_MODEL or config.yaml, or a recorded model.

    The address and the limit in config.yaml apply only to the model named there.

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
    """Return a function that opens models by name. Raise UserError at once if a name is invalid."""
    for each in models:
        kind_of(each)
    if base_url is not None:
        expect_server(*models)

    def open_by_name(name: str) -> Model:
        if not runs_on_server(name):
            return open_model(name, settings)
        return open_model(name, choose_model(name, base_url).add_server(settings))

    return open_by_name
