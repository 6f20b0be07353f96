"""From the name of a model to the model."""

from __future__ import annotations

from codebotler.badinput import BadInput
from codebotler.models.base import Model, Settings
from codebotler.models.recorded import Recital, recorded_model

KINDS = (
    "recorded, recorded:hasty, PROVIDER:NAME such as openai-chat:gpt-5.1, "
    "completions:NAME with --base-url, or hf:PATH"
)


def open_model(name: str, settings: Settings) -> Model:  # noqa: ARG001 - until others are here
    """The model of a name, ready to be asked.

    Args:
        name: `recorded`, `recorded:hasty`, `provider:name` as pydantic-ai spells it, `completions:name` for
            an endpoint of text completions, or `hf:PATH` for a folder or a name on the Hugging Face hub.
        settings: how it is to be asked.

    Raises:
        BadInput: there is no such model, a key is not in the environment, or something is not installed.
    """
    kind, colon, rest = name.partition(":")
    if kind == "recorded":
        return Recital(recorded_model(name))
    if not colon or not kind or not rest.strip():
        raise BadInput(f'"{name}" names no model; write {KINDS}')
    raise BadInput(f'"{name}" names no model; write {KINDS}')
