"""Draws the page of a completion: its program, and the robot's actions and failed checks in each world."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import html, ui

from codebotler.checking.storyboard import step_text
from codebotler.core.terminal import shortened, visible_lines
from codebotler.core.text.words import counted
from codebotler.core.world import World
from codebotler.web.floorplan import MapState, floorplan
from codebotler.web.frame import PlainText, outside
from codebotler.web.storyboard import draw_scene, scenes
from roboeval.evaluation.judging.explanation import (
    LOWERCASED_NOTE,
    cut_sentence,
    error_sentence,
    failing_first,
    instruction_shown,
)
from roboeval.evaluation.judging.failures import label_of, no_program_sentence
from roboeval.evaluation.runs.completions import CompletionKey, name_of, recorded_suffix
from roboeval.evaluation.runs.replies import reply_facts
from roboeval.suites.task import describe_contents, plain_check, world_title
from roboeval.web.heat_map import MAX_NAME, run_address
from roboeval.web.run_store import RunStore
from roboeval.web.serializers import completion_details
from roboeval.web.snapshot import CompletionFilter, Snapshot
from roboeval.web.widgets import ProgramView

MAX_SENTENCE, MAX_INSTRUCTION, MAX_REPLY = 2_000, 5_000, 50_000
FAILED_STEP_NOTE = "Red marks the step at which a check failed."
NEIGHBOUR_LINKS = ("Previous completion", "Next completion")


async def draw_completion(
    store: RunStore, run: str, name: str, chosen: CompletionFilter, evaluation: str | None
) -> None:
    """Draw the page of a completion, with links to its neighbours among those that `chosen` selects."""

    def read() -> tuple[Snapshot, dict[str, Any]]:
        snapshot = store.open(run, evaluation)
        return snapshot, completion_details(snapshot, name)

    snapshot, data = await asyncio.to_thread(read)
    _draw_head(snapshot, data, chosen, chosen.query(evaluation))
    with ui.element("div").classes("one-program"):
        with ui.element("div").classes("program-and-reply"):
            _draw_program(data)
            _draw_reply(data["reply"])
        _draw_worlds(data, _worlds(snapshot, data["task"]))


def _worlds(run: Snapshot, task: str) -> dict[str, World]:
    """Return the worlds of a task by their descriptions, or nothing if the suite is unavailable."""
    if run.suite is None or task not in run.suite.tasks:
        return {}
    scenarios = run.suite.tasks[task].judged_in(ablated=run.results.is_ablated)
    return {scenario.world.about: scenario.world for scenario in scenarios}


def _draw_head(run: Snapshot, data: Mapping[str, Any], chosen: CompletionFilter, query: str) -> None:
    key: CompletionKey = data["task"], data["prompt"], data["index"]
    with ui.element("nav").classes("trail").props('aria-label="Breadcrumb"'):
        address = outside(f"{run_address(run.name)}{query}#completions")
        html.a(shortened(run.name, MAX_NAME), href=address).props("dir=auto")
        for text, other in zip(NEIGHBOUR_LINKS, run.neighbours(key, chosen), strict=True):
            if other is not None:
                task, prompt, index = other
                href = f"{run_address(run.name)}/{quote(task, safe='')}/{prompt}/{index}{query}"
                html.a(text, href=outside(href)).classes("beside")
    PlainText("h1", shortened(name_of(key), MAX_NAME))
    with ui.element("p").classes("facts"):
        why, state = data["failure"], {None: "waits", True: "done", False: "failed"}[data["passed"]]
        verdict = "not judged yet" if data["passed"] is None else "passed"
        if why is not None:
            verdict = shortened(f"{label_of(why['class'])}: {why['kind']}")
        PlainText("small", verdict, f"state state-{state}")
        if data["model"] is not None:
            PlainText("span", f"written by {shortened(data['model'], 200)}{recorded_suffix([data['model']])}")
    origin, instruction = instruction_shown(data["instruction"], data["suite_instruction"])
    if origin is not None:
        PlainText("p", origin[0].upper() + origin[1:], "quiet")
    if instruction is not None:
        PlainText("p", shortened(instruction, MAX_INSTRUCTION), "instruction")


def _draw_program(data: Mapping[str, Any]) -> None:
    with ui.element("section").classes("pane").props("aria-labelledby=h-program"):
        title = "Program" if _no_program_sentence(data) is None else "Extracted from the reply"
        PlainText("h2", title).props("id=h-program")
        ran = data["worlds"] if _no_program_sentence(data) is None else ()
        lines = (world["line"] for world in ran if not world["satisfied"])
        view = ProgramView(data["program"], (line for line in lines if line is not None))
        if view.left_out:
            PlainText("p", f"{view.left_out:,} more lines; see completions.jsonl.", "quiet")


def _no_program_sentence(data: Mapping[str, Any]) -> str | None:
    """Explain why the reply contains no program, or return None if it contains one."""
    return None if data["failure"] is None else no_program_sentence(data["failure"])


def _draw_reply(reply: Mapping[str, Any] | None) -> None:
    if reply is None:
        return
    with ui.element("section").classes("pane reply").props("aria-labelledby=h-reply"):
        PlainText("h2", "Reply").props("id=h-reply")
        PlainText("p", "; ".join(reply_facts(reply)), "quiet")
        for name, text in (("Reasoning", reply["reasoning"]), ("Full reply", reply["raw_reply"])):
            if text:
                title = f"{name}, {counted(len(text), 'character')}"
                _draw_folded(partial(PlainText, "span", title), partial(_draw_text, text, name))


def _draw_text(text: str, name: str) -> None:
    pre = PlainText("pre", shortened(text, MAX_REPLY, visible_lines), "source").props("tabindex=0")
    pre.props["aria-label"] = name


def _draw_worlds(completion: Mapping[str, Any], worlds: Mapping[str, World]) -> None:
    judged = completion["worlds"]
    with ui.element("div").classes("worlds-of"):
        if (sentence := _no_program_sentence(completion)) is not None:  # no program was run
            PlainText("p", sentence, "trouble")
            return
        if completion["lowered"] and judged:
            PlainText("p", LOWERCASED_NOTE, "quiet")
        if not judged:
            PlainText("p", "This completion has not been judged yet.", "quiet")
        for number, data in failing_first(judged):
            head = partial(_draw_world_head, data, number, len(judged))
            draw = partial(_draw_world, data, worlds.get(data["world"]), f"world-{number}-step-")
            with ui.element("article").classes("pane world-of").props(f"aria-labelledby=h-world-{number}"):
                if data["satisfied"]:
                    _draw_folded(head, draw)
                else:
                    with ui.element("div").classes("head"):
                        head()
                    draw()


def _draw_world_head(data: Mapping[str, Any], number: int, of: int) -> None:
    title = world_title(number, of, shortened(data["world"], 300))
    PlainText("h2", title).props(f"id=h-world-{number}")
    state = ("satisfied", "done") if data["satisfied"] else ("not satisfied", "failed")
    PlainText("small", state[0], f"state state-{state[1]}")


def _draw_reasons(data: Mapping[str, Any], anchor: str) -> None:
    if data["error"] is not None:
        allowed = ". This world allows a program to wait forever." * data["satisfied"]
        sentence = f"{shortened(data['error']['kind'])}: {shortened(error_sentence(data))}{allowed}"
        PlainText("p", sentence, "quiet" if data["satisfied"] else "trouble")
    with ui.element("ul").classes("failed-checks"):
        for check in data["failed_checks"]:
            with ui.element("li").classes("failed-check"):
                PlainText("code", shortened(plain_check(check["check"])))
                if check["explanation"] is not None:
                    PlainText("span", shortened(check["explanation"], MAX_SENTENCE))
                if check["step"] is not None:
                    html.a(f"step {check['step']}", href=f"#{anchor}{check['step']}")


def _draw_world(data: Mapping[str, Any], world: World | None, anchor: str) -> None:
    """Draw what happened in a world. The HTML IDs of its steps start with `anchor`."""
    _draw_reasons(data, anchor)
    steps, cut = data["steps"], data.get("cut")
    wrong = {check["step"] for check in data["failed_checks"]} - {None}
    if not steps and cut is None:
        PlainText("p", "The robot did nothing.", "quiet")
    elif steps and "place" in steps[0]:
        with ui.element("ol").classes("scenes").props('aria-label="Room by room"'):
            for scene in scenes(steps, steps[0]["place"], wrong):
                draw_scene(scene, wrong, anchor=anchor)
        if wrong:
            PlainText("p", FAILED_STEP_NOTE, "quiet")
    if cut is not None:
        PlainText("p", f"{cut_sentence(cut)}.", "quiet")
    if steps:
        title = f"All {'' if cut is None else 'stored '}steps ({len(steps):,})"
        _draw_folded(partial(PlainText, "span", title), partial(_draw_steps, steps))
    if world is not None:
        _draw_folded(partial(PlainText, "span", "The world"), partial(_draw_rooms, world))


def _draw_folded(head: Callable[[], object], draw: Callable[[], None]) -> None:
    """Draw a foldable section, whose content is not drawn until it is first unfolded."""
    with html.details() as details:
        with ui.element("summary"):
            head()
        inside = ui.element("div").classes("unfolded")

    def unfold() -> None:
        if not inside.default_slot.children:
            with inside:
                draw()

    details.on("toggle", unfold, args=[])


def _draw_steps(steps: Sequence[Mapping[str, Any]]) -> None:
    lines = (f"{step['step']:>4}  {step_text(step).plain}" for step in steps)
    PlainText("pre", "\n".join(lines), "source").props('tabindex=0 aria-label="All steps"')


def _draw_rooms(world: World) -> None:
    ui.html(floorplan(world, MapState(room=world.robot)), sanitize=False).classes("map")
    with ui.element("dl").classes("rooms"):
        for room in world.rooms:
            inside = ", ".join(describe_contents(world, room))
            PlainText("dt", shortened(room.name, 200))
            PlainText("dd", shortened(inside, 500) if inside else "empty")
