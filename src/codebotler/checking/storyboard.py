"""Show a trace as numbered steps or as a storyboard on a terminal."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, Literal

from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from codebotler.core.skills.kinds import GOTO
from codebotler.core.terminal import shortened, visible
from codebotler.core.text.phrases import is_question, phrase
from codebotler.core.trace import Event, Trace, option_data, option_from

MAX_SHOWN_STEPS, FIRST_STEPS, LAST_STEPS = 40, 12, 6
STEP_MARK = "❱"


def steps_of(trace: Trace, *, has_places: bool = False, has_waits: bool = False) -> list[dict[str, Any]]:
    """Convert a trace to JSON data: a dictionary per step, numbered from 1, with rooms if `has_places`.

    If `has_waits`, `waited` is the seconds that the program waited before a step, unless it is 0.
    """
    steps = [_step_data(number, event, has_places=has_places) for number, event in enumerate(trace, 1)]
    times = [0.0, *(event.time for event in trace)]
    for step, before, now in zip(steps, times, times[1:], strict=False):
        if has_waits and now > before:
            step["waited"] = now - before
    return steps


def _step_data(number: int, event: Event, *, has_places: bool) -> dict[str, Any]:
    data: dict[str, Any] = {"step": number, "kind": event.kind, "text": event.text}
    if has_places:
        data["place"] = event.place
        if event.kind == GOTO:
            data["to"] = event.destination
    if event.found is not None:
        data["found"] = event.found
    if event.more:
        data["more"] = [*event.more]
    if is_question(event.kind) or event.answer is not None:
        data["options"] = [*map(option_data, event.options)]
        data["answer"] = event.answer
    return data


def event_from_step(step: Mapping[str, Any]) -> Event:
    """Convert a step from `steps_of` back to an event, with an empty place."""
    options = tuple(map(option_from, step.get("options", ())))
    more = tuple(step.get("more", ()))
    return Event(step["kind"], step["text"], options, step.get("answer"), step.get("found"), more=more)


def storyboard(steps: Sequence[Mapping[str, Any]], needed: Container[int | None]) -> Table:
    """Return a table of steps, room by room. Mark the step numbers in `needed`; shorten long traces."""
    table = grid("right", "left")
    if not steps:
        table.add_row(Text(), Text("the robot did nothing", "dim"))
        return table
    if steps[0]["kind"] != GOTO and "place" in steps[0]:
        table.add_row(Text(), Text(f"in {visible(steps[0]['place'])}", "bold"))
    for is_shown, some in select_steps(steps, needed):
        if is_shown:
            for step in some:
                if wait := wait_text(step):
                    table.add_row(Text(), Padding(Text(wait), (0, 0, 0, 4)))
                indent = 0 if step["kind"] == GOTO else 4
                number, is_needed = str(step["step"]), step["step"] in needed
                mark = Text(f"{STEP_MARK} {number}", "bold red") if is_needed else Text(number, "dim")
                table.add_row(mark, Padding(step_text(step), (0, 0, 0, indent)))
        else:
            table.add_row(Text(), Text(f"... {len(some):,} more ...", "dim"))
    return table


def select_steps(
    steps: Sequence[Mapping[str, Any]], needed: Container[int | None]
) -> Iterator[tuple[bool, Sequence[Mapping[str, Any]]]]:
    """Yield groups as (is shown, steps). A long trace shows its ends and the first steps in `needed`."""
    marked = [step["step"] for step in steps if step["step"] in needed][:MAX_SHOWN_STEPS]

    def is_shown(step: Mapping[str, Any]) -> bool:
        number = step["step"]
        is_end = number <= FIRST_STEPS or number > len(steps) - LAST_STEPS
        return len(steps) <= MAX_SHOWN_STEPS or is_end or number in marked

    groups = ((shown, list(some)) for shown, some in groupby(steps, key=is_shown))
    return ((shown or len(some) == 1, some) for shown, some in groups)


def step_text(step: Mapping[str, Any]) -> Text:
    """Describe a step of `steps_of` in one line."""
    if step["kind"] == GOTO:
        return _drive(step)
    return Text(phrase(event_from_step(step), "past", show=shortened))


def wait_text(step: Mapping[str, Any]) -> str:
    """Describe the wait before a step of `steps_of`, or return an empty string if there was none."""
    return f"waits for {step['waited']:g} s" if "waited" in step else ""


def _drive(step: Mapping[str, Any]) -> Text:
    request = f'"{shortened(step["text"])}"'
    if "place" not in step:
        return Text(f"→ {request}", "bold")
    start = f"{visible(step['place'])} → "
    if step["to"] is None:
        return Text.assemble((f"{start}{request}", "bold"), ("  failed: there is no such room", "red"))
    drive = Text(start + visible(step["to"]), "bold")
    is_same = step["to"].lower() == step["text"].lower()
    return drive if is_same else drive.append(f"  (asked for {request})", "not bold")


def grid(*justify: Literal["left", "right"]) -> Table:
    """Return a table without lines, with one column per alignment. Right-aligned columns never wrap."""
    table = Table.grid(padding=(0, 2, 0, 0))
    for side in justify:
        table.add_column(justify=side, no_wrap=side == "right", overflow="fold")
    return table
