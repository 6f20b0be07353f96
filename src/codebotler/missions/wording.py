"""What happens in a mission, event by event, in English."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

from codebotler.core.phrases import phrase
from codebotler.core.program import nodes, parse_leniently
from codebotler.core.skills.declaration import by_name
from codebotler.core.skills.values import written_call
from codebotler.core.skills.verbs import VerbForm
from codebotler.core.terminal import shortened, visible
from codebotler.core.trace import attempted_event, to_options, trace_from
from codebotler.core.words import brief
from codebotler.missions.log import Line, Summary

PAGE = "the page"  # as whoever presses STOP there is logged
FIRST_CALLS = 2  # of a program, in the title of its mission
MOST_ACTIVITY = 100  # characters of each text


def event_text(line: Line) -> str:
    """An event as people read it, such as `drives to "kitchen"`; empty if there is nothing to read."""
    words = EVENTS.get(line["event"])
    return words(line) if words else ""


def activity(line: Line) -> str:
    """What a robot does during a skill or a pause of the program, such as `going to "supply room"`."""
    if line["event"] == "sleep":
        return f"waiting for {line['seconds']:g} s"
    return skill_text(line, "ing", MOST_ACTIVITY) or f"executing {visible(line['skill'])}"


def skill_text(line: Line, form: VerbForm, most: int = 500) -> str:
    """The call of a skill in words; empty for a skill that has none in this process."""
    skill = by_name(line["skill"])
    if skill is None or skill.verb is None:
        return ""
    given = zip(skill.parameters, line["arguments"].values(), strict=True)
    arguments = [to_options(value) if parameter.is_options else value for parameter, value in given]
    event = attempted_event(skill, arguments, place="", time=0.0)
    if event is None:
        return str(getattr(skill.verb, form))
    return phrase(event, form, show=lambda text: shortened(text, most))


def stop_text(by: str, doing: str = "") -> str:
    """A stop in words, and what it interrupted, such as `driving to supply room`, if anything."""
    during = f" while {doing}" if doing else ""
    return f"stopped {'from' if by == PAGE else 'by'} {visible(by)}{during}"


def state_text(state: str, reason: str) -> str:
    """A state and why it was reached, such as `stopped by rule vault` or `failed: the door is shut`."""
    if not reason or reason.startswith(state):
        return shortened(reason) or state
    return f"{state}: {shortened(reason)}"


def reason_text(reason: str, line: int | None) -> str:
    """Why a mission ended, with the line of the program if one is to blame."""
    return reason if line is None else f"line {line}: {reason}"


def title(summary: Summary) -> str:
    """The instruction of a mission, or else the first skills that its program calls."""
    if summary.instruction:
        return summary.instruction
    calls = [
        node
        for node in nodes(parse_leniently(summary.program))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and by_name(node.func.id)
    ]
    calls.sort(key=lambda call: (call.lineno, call.col_offset))
    shown = [brief(ast.get_source_segment(summary.program, call) or "") for call in calls[:FIRST_CALLS]]
    more = ["…"] * (len(calls) > FIRST_CALLS)
    return f"typed: {', '.join([*shown, *more])}" if calls else "a program without an instruction"


def _skill(line: Line) -> str:
    arguments = list(line["arguments"].values())
    return skill_text(line, "third") or shortened(written_call(line["skill"], arguments))


def _result(line: Line) -> str:
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


def _rule(line: Line) -> str:
    """A rule that was enforced, broken, or not kept at the end."""
    rule, says = f'the rule "{visible(str(line["rule"]))}"', shortened(str(line["says"]))
    if "what" not in line:
        return f"not kept: {rule}: {says}"
    what = visible(phrase(trace_from([line["what"]])[0], "ing"))
    if line.get("why"):
        return f"{rule} cannot judge {what}, {visible(str(line['why']))}: {says}"
    return f"{rule} prevented {what}: {says}" if line.get("prevented") else f"{what} broke {rule}: {says}"


EVENTS: Mapping[str, Callable[[Line], str]] = {
    "skill": _skill,
    "result": _result,
    "state": lambda line: state_text(line["state"], line.get("reason", "")),
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
}
"""The text of each kind of event."""
