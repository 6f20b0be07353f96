"""Command-line options for the settings of a model."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from inspect import Signature, signature
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from codebotler.core.errors import UserError
from codebotler.core.terminal import note
from codebotler.models.sampling import PAPER_MAX_TOKENS, SamplingSettings

if TYPE_CHECKING:
    from codebotler.models.base import Model
    from codebotler.models.servers.batch import BatchModel

CommandT = TypeVar("CommandT", bound=Callable[..., object])

TemperatureOption = Annotated[
    float | None,
    typer.Option(
        help="The sampling temperature; higher is more random.",
        show_default=str(SamplingSettings.temperature),
    ),
]
NoTemperatureOption = Annotated[bool, typer.Option("--no-temperature", help="Send no temperature.")]
TopPOption = Annotated[
    float | None,
    typer.Option(
        help="Sample from the most likely tokens whose probabilities add up to this value (top-p).",
        show_default=str(SamplingSettings.top_p),
    ),
]
NoTopPOption = Annotated[bool, typer.Option("--no-top-p", help="Send no top-p.")]
MaxTokensOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="The maximum length of a reply in tokens, including reasoning.",
        show_default=f"no limit; {PAPER_MAX_TOKENS} for base models",
    ),
]
EffortOption = Annotated[
    str | None, typer.Option(help="The effort of a reasoning model, such as low, medium or high.")
]
ExtraBodyOption = Annotated[
    str | None,
    typer.Option(help="Extra fields for each request, such as '{\"top_k\": 20}'.", metavar="JSON"),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--settings",
        help=f"`paper` sets temperature 0.2, top-p 0.95 and {PAPER_MAX_TOKENS} tokens, unless you set them.",
        metavar="NAME",
    ),
]
ModelSeedOption = Annotated[int | None, typer.Option(help="The random seed, if the model supports one.")]
TimeoutOption = Annotated[float, typer.Option(help="The time limit for a request, in seconds.")]


def model_settings(
    *,
    temperature: TemperatureOption = None,
    no_temperature: NoTemperatureOption = False,
    top_p: TopPOption = None,
    no_top_p: NoTopPOption = False,
    max_tokens: MaxTokensOption = None,
    reasoning_effort: EffortOption = None,
    extra_body: ExtraBodyOption = None,
    settings: PresetOption = None,
    seed: ModelSeedOption = None,
    timeout: TimeoutOption = SamplingSettings.timeout,
) -> SamplingSettings:
    """Return the settings that these options describe. Raise UserError if one is invalid or two conflict."""
    if settings not in {None, "paper"}:
        raise UserError(f'unknown settings "{settings}"; use --settings paper, or leave out --settings')
    if settings is not None and max_tokens is None:  # the paper's temperature and top-p are the defaults
        max_tokens = PAPER_MAX_TOKENS
    return SamplingSettings(
        temperature=_choose("temperature", temperature, is_left_out=no_temperature),
        top_p=_choose("top_p", top_p, is_left_out=no_top_p),
        max_tokens=max_tokens,
        seed=seed,
        timeout=timeout,
        reasoning_effort=reasoning_effort,
        extra_body=None if extra_body is None else _json_object(extra_body),
    )


def _choose(name: str, value: float | None, *, is_left_out: bool) -> float | None:
    option = name.replace("_", "-")
    if is_left_out and value is not None:
        raise UserError(f"--{option} and --no-{option} cannot be used together; leave out one")
    default: float = getattr(SamplingSettings, name)
    return None if is_left_out else default if value is None else value


def _json_object(text: str) -> dict[str, Any]:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        raise UserError("the value of --extra-body is not a JSON object; write one such as '{\"top_k\": 20}'")
    return value


def note_unsent(asked: SamplingSettings, model: Model | BatchModel) -> None:
    """Print a note that names the requested settings, such as a seed, that the model does not support."""
    from codebotler.models.recorded import is_recorded

    names = ("temperature", "top_p", "seed")
    unsent = [name for name in names if getattr(model.settings, name) is None is not getattr(asked, name)]
    if unsent and not is_recorded(model.name):
        note(f"{model.name} does not support {' or '.join(unsent).replace('_', '-')}; not sent")


def inherit_options(called: Callable[..., object]) -> Callable[[CommandT], CommandT]:
    """Return a decorator that adds the options of the function `called` to a command with `**shared`."""

    def extended(command: CommandT) -> CommandT:
        inherited, own = (signature(one, eval_str=True).parameters for one in (called, command))
        named = [one for one in own.values() if one.kind is not one.VAR_KEYWORD and one.name not in inherited]
        first = [one for one in named if one.kind is not one.KEYWORD_ONLY]
        last = [one for one in named if one.kind is one.KEYWORD_ONLY]
        shared = [one.replace(kind=one.KEYWORD_ONLY) for one in inherited.values()]
        command.__signature__ = Signature([*first, *shared, *last])  # type: ignore[attr-defined]  # of a function
        return command

    return extended


def options_for(called: Callable[..., object], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options in `given`, by name, that are parameters of the function `called`."""
    return {name: given[name] for name in signature(called).parameters}
