"""What happens in a mission, event by event, in English."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

from codebotler.core.program import nodes, tree_of
from codebotler.core.skills.declaration import by_name
from codebotler.core.skills.table import Recording
from codebotler.core.skills.values import as_text, written_call
from codebotler.core.terminal import shortened, visible
from codebotler.core.trace import trace_from
from codebotler.core.words import brief
from codebotler.missions.log import Line, Summary
from codebotler.rtl.wording import event_words

PAGE = "the page"  # as whoever presses STOP there is logged
FIRST_CALLS = 2  # of a program, in the title of its mission


def event_text(line: Line) -> str:
    """An event as people read it, such as `drives to "kitchen"`; empty if there is nothing to read."""
    words = EVENTS.get(line["event"])
    return words(line) if words else ""


def activity(line: Line) -> str:
    """What a robot is at during a skill or while the program sleeps, such as `driving to supply room`."""
    if line["event"] == "sleep":
        return f"waiting for {line['seconds']:g} s"
    skill = by_name(line["skill"])
    if skill is None or skill.verb is None:
        return f"executing {visible(line['skill'])}"
    if skill.recording is None:
        return skill.verb.ing
    if skill.recording.more or skill.verb.object or not skill.recording.text:
        return skill.verb.with_object(skill.verb.ing, _given(skill.recording, line))
    text = shortened(as_text(line["arguments"][skill.recording.text]), 100)
    if skill.recording.is_drive:
        return f"driving to {text}"
    return f'{skill.verb.ing} "{text}"' if skill.recording.is_spoken else f"{skill.verb.ing} {text}"


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
        for node in nodes(tree_of(summary.program))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and by_name(node.func.id)
    ]
    calls.sort(key=lambda call: (call.lineno, call.col_offset))
    shown = [brief(ast.get_source_segment(summary.program, call) or "") for call in calls[:FIRST_CALLS]]
    more = ["…"] * (len(calls) > FIRST_CALLS)
    return f"typed: {', '.join([*shown, *more])}" if calls else "a program without an instruction"


def _given(recording: Recording, line: Line) -> list[str]:
    """What a skill was given, in the order in which its event has it."""
    names = [name for name in (recording.text, *recording.more) if name]
    return [shortened(as_text(line["arguments"][name]), 100) for name in names]


def _skill(line: Line) -> str:
    skill, arguments = by_name(line["skill"]), line["arguments"]
    if skill is None or skill.verb is None:
        return shortened(written_call(line["skill"], list(arguments.values())))
    if skill.recording is None:
        return skill.verb.third
    if skill.recording.more or skill.verb.object or not skill.recording.text:
        return skill.verb.with_object(skill.verb.third, _given(skill.recording, line))
    text = as_text(arguments[skill.recording.text])
    words = f'{skill.verb.third} "{shortened(text)}"'
    options = arguments.get(skill.recording.options or "")
    return f"{words} [{shortened(' | '.join(options))}]" if options else words


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
    what = visible(event_words(trace_from([line["what"]])[0]))
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
