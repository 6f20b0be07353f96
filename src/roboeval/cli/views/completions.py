"""Formats a prompt's programs with the reasons why they fail, and a single completion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.syntax import Syntax
from rich.text import Text

from codebotler.checking.storyboard import grid, storyboard
from codebotler.core.terminal import shortened, visible, visible_lines
from codebotler.core.text.words import counted
from roboeval.evaluation.judging.explanation import (
    LOWERCASED_NOTE,
    cut_sentence,
    error_sentence,
    failing_first,
    first_lines,
    instruction_shown,
)
from roboeval.evaluation.judging.failures import label_of, no_program_sentence
from roboeval.evaluation.runs.completions import name_of, recorded_suffix
from roboeval.evaluation.runs.replies import reply_facts
from roboeval.suites.task import plain_check, world_title

MAX_EXPLANATION = 2_000  # characters
ALL_STEPS = "--all shows what the robot did in satisfied worlds."
SHOW_REPLY = "--reply shows them."
SHOWN_REPLY_CHARACTERS = 100_000  # the most characters of a reply or its reasoning to print


def prompt_view(data: Mapping[str, Any]) -> RenderableType:
    """Return a view of a prompt's programs and why they fail, from the data that `prompt_data` returns."""
    table = grid("right", "left")
    for program in data["programs"]:
        table.add_row(f"  {program['indices'][0]}", _program_line(program))
    lines = prompt_lines(data["task"], data)
    lines[0].append(recorded_suffix(data["models"]))
    return Group(*lines, Text(), table)


def _program_line(program: Mapping[str, Any]) -> Text:
    same = len(program["indices"])
    often = Text(f"x{same:,}  " if same > 1 else "")
    if program["passed"]:
        return often.append("passed", "green")
    text = Text.assemble(often, kind_view(program["failure"]))
    if (sentence := no_program_sentence(program["failure"])) is not None:
        return text.append(f"\n{sentence}")
    text.append(f' in "{visible(program["world"])}"')
    if program["explanation"] is None:
        why = shortened(error_sentence(program))
    else:
        label = visible(plain_check(program["failure"]["check"]))
        why = f"{label}: {shortened(program['explanation'], MAX_EXPLANATION)}"
    return text.append(f"\n{why}" if why else "")


def completion_view(
    data: Mapping[str, Any], *, in_full: bool = False, with_reply: bool = False
) -> RenderableType:
    """Return a view of a completion's program and the robot's steps, from the data of `completion_data`.

    `in_full` also shows the steps in worlds where the program passes. `with_reply` adds reasoning and reply.
    """
    failure = data["failure"]
    why_none = None if failure is None else no_program_sentence(failure)
    lines = {world["line"] for world in data["worlds"] if not world["satisfied"] and why_none is None}
    parts: list[RenderableType] = [_completion_head(data)]
    parts += [Text(), *_program(data["program"], lines)]
    parts += _reply(data["reply"], with_texts=with_reply)
    if why_none is not None:  # without a program, there are no steps to show
        return Group(*parts, Text(), Text(why_none, "red"))
    worlds = data["worlds"]
    if data["lowered"]:
        parts += [Text(), Text(LOWERCASED_NOTE, "dim")]
    satisfied = []
    for number, world in failing_first(worlds):
        title = Text(world_title(number, len(worlds), visible(world["world"])), "bold")
        if in_full or not world["satisfied"]:
            parts += [Text(), title, _ending(world), *_world(world)]
        else:
            satisfied.append(_satisfied(world, title))
    if satisfied:
        parts += [Text(), *satisfied, Text(ALL_STEPS, "dim")]
    return Group(*parts)


def _completion_head(data: Mapping[str, Any]) -> Text:
    head = Text.assemble((visible(name_of((data["task"], data["prompt"], data["index"]))), "bold"), "  ")
    why = data["failure"]
    head.append_text(Text("passed", "green") if why is None else kind_view(why))
    if data["model"] is not None:
        head.append(f"\nwritten by {visible(data['model'])}{recorded_suffix([data['model']])}", "dim")
    origin, instruction = instruction_shown(data["instruction"], data["suite_instruction"])
    if origin is not None:
        head.append(f"\n{origin}", "dim")
    return head if instruction is None else head.append(f"\n{visible(instruction)}", "italic")


def _reply(reply: Mapping[str, Any] | None, *, with_texts: bool) -> list[RenderableType]:
    if reply is None:
        return []
    parts: list[RenderableType] = [Text()]
    if facts := reply_facts(reply):
        parts.append(Text("; ".join(facts), "dim"))
    texts = {"reasoning": reply["reasoning"], "reply": reply["raw_reply"]}
    there = {name: text for name, text in texts.items() if text}
    if with_texts:
        for name, text in there.items():
            shown = shortened(text, SHOWN_REPLY_CHARACTERS, visible_lines)
            parts += [Text(), Text(f"{name}:", "bold"), Text(shown)]
    elif there:
        long = " and ".join(f"{name} ({len(text):,} characters)" for name, text in there.items())
        parts.append(Text(f"{long}: {SHOW_REPLY}", "dim"))
    return parts


def _program(program: str, marked: set[int | None]) -> list[RenderableType]:
    source, left = first_lines(program)
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


def _world(world: Mapping[str, Any]) -> list[RenderableType]:
    cut = world.get("cut")
    parts: list[RenderableType] = []
    if world["steps"] or cut is None:
        parts.append(storyboard(world["steps"], {check["step"] for check in world["failed_checks"]}))
    if cut is not None:
        parts.append(Padding(Text(cut_sentence(cut), "yellow"), (0, 0, 0, 2)))
    for check in world["failed_checks"]:
        label = visible(plain_check(check["check"]))
        why = shortened(check["explanation"], MAX_EXPLANATION)
        text = Text.assemble(("failed ", "red"), f"{label}: {why}")
        parts.append(Padding(text, (0, 0, 0, 2)))
    return parts


def _satisfied(world: Mapping[str, Any], title: Text) -> Text:
    ending = f", {world['status']} (allowed here)" if world["error"] else ""
    steps = len(world["steps"]) + world.get("cut", {}).get("events", 0)
    return Text.assemble(title, "  ", ("satisfied", "green"), f"{ending}, {counted(steps, 'step')}")


def _ending(world: Mapping[str, Any]) -> Text:
    text = Text("satisfied", "green") if world["satisfied"] else Text("not satisfied", "red")
    text = Text.assemble(text, f", {world['status']}")
    if world["error"] is None:
        return text
    allowed = " (allowed here)" if world["satisfied"] else ""
    error = ", ".join(filter(None, [visible(world["error"]["kind"]), shortened(error_sentence(world))]))
    return text.append(f"{allowed}: {error}")


def prompt_lines(task: str, prompt: Mapping[str, Any]) -> list[Text]:
    """Return the lines of text that show a prompt's score and its instruction."""
    score = f"{prompt['passed']:,} of {prompt['completions']:,} passed (pass@1 {prompt['pass@1']:.2f})"
    if (prompt["requested"] or 0) > prompt["completions"]:
        score += f"; {prompt['requested']:,} were requested"
    head = Text.assemble((f"{visible(task)}/{prompt['prompt']}", "bold"), "  ", score)
    known: list[tuple[str | None, str | None]] = [(None, text) for text in prompt["instructions"]]
    lines = [head]
    for origin, text in known or [instruction_shown(None, prompt["suite_instruction"])]:
        lines += [] if origin is None else [Text(origin, "dim")]
        lines += [] if text is None else [Text(visible(text), "italic")]
    return lines


def kind_view(failure: Mapping[str, Any]) -> Text:
    """Return the class and the kind of a failure as red text."""
    return Text.assemble((f"{visible(label_of(failure['class']))}: {visible(failure['kind'])}", "red"))
