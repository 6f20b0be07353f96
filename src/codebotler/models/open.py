"""From the name of a model to the model."""

from __future__ import annotations

from codebotler.core.errors import UserError
from codebotler.models.base import Model, SamplingSettings
from codebotler.models.recorded import RecordedModel, recorded_model

KINDS = (
    "recorded, recorded:hasty, PROVIDER:NAME such as openai-chat:gpt-5.1, "
    "completions:NAME with --base-url, or hf:PATH"
)
EXTRA = 'pip install "codebotler[transformers]"'


def open_model(name: str, settings: SamplingSettings) -> Model:
    """The model of a name, ready to be asked.

    Args:
        name: `recorded`, `recorded:hasty`, `provider:name` as pydantic-ai spells it, `completions:name` for
            an endpoint of text completions, or `hf:PATH` for a folder or a name on the Hugging Face hub.
        settings: how it is to be asked.

    Raises:
        UserError: there is no such model, a key is not in the environment, or something is not installed.
    """
    kind, rest = kind_of(name), name.partition(":")[2]
    # Each of these imports a large library, which only who uses it should wait for.
    match kind:
        case "recorded":
            if settings.base_url is not None:
                expect_server(name)
            return RecordedModel(recorded_model(name))
        case "completions":
            from codebotler.models.completions import Completions  # noqa: PLC0415 - see above

            return Completions(rest, settings)
        case "hf":
            try:
                from codebotler.models.local import Local  # noqa: PLC0415 - see above
            except ImportError:
                raise UserError(f"{name} needs torch and transformers; install them with: {EXTRA}") from None
            return Local(rest, settings)
        case _:
            from codebotler.models.chat import Chat  # noqa: PLC0415 - see above

            return Chat(name, settings)


def expect_server(*names: str) -> None:
    """Refuse models none of which runs on a server, where it is said at which URL it does.

    Args:
        names: of the models.

    Raises:
        UserError: nobody would be asked there.
    """
    if not any(map(runs_on_server, names)):
        raise UserError(
            f"a base URL is given, but {' and '.join(names)} run{'s' * (len(names) == 1)} on no server; "
            "name a model that does, such as openai-chat:NAME"
        )


def runs_on_server(name: str) -> bool:
    """Whether a model is asked over HTTP, rather than recorded or on this machine."""
    return kind_of(name) not in {"recorded", "hf"}


def kind_of(name: str) -> str:
    """What stands before the colon of a model's name, as far as it can be told without a large library.

    Raises:
        UserError: there is no such recorded model, or this is the name of none.
    """
    kind, _, rest = name.partition(":")
    if kind == "recorded":
        recorded_model(name)
    elif not kind or not rest.strip():
        raise UserError(f'"{name}" names no model; write {KINDS}')
    return kind
