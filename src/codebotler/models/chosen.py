"""Which model is asked where a command names none: by the environment, a file, or else a recorded one."""

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

VARIABLE = "CODEBOTLER_MODEL"
RECORDED = "recorded:careful"


@dataclass(frozen=True)
class ChosenModel:
    """A model, and how it is asked unless a command says otherwise.

    Args:
        name: as `open_model` takes it.
        base_url: the address of its server; None for the provider's own.
        max_tokens: the limit for a reply, in tokens; None for the default.
    """

    name: str
    base_url: str | None = None
    max_tokens: int | None = None

    def with_its_server(self, settings: SamplingSettings) -> SamplingSettings:
        """The settings with its address, and with its limit unless they have one."""
        limit = settings.max_tokens or self.max_tokens
        return replace(settings, base_url=self.base_url, max_tokens=limit)


class ConfigFile(BaseModel):
    """What config.yaml may say."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: Annotated[str, Field(min_length=1)] = RECORDED
    base_url: str | None = None
    max_tokens: Annotated[int, Field(ge=1)] | None = None
    behind_proxy: tuple[str, ...] = ()  # where a reverse proxy offers the page

    @model_validator(mode="after")
    def _has_a_model_for_its_settings(self) -> Self:
        if self.model_fields_set & {"base_url", "max_tokens"} and "model" not in self.model_fields_set:
            raise ValueError("base_url and max_tokens belong to a model; name it as model:")
        return self


def chosen_model(name: str | None = None, base_url: str | None = None) -> ChosenModel:
    """The model that is named, or else that of CODEBOTLER_MODEL, that of config.yaml, or the recorded one.

    The address and the limit of config.yaml belong to its model: they are used for that model only, however
    it is named.

    Raises:
        UserError: config.yaml is wrong.
    """
    if name is not None and is_recorded(name):
        return ChosenModel(name, base_url)
    file = config_file()
    config = ConfigFile()
    if file is not None and file.is_file():
        config = YamlFile.read(file).validate(ConfigFile)
    name = name or os.environ.get(VARIABLE, "").strip() or config.model
    if name != config.model:
        return ChosenModel(name, base_url)
    return ChosenModel(name, base_url or config.base_url, config.max_tokens)


def opener(models: Sequence[str], base_url: str | None, settings: SamplingSettings) -> Callable[[str], Model]:
    """What opens models by their names; names that make no sense are refused at once."""
    for each in models:
        kind_of(each)
    if base_url is not None:
        expect_server(*models)

    def opened(name: str) -> Model:
        if not runs_on_server(name):
            return open_model(name, settings)
        return open_model(name, chosen_model(name, base_url).with_its_server(settings))

    return opened
