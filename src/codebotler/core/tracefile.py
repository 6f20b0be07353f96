"""Traces and outcomes as plain data, for JSON."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.trace import Event, Option, Outcome, Trace


def trace_data(trace: Trace, skills: SkillTable = SKILLS) -> list[list[Any]]:
    """A trace as a list of `[kind, text]`, `[kind, text, found]` and `[kind, text, options, answer]`."""
    return [_event_data(event, skills) for event in trace]


def trace_from(data: Iterable[object]) -> Trace:
    """The trace that data describe; its events have no place and no time.

    Args:
        data: the result of `trace_data`.

    Raises:
        UserError: an element is no event.
    """
    return tuple(map(_event_from, data))


def outcome_data(outcome: Outcome, skills: SkillTable = SKILLS) -> dict[str, Any]:
    """An outcome as a mapping with `status`, `error` (`kind` and `message`, or None), `line` and `trace`."""
    error = None if outcome.error is None else {"kind": outcome.error.kind, "message": outcome.error.message}
    return {
        "status": outcome.status.value,
        "error": error,
        "line": outcome.line,
        "trace": trace_data(outcome.trace, skills),
    }


def _event_data(event: Event, skills: SkillTable) -> list[Any]:
    recording = skills.recordings.get(event.kind)
    asks = recording is not None and recording.options is not None
    if asks or event.options or event.answer is not None:
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
    forms = "[kind, text], [kind, text, true or false] or [kind, question, options, answer or null]"
    raise UserError(f"{element!r} is no event of a trace; write {forms}")


def _option_data(option: Option) -> object:
    return option.text if option.is_text else {"no text": option.text}


def _option_from(data: object) -> Option:
    match data:
        case str(text):
            return Option(text)
        case {"no text": str(text)}:
            return Option(text, is_text=False)
    raise UserError(f'{data!r} is no option; write a text, or {{"no text": ...}} for anything else')
