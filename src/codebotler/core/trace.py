"""Events, traces and outcomes of runs, and their conversion to plain data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, NamedTuple, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.skills.kinds import PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.skills.values import Scalar, as_text


class Option(NamedTuple):
    """One choice offered with a question.

    Args:
        text: the option as text.
        is_text: whether the program offered a string. Formulas cannot judge options of other types.
    """

    text: str
    is_text: bool = True


def to_options(values: Iterable[object]) -> tuple[Option, ...]:
    """Convert a question's options, such as strings or numbers, to `Option`, unless they already are."""
    return tuple(
        [one if isinstance(one, Option) else Option(str(one), isinstance(one, str)) for one in values]
    )


@dataclass(frozen=True)
class Event:
    """One action of the robot, such as a drive to the kitchen, or a question and its answer.

    Args:
        kind: goto, say, ask, check, pick or place, or the kind that a custom skill records.
        text: what the program asks for, such as `kitchen`, without outer spaces.
        options: the options of a question; empty for other kinds.
        answer: the text of the chosen option; None for an unanswered question and for other kinds.
        found: the result of a look or another yes-or-no skill; None for other kinds.
        place: the name, in the world, of the room where it happened (for a drive, where it started).
        time: seconds since the start of the run, on the simulated clock or the clock of a real robot.
        holding: what the robot held when it began; empty for nothing.
        to: the addressee of a question; None for other kinds.
        more: further arguments, as texts.
        destination: the room where a drive ended; None for a failed drive and for other kinds.
        failed: the kind of the error by which it failed, if this is recorded, else empty.
    """

    kind: str
    text: str
    options: tuple[Option, ...] = ()
    answer: str | None = None
    found: bool | None = None
    place: str = field(default="", compare=False)
    time: float = field(default=0.0, compare=False)
    holding: str = field(default="", compare=False)
    to: str | None = field(default=None, compare=False)
    more: tuple[str, ...] = ()
    destination: str | None = field(default=None, compare=False)
    failed: str = field(default="", compare=False)


def attempted_event(
    skill: Skill,
    arguments: Sequence[Scalar | tuple[Option, ...] | tuple[Scalar, ...]],
    *,
    place: str,
    time: float,
    holding: str = "",
) -> Event | None:
    """Return a call as an event without a result: `Event("goto", "kitchen")`; None if it is not recorded."""
    if skill.recording is None:
        return None
    row, given = skill.recording, dict(zip((p.name for p in skill.parameters), arguments, strict=True))
    text, options = as_text(given.get(row.text, "")).strip(), given.get(row.options or "", ())
    to = as_text(given[row.to]) if row.to else None
    more = tuple(as_text(given[name]).strip() for name in row.more)
    return Event(row.kind, text, options, place=place, time=time, holding=holding, to=to, more=more)  # type: ignore[arg-type]  # options


def arguments_of_event(skill: Skill, event: Event) -> list[Scalar | tuple[str, ...]]:
    """Return the arguments of the skill call that an event records, with `""` for those not in the event."""
    row, given = skill.recording, dict[str | None, Scalar | tuple[str, ...]]()
    if row is not None:
        given = dict(zip(row.more, event.more, strict=False))
        options = tuple(option.text for option in event.options)
        given |= {row.text: event.text, row.options: options, row.to: event.to or ""}
    return [given.get(parameter.name, "") for parameter in skill.parameters]


Trace: TypeAlias = tuple[Event, ...]
"""The events of one run, in order."""


class Status(StrEnum):
    """How a run ended: it finished, reached a limit, failed with an error, or was killed."""

    FINISHED = "finished"
    TIMEOUT = "timeout"
    PYTHON_ERROR = "python-error"
    ROBOT_ERROR = "robot-error"
    AGENT_ERROR = "agent-error"  # of an agent that calls skills without a program
    KILLED = "killed"


@dataclass(frozen=True)
class RunError:
    """The reason why a run did not finish."""

    kind: str  # an exception's class, a robot error, TimeoutError, MemoryError, Crash or ForbiddenCall
    message: str  # one sentence


@dataclass(frozen=True)
class Outcome:
    """How a run ended, and its trace.

    Args:
        status: how it ended.
        trace: the robot's actions.
        error: None if and only if the status is `finished`.
        line: the line of the program where it ended, counted from 1; None if unknown.
    """

    status: Status
    trace: Trace = field(repr=False)
    error: RunError | None = None
    line: int | None = None


def held_after(trace: Iterable[Event]) -> str:
    """Return what the robot holds after a trace, or an empty string for nothing."""
    moves = [event for event in trace if event.kind in {PICK, PLACE} and not event.failed]
    return moves[-1].text if moves and moves[-1].kind == PICK else ""


# --- conversion to plain data


def trace_data(trace: Trace, skills: SkillTable = SKILLS) -> list[list[Any]]:
    """Convert a trace to lists that can be written as JSON.

    An event is `[kind, text]`, `[kind, text, found]` or `[kind, text, options, answer]`. For a skill with
    several arguments, it is `[kind, text, more]` or `[kind, text, more, found]`.
    """
    asking = frozenset(kind for kind, recording in skills.recordings.items() if recording.options is not None)
    return [_event_data(event, asking) for event in trace]


def trace_from(data: Iterable[object]) -> Trace:
    """Convert the data of `trace_data` back to a trace, or raise UserError for other data."""
    return tuple(map(_event_from, data))


def placed_trace_data(trace: Trace) -> list[dict[str, Any]]:
    """Convert a trace to JSON data that also has each event's rooms, addressee, held object and error."""
    names = ("place", "holding", "to", "destination", "failed")
    return [{"what": trace_data((event,))[0], **{n: getattr(event, n) for n in names}} for event in trace]


def placed_trace_from(data: Iterable[Mapping[str, Any]]) -> Trace:
    """Convert the data of `placed_trace_data` back to a trace; raise UserError for an invalid event."""
    rows = [dict(row) for row in data]
    return tuple(replace(trace_from([row.pop("what")])[0], **row) for row in rows)


def outcome_data(outcome: Outcome, skills: SkillTable = SKILLS) -> dict[str, Any]:
    """Convert an outcome to data: `status`, `error` (`kind` and `message`, or None), `line` and `trace`."""
    error = None if outcome.error is None else {"kind": outcome.error.kind, "message": outcome.error.message}
    return {
        "status": outcome.status.value,
        "error": error,
        "line": outcome.line,
        "trace": trace_data(outcome.trace, skills),
    }


def _event_data(event: Event, asking: frozenset[str]) -> list[Any]:
    if event.kind in asking or event.options or event.answer is not None:
        return [event.kind, event.text, [option_data(option) for option in event.options], event.answer]
    data: list[Any] = [event.kind, event.text]
    if event.more:
        data.append(list(event.more))
    if event.found is not None:
        data.append(event.found)
    return data


def _event_from(element: object) -> Event:
    match element:
        case [str(kind), str(text)]:
            return Event(kind, text)
        case [str(kind), str(text), bool(found)]:
            return Event(kind, text, found=found)
        case [str(kind), str(text), [*more]] if all(isinstance(each, str) for each in more):
            return Event(kind, text, more=tuple(map(str, more)))
        case [str(kind), str(text), [*more], bool(found)] if all(isinstance(each, str) for each in more):
            return Event(kind, text, found=found, more=tuple(map(str, more)))
        case [str(kind), str(text), list(options), (str() | None) as answer]:
            return Event(kind, text, tuple(map(option_from, options)), answer=answer)
    forms = "[kind, text], [kind, text, true or false] or [kind, question, options, answer or null]"
    raise UserError(f"{element!r} is not an event of a trace; write {forms}")


def option_data(option: Option) -> object:
    """Convert an option to its text or, if it was not a string, to a mapping such as `{"no text": "5"}`."""
    return option.text if option.is_text else {"no text": option.text}


def option_from(data: object) -> Option:
    """Convert the data of `option_data` back to an option, or raise UserError for other data."""
    match data:
        case str(text):
            return Option(text)
        case {"no text": str(text)}:
            return Option(text, is_text=False)
    raise UserError(f'{data!r} is not an option of a question; write "yes" or, for 5, {{"no text": "5"}}')
