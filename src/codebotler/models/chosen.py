"""Which model is asked where a command names none: by the environment, a file, or else a recorded one."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.files import config_file
from codebotler.core.yaml_files import YamlFile
from codebotler.models.base import Model, SamplingSettings
from codebotler.models.open import expect_server, kind_of, open_model, runs_on_server
from codebotler.models.recorded import is_recorded

VARIABLE = "CODEBOTLER_MODEL"
RECORDED = "recorded:careful"


@dataclass(frozen=True)
class ChosenModel:
    """A model with the address of its server, or None for the provider's own."""

    name: str
    base_url: str | None = None


class ConfigFile(BaseModel):
    """What config.yaml may say."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: Annotated[str, Field(min_length=1)]
    base_url: str | None = None


def chosen_model(name: str | None = None, base_url: str | None = None) -> ChosenModel:
    """The model that is named, or else that of CODEBOTLER_MODEL, that of config.yaml, or the recorded one.

    The address of config.yaml belongs to its model: it is used for that model only, however it is named.

    Raises:
        UserError: config.yaml is wrong.
    """
    if name is not None and (base_url is not None or is_recorded(name)):
        return ChosenModel(name, base_url)
    file = config_file()
    config = ConfigFile(model=RECORDED)
    if file is not None and file.is_file():
        config = YamlFile.read(file).validate(ConfigFile)
    name = name or os.environ.get(VARIABLE, "").strip() or config.model
    return ChosenModel(name, base_url or (config.base_url if name == config.model else None))


def opener(models: Sequence[str], base_url: str | None) -> Callable[[str], Model]:
    """What opens models by their names; names that make no sense are refused at once."""
    for each in models:
        kind_of(each)
    if base_url is not None:
        expect_server(*models)
    return lambda name: open_model(
        name,
        SamplingSettings(base_url=chosen_model(name, base_url).base_url if runs_on_server(name) else None),
    )
