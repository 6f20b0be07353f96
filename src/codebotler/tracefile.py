"""Traces and outcomes as plain data, in rows of JSON and in YAML files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Self

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictStr, model_validator

from codebotler.badinput import YamlFile
from codebotler.trace import Event, Option, Outcome, RunError, Status, Trace


def trace_data(trace: Trace) -> list[list[Any]]:
    """A trace as `[kind, text]`, for a look with what was found, for a question with options and answer."""
    return [_event_data(event) for event in trace]


def trace_from(data: Iterable[object]) -> Trace:
    """The trace that data describe; its events have no place and no time.

    Raises:
        ValueError: an element is none.
    """
    return tuple(_event_from(element) for element in data)


def outcome_data(outcome: Outcome) -> dict[str, Any]:
    """An outcome as data."""
    error = None if outcome.error is None else {"kind": outcome.error.kind, "message": outcome.error.message}
    return {
        "status": outcome.status.value,
        "error": error,
        "line": outcome.line,
        "trace": trace_data(outcome.trace),
    }


def read_outcome(path: Path) -> Outcome:
    """Read an outcome from a YAML file.

    Raises:
        BadInput: the file is missing or wrong; the sentence names the line and the mend.
    """
    return YamlFile.read(path).validate(OutcomeFile).outcome()


def outcome_yaml(outcome: Outcome) -> str:
    """An outcome as the text of a YAML file."""
    return yaml.safe_dump(outcome_data(outcome), sort_keys=False, allow_unicode=False, width=100)


def _event_data(event: Event) -> list[Any]:
    if event.options or event.answer is not None or event.kind == "ask":
        return [event.kind, event.text, [_option_data(option) for option in event.options], event.answer]
    if event.found is not None:
        return [event.kind, event.text, event.found]
    return [event.kind, event.text]


def _event_from(element: object) -> Event:
    match element:
        case [str(kind), str(text)]:
            return Event(kind, text)
        case [str(kind), str(text), bool(found)]:
            return Event(kind, text, found=found)
        case [str(kind), str(text), list(options), (str() | None) as answer]:
            return Event(kind, text, tuple(map(_option_from, options)), answer=answer)
    raise ValueError(
        f"{element!r} is no element of a trace; write [kind, text], [kind, text, found] "
        "or [ask, question, options, answer]"
    )


def _option_data(option: Option) -> object:
    return option.text if option.is_text else {"no text": option.text}


def _option_from(data: object) -> Option:
    match data:
        case str(text):
            return Option(text)
        case {"no text": str(text)}:
            return Option(text, is_text=False)
    raise ValueError(f'{data!r} is no option; write a text, or {{"no text": ...}} for what is none')


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class ErrorFile(_Form):
    """Why a run did not finish, as a file writes it."""

    kind: StrictStr
    message: StrictStr


class OutcomeFile(_Form):
    """An outcome as a file writes it."""

    status: Status
    error: ErrorFile | None = None
    line: Annotated[int, Field(ge=1, strict=True)] | None = None
    trace: list[Annotated[Event, BeforeValidator(_event_from)]]

    @model_validator(mode="after")
    def _has_an_error_unless_finished(self) -> Self:
        if (self.error is None) != (self.status is Status.FINISHED):
            raise ValueError("an outcome has an error exactly when it is not finished")
        return self

    def outcome(self) -> Outcome:
        """The outcome it describes."""
        error = None if self.error is None else RunError(self.error.kind, self.error.message)
        return Outcome(self.status, tuple(self.trace), error, self.line)
