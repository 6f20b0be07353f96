"""Views of a prompt's programs, each with the reason why it fails, and of one program with all it did."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.syntax import Syntax
from rich.text import Text

from codebotler.checking.storyboard import grid, storyboard
from codebotler.core.terminal import shortened, visible
from roboeval.cli.views.results import kind_view, prompt_lines
from roboeval.evaluation.explanation import (
    GONE,
    LOWERED,
    NOT_RECORDED,
    as_written,
    cut_told,
    error_sentence,
    shown_lines,
)
from roboeval.evaluation.runs.completions import by_hand, name_of
from roboeval.suites.task import check_label, world_title

EXPLANATION = 2_000


def prompt_view(data: Mapping[str, Any]) -> RenderableType:
    """A prompt, program by program; the data is that of `prompt_data`."""
    table = grid("right", "left")
    for program in data["programs"]:
        table.add_row(f"  {program['indices'][0]}", _program_line(program))
    lines = prompt_lines(data["task"], data)
    lines[0].append(by_hand(data["models"]))
    return Group(*lines, Text(), table)


def _program_line(program: Mapping[str, Any]) -> Text:
    same = len(program["indices"])
    often = Text(f"x{same:,}  " if same > 1 else "")
    if program["gone"]:
        often.append(f"{GONE}\n", "yellow")
    if program["passed"]:
        return often.append("passed", "green")
    text = Text.assemble(often, kind_view(program["failure"]), f' in "{visible(program["world"])}"')
    if program["explanation"] is None:
        why = shortened(error_sentence(program))
    else:
        label = visible(check_label(program["failure"]["check"]))
        why = f"{label}: {shortened(program['explanation'], EXPLANATION)}"
    return text.append(f"\n{why}" if why else "")


def completion_view(data: Mapping[str, Any]) -> RenderableType:
    """One completion: its program, and each world with every step and failed check (`completion_data`)."""
    lines = {world["line"] for world in data["worlds"] if not world["satisfied"]}
    parts: list[RenderableType] = [_completion_head(data)]
    if data["program"] is not None:
        parts += [Text(), *_program(data["program"], lines)]
    worlds = data["worlds"]
    if data["lowered"]:
        worlds = as_written(worlds, data["program"])
    if worlds != data["worlds"]:
        parts += [Text(), Text(LOWERED, "dim")]
    for number, world in enumerate(worlds, 1):
        parts += [Text(), *_world(world, world_title(number, f" of {len(worlds)}", visible(world["world"])))]
    return Group(*parts)


def _completion_head(data: Mapping[str, Any]) -> Text:
    head = Text.assemble((visible(name_of((data["task"], data["prompt"], data["index"]))), "bold"), "  ")
    why = data["failure"]
    head.append_text(Text("passed", "green") if why is None else kind_view(why))
    if data["model"] is not None:
        head.append(f"\nwritten by {visible(data['model'])}{by_hand([data['model']])}", "dim")
    if data["program"] is None:
        return head.append(f"\n{GONE}", "yellow")
    told = NOT_RECORDED if data["instruction"] is None else visible(data["instruction"])
    return head.append(f"\n{told}", "italic")


def _program(program: str, marked: set[int | None]) -> list[RenderableType]:
    source, left = shown_lines(program)
    syntax = Syntax(
        source,
        "python",
        theme="ansi_dark",
        background_color="default",
        line_numbers=True,
        highlight_lines={line for line in marked if line is not None},
        word_wrap=True,
    )
    return [syntax, Text(f"... {left:,} more lines", "dim")] if left else [syntax]


def _world(world: Mapping[str, Any], title: str) -> list[RenderableType]:
    cut = world.get("cut")
    parts: list[RenderableType] = [Text(title, "bold"), _ending(world)]
    if world["steps"] or cut is None:
        parts.append(storyboard(world["steps"], {check["step"] for check in world["failed_checks"]}))
    if cut is not None:
        parts.append(Padding(Text(cut_told(cut), "yellow"), (0, 0, 0, 2)))
    for check in world["failed_checks"]:
        text = Text.assemble(
            ("failed ", "red"),
            visible(check_label(check["check"])),
            f": {shortened(check['explanation'], EXPLANATION)}",
        )
        parts.append(Padding(text, (0, 0, 0, 2)))
    return parts


def _ending(world: Mapping[str, Any]) -> Text:
    text = Text("satisfied", "green") if world["satisfied"] else Text("not satisfied", "red")
    text = Text.assemble(text, f", {world['status']}")
    if world["error"] is None:
        return text
    allowed = " (allowed here)" if world["satisfied"] else ""
    told = ", ".join(filter(None, [visible(world["error"]["kind"]), shortened(error_sentence(world))]))
    return text.append(f"{allowed}: {told}")
