"""Traces and outcomes as plain data, in rows of JSON and in YAML files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Self

import yaml
from pydantic import BaseModel, ConfigDict, Field, StrictStr, model_validator

from codebotler.core.errors import UserError, YamlFile
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.trace import Event, Option, Outcome, RunError, Status, Trace


def trace_data(trace: Trace, skills: SkillTable = SKILLS) -> list[list[Any]]:
    """A trace as `[kind, text]`, for a look with what was found, for a question with options and answer."""
    return [_event_data(event, skills) for event in trace]


def trace_from(data: Iterable[object], skills: SkillTable = SKILLS, *, further: bool = False) -> Trace:
    """The trace that data describe; its events have no place and no time.

    Args:
        data: what `trace_data` made of a trace.
        skills: what can stand in it.
        further: whether events of skills that are not among them may stand in it too.

    Raises:
        UserError: an element is none.
    """
    return tuple(
        _further_event_from(element)
        if further and _is_further(element, skills)
        else _event_from(element, skills)
        for element in data
    )


def outcome_data(outcome: Outcome, skills: SkillTable = SKILLS) -> dict[str, Any]:
    """An outcome as data."""
    error = None if outcome.error is None else {"kind": outcome.error.kind, "message": outcome.error.message}
    return {
        "status": outcome.status.value,
        "error": error,
        "line": outcome.line,
        "trace": trace_data(outcome.trace, skills),
    }


def read_outcome(path: Path, skills: SkillTable = SKILLS) -> Outcome:
    """Read an outcome from a YAML file.

    Args:
        path: the file.
        skills: what can stand in its trace.

    Raises:
        UserError: the file is missing or wrong; the sentence names the line and the mend.
    """
    file = YamlFile.read(path)
    return file.validate(OutcomeFile).outcome(file, skills)


def outcome_yaml(outcome: Outcome, skills: SkillTable = SKILLS) -> str:
    """An outcome as the text of a YAML file."""
    return yaml.safe_dump(outcome_data(outcome, skills), sort_keys=False, allow_unicode=False, width=100)


def _event_data(event: Event, skills: SkillTable) -> list[Any]:
    if event.options or event.answer is not None or _asks(event.kind, skills):
        return [event.kind, event.text, [_option_data(option) for option in event.options], event.answer]
    if event.found is not None:
        return [event.kind, event.text, event.found]
    return [event.kind, event.text]


def _event_from(element: object, skills: SkillTable) -> Event:
    match element:
        case [str(kind), *_] if kind not in skills.recordings:
            raise UserError(f'"{kind}" is no kind of event; write one of {", ".join(skills.recordings)}')
        case [str(kind), str(text)] if not _asks(kind, skills):
            return Event(kind, text)
        case [str(kind), str(text), bool(found)] if _looks(kind, skills):
            return Event(kind, text, found=found)
        case [str(kind), str(text), list(data), (str() | None) as answer] if _asks(kind, skills):
            options = tuple(map(_option_from, data))
            if answer is not None and answer not in {option.text for option in options}:
                raise UserError(f'"{answer}" is no option of the question "{text}"; correct the answer')
            return Event(kind, text, options, answer=answer)
        case [str(kind), *_] if _asks(kind, skills):
            form = f"[{kind}, question, [option, ...], answer or null]"
        case [str(kind), *_]:
            form = f"[{kind}, text, true or false]" if _looks(kind, skills) else f"[{kind}, text]"
        case _:
            form = "[kind, text, ...]"
    raise UserError(f"{element!r} is no element of a trace; write {form}, with texts in quotes")


def _is_further(element: object, skills: SkillTable) -> bool:
    match element:
        case [str(kind), *_]:
            return kind not in skills.recordings
    return False


def _further_event_from(element: object) -> Event:
    match element:
        case [str(kind), str(text)]:
            return Event(kind, text)
        case [str(kind), str(text), bool(found)]:
            return Event(kind, text, found=found)
        case [str(kind), str(text), list(options), (str() | None) as answer]:
            return Event(kind, text, tuple(map(_option_from, options)), answer=answer)
    raise UserError(f"{element!r} is no element of a trace")


def _asks(kind: str, skills: SkillTable) -> bool:
    recording = skills.recordings.get(kind)
    return recording is not None and recording.options is not None


def _looks(kind: str, skills: SkillTable) -> bool:
    return any(
        s.recording is not None and s.recording.kind == kind and s.returns == "bool" for s in skills.rows
    )


def _option_data(option: Option) -> object:
    return option.text if option.is_text else {"no text": option.text}


def _option_from(data: object) -> Option:
    match data:
        case str(text):
            return Option(text)
        case {"no text": str(text)}:
            return Option(text, is_text=False)
    raise UserError(f'{data!r} is no option; write a text, or {{"no text": ...}} for what is none')


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ErrorFile(_Form):
    """Why a run did not finish, as a file writes it."""

    kind: StrictStr
    message: StrictStr


class OutcomeFile(_Form):
    """An outcome as a file writes it."""

    status: Status
    error: ErrorFile | None = None
    line: Annotated[int, Field(ge=1, strict=True)] | None = None
    trace: list[Any]

    @model_validator(mode="after")
    def _has_an_error_unless_finished(self) -> Self:
        if (self.error is None) != (self.status is Status.FINISHED):
            raise ValueError("an outcome has an error exactly when it is not finished")
        return self

    def outcome(self, file: YamlFile, skills: SkillTable = SKILLS) -> Outcome:
        """The outcome it describes.

        Args:
            file: where it stands, for the sentences of errors.
            skills: what can stand in its trace.

        Raises:
            UserError: an element of the trace is none.
        """
        trace = []
        for index, element in enumerate(self.trace):
            try:
                trace.append(_event_from(element, skills))
            except UserError as fault:
                raise file.wrong(fault.sentence, "trace", index) from None
        error = None if self.error is None else RunError(self.error.kind, self.error.message)
        return Outcome(self.status, tuple(trace), error, self.line)
