"""Describe the events of a mission in English."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from codebotler.core.skills.declaration import by_name
from codebotler.core.skills.values import written_call
from codebotler.core.terminal import shortened, visible
from codebotler.core.text.phrases import phrase
from codebotler.core.text.words import brief, counted
from codebotler.core.trace import attempted_event, to_options, trace_from
from codebotler.missions.storage.log import LogLine, MissionState, MissionSummary
from codebotler.simulator.guard.contract import CONTRACT

BY_PAGE = "the page"  # the source of a stop from the page, as it appears in the log
_TITLE_SOURCE, _TITLE_STEPS = 1_000, 40  # how many characters of a program to read for a title, and to show
_STATE_TITLES: Mapping[str, str] = {MissionState.DRAFTING: "program written", MissionState.RUNNING: "started"}
"""The titles of states. Other states keep their own names."""

_STATES_IMPLIED_BY_STOP = frozenset({MissionState.STOPPING, MissionState.STOPPED})
"""The states that a timeline hides after a stop."""


def event_text(line: LogLine) -> str:
    """Return an event in words, such as `drives to "kitchen"`, or "" if the event is not shown."""
    words = _EVENT_WORDERS.get(line["event"])
    return words(line) if words else ""


def timeline(events: Iterable[LogLine]) -> Iterator[tuple[LogLine, str]]:
    """Yield the events to show to people, each with a description. Skip feedback and repetitions."""
    before, is_stopped = "", False
    for number, line in enumerate(events):
        words = event_text(line) if number else "mission created"
        is_stopped = is_stopped or line["event"] == "stop"
        is_implied = is_stopped and line.get("state") in _STATES_IMPLIED_BY_STOP
        if words and words != before and not is_implied and line["event"] not in {"feedback", "cancelled"}:
            yield line, words
        before = words if line["event"] == "state" else ""  # each edit of a draft logs the same state again


def _state(line: LogLine) -> str:
    state, reason = line["state"], shortened(line.get("reason", ""))
    step = _STATE_TITLES.get(state, visible(state))
    if state == MissionState.CHECKED:
        problems = len(line.get("problems", ()))
        step = f"checked: {counted(problems, 'problem') if problems else 'no problems'}"
    return f"{step}: {reason.removeprefix(f'{state} ')}" if reason else step


def stop_text(by: str) -> str:
    """Return a stop and its source in words, such as `stopped by Ctrl-C` or `stopped from the page`."""
    return f"stopped {'from' if by == BY_PAGE else 'by'} {visible(by)}"


def reason_text(reason: str, line: int | None) -> str:
    """Return `reason`, prefixed with the program's line if known, as in `line 3: no such room`."""
    return reason if line is None else f"line {line}: {reason}"


def capitalize(words: str) -> str:
    """Return a text with its first letter capitalized and the other letters unchanged."""
    return words[:1].upper() + words[1:]


def title(summary: MissionSummary) -> str:
    """Return the title of a mission: its instruction, or else the beginning of its program's steps."""
    if summary.instruction:
        return summary.instruction
    steps = brief(summary.program.split("def task_program():", 1)[-1][:_TITLE_SOURCE], _TITLE_STEPS)
    begin = "program" if summary.model else "typed"
    return f"{begin}: {steps}" if steps else "a program without an instruction"


def _skill(line: LogLine) -> str:
    skill, values = by_name(line["skill"]), list(line["arguments"].values())
    if skill is None or skill.verb is None:
        return shortened(written_call(line["skill"], values))
    given = zip(skill.parameters, values, strict=True)
    arguments = [to_options(value) if parameter.is_options else value for parameter, value in given]
    event = attempted_event(skill, arguments, place="", time=0.0)
    return skill.verb.third if event is None else phrase(event, "third", show=shortened)


def _result(line: LogLine) -> str:
    match line["result"]:
        case None:
            return ""
        case bool(result):
            skill = by_name(line["skill"])
            return f"→ {skill.verb.results[result]}" if skill and skill.verb else f"→ {result}"
        case list(texts):
            return f"→ {shortened(', '.join(map(str, texts)))}"
        case result:
            return f"→ {shortened(str(result))}"


def _rule(line: LogLine) -> str:
    rule, says = f'the rule "{visible(str(line["rule"]))}"', shortened(str(line["says"]))
    if "what" not in line:
        return f"{rule} was broken at the end: {says}"
    what = visible(phrase(trace_from([line["what"]])[0], "ing"))
    if line.get("why"):
        objection = "forbids" if line["rule"] == CONTRACT.name else "cannot judge"
        return f"{rule} {objection} {what}, {visible(str(line['why']))}: {says}"
    return f"{rule} prevented {what}: {says}" if line.get("prevented") else f"{what} broke {rule}: {says}"


_EVENT_WORDERS: Mapping[str, Callable[[LogLine], str]] = {
    "skill": _skill,
    "result": _result,
    "state": _state,
    "feedback": lambda line: shortened(line["text"]),
    "picture": lambda line: shortened(line.get("text") or f"picture: {line.get('file')}"),
    "error": lambda line: f"{visible(line['kind'])}: {shortened(line['message'])}",
    "sleep": lambda line: f"waits for {line['seconds']:g} s",
    "rule": _rule,
    "stop": lambda line: stop_text(line["by"]),
    "cancelled": lambda _: "cancelled",
    "late": lambda _: "finished after the stop; nothing more will run",
    "log": lambda line: shortened(line["text"]),
    "map": lambda _: "",
    "contract": lambda _: "",
    "past": lambda line: f"continues mission {visible(str(line['continues']))}",
}
"""The functions that describe each kind of event."""
