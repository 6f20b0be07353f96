"""The page of one completion: the program, and in each world what the robot did, what failed, and why."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

from fastapi import Depends
from nicegui import events, html, ui

from codebotler.badinput import BadInput
from codebotler.terminal import shortened
from codebotler.web.floorplan import floorplan
from codebotler.web.frame import PATIENCE, Frame
from codebotler.web.sceneview import draw_scene
from codebotler.web.strip import scenes
from codebotler.web.words import Words
from codebotler.world import World
from roboeval.evaluation.completions import Key, name_of
from roboeval.evaluation.explanation import cut_told
from roboeval.evaluation.tables import NOT_RECORDED, by_hand
from roboeval.suites.catalogue import person_told
from roboeval.suites.load import ABLATED, Suite
from roboeval.web.api import Choice, Evaluation
from roboeval.web.parts import Code, begin
from roboeval.web.seen import Wanted
from roboeval.web.shades import address, query_of
from roboeval.web.shelf import Shelf
from roboeval.web.steps import told_step
from roboeval.web.telling import completion_told, order_of

MOST_NAME, MOST_SENTENCE, MOST_INSTRUCTION = 80, 2_000, 5_000
CHANGED = "The program was changed, or is gone, since it was judged; the verdicts are on the one before."


def add(shelf: Shelf, frame: Frame) -> None:
    """Put the page at its address.

    Args:
        shelf: whose runs.
        frame: what all pages have.
    """

    @ui.page("/runs/{run}/{which:path}", response_timeout=PATIENCE)
    async def one_program(
        run: str,
        which: str,
        choice: Annotated[Choice, Depends()],
        evaluation: Evaluation = None,
    ) -> None:
        begin(frame, shortened(which, MOST_NAME))
        with ui.element("div").classes("benchmark"):
            try:
                told, beside, suite = await asyncio.to_thread(
                    _read, shelf, run, which, choice.wanted, evaluation
                )
            except BadInput as error:
                Words("p", error.sentence, "trouble").props("role=alert")
                html.a("All runs", href="/runs")
                return
            _draw_head(run, told, beside, query_of(choice.wanted, evaluation))
            with ui.element("div").classes("one-program"):
                _draw_program(told)
                _draw_worlds(told, suite)


def _read(
    shelf: Shelf, run: str, which: str, wanted: Wanted, evaluation: str | None
) -> tuple[dict[str, Any], list[Key | None], Suite | None]:
    followed = shelf.open(run, evaluation)
    seen = followed.wait()
    suite = shelf.suite_of(seen)
    entry = next((entry for key, entry in seen.by_key.items() if name_of(key) == which), None)
    if entry is None:
        raise BadInput(f'this run has no completion "{shortened(which, MOST_NAME)}"')
    beside = list(seen.neighbours(entry.key, wanted, order_of(suite)))
    return completion_told(followed, seen, entry, suite), beside, suite


def _draw_head(run: str, told: Mapping[str, Any], beside: Sequence[Key | None], query: str) -> None:
    key: Key = told["task"], told["prompt"], told["index"]
    with ui.element("nav").classes("trail").props('aria-label="Where this is"'):
        html.a(shortened(run, MOST_NAME), href=f"{address(run)}{query}#completions").props("dir=auto")
        for name, other in zip(("Previous", "Next"), beside, strict=True):
            if other is not None:
                html.a(name, href=_address(run, other) + query).classes("beside")
    Words("h1", shortened(name_of(key), MOST_NAME))
    with ui.element("p").classes("facts"):
        passed, why = told["passed"], told["failure"]
        said = (
            "not judged yet"
            if passed is None
            else "passed"
            if why is None
            else shortened(f"{why['class']}: {why['kind']}")
        )
        Words("small", said, f"state state-{'waits' if passed is None else 'done' if passed else 'failed'}")
        model = told.get("model")
        if model is not None:
            Words("span", f"written by {shortened(model, 200)}{by_hand([model])}")
    if told["stale"]:
        Words("p", CHANGED, "trouble")
    instruction = told.get("instruction")
    Words(
        "p", NOT_RECORDED if instruction is None else shortened(instruction, MOST_INSTRUCTION), "instruction"
    )


def _address(run: str, key: Key) -> str:
    task, prompt, index = key
    return f"{address(run)}{address(task).removeprefix('/runs')}/{prompt}/{index}"


def _draw_program(told: Mapping[str, Any]) -> None:
    with ui.element("section").classes("pane").props("aria-labelledby=h-program"):
        Words("h2", "Program").props("id=h-program")
        program = told.get("program")
        if program is None:
            Words("p", "It is not in this run any more.", "quiet")
            return
        lines = (world["line"] for world in told["worlds"] if not world["satisfied"])
        code = Code(program, (line for line in lines if isinstance(line, int)))
        if code.left_out > 0:
            Words("p", f"{code.left_out:,} more lines; all are in completions.jsonl.", "quiet")


def _draw_worlds(told: Mapping[str, Any], suite: Suite | None) -> None:
    task = None if suite is None else suite.tasks.get(told["task"])
    ablated = bool(told["evaluation"] and told["evaluation"].endswith(ABLATED))
    worlds = [] if task is None else [scenario.world for scenario in task.judged_in(ablated=ablated)]
    with ui.element("div").classes("worlds-of"):
        if not told["worlds"]:
            Words("p", "It has not been judged yet.", "quiet")
        for number, found in enumerate(told["worlds"], 1):
            world = next((world for world in worlds if world.about == found["world"]), None)
            _draw_world(number, len(told["worlds"]), found, world)


def _draw_world(number: int, of: int, found: Mapping[str, Any], world: World | None) -> None:
    good = found["satisfied"]
    steps = found["steps"]
    wrong = {check["step"] for check in found["failed_checks"]} - {None}
    with ui.element("article").classes("pane world-of").props(f"aria-labelledby=h-world-{number}"):
        with ui.element("div").classes("head"):
            name = shortened(found["world"], 300)
            Words("h2", f"World {number} of {of}: {name}").props(f"id=h-world-{number}")
            Words(
                "small",
                "satisfied" if good else "not satisfied",
                f"state state-{'done' if good else 'failed'}",
            )
        if found["error"] is not None:
            Words("p", _error(found), "quiet" if good else "trouble")
        with ui.element("ul").classes("failed-checks"):
            for check in found["failed_checks"]:
                _draw_check(check)
        if not steps and "cut" not in found:
            Words("p", "The robot did nothing.", "quiet")
        elif steps and "place" in steps[0]:
            with ui.element("ol").classes("scenes").props('aria-label="Room by room"'):
                for scene in scenes(steps, steps[0]["place"], wrong):
                    draw_scene(scene, wrong)
        if "cut" in found:
            Words("p", f"{cut_told(found['cut'])}.", "quiet")
        if steps:
            every = "Every step that was kept" if "cut" in found else "Every step"
            _draw_folded(f"{every}, {len(steps):,} in all", lambda: _draw_steps(steps))
        if world is not None:
            _draw_folded("The world", lambda: _draw_rooms(world))


def _error(found: Mapping[str, Any]) -> str:
    line = "" if found["line"] is None else f"line {found['line']}: "
    allowed = " This world may be waited in for ever, so that it is allowed." if found["satisfied"] else ""
    error = found["error"]
    return f"{shortened(error['kind'])}: {line}{shortened(error['message'])}{allowed}"


def _draw_check(check: Mapping[str, Any]) -> None:
    with ui.element("li").classes("failed-check"):
        Words("code", shortened(check["check"]))
        if check["explanation"] is not None:
            Words("span", shortened(check["explanation"], MOST_SENTENCE))
        if check["step"] is not None:
            Words("small", f"step {check['step']}", "quiet")


def _draw_folded(title: str, draw: Any) -> None:  # noqa: ANN401 - draws, and returns whatever
    """Something that is drawn when somebody unfolds it."""
    drawn = False

    def unfold(_: events.GenericEventArguments) -> None:
        nonlocal drawn
        if not drawn:
            drawn = True
            with inside:
                draw()

    with html.details().on("toggle", unfold, args=[]):
        Words("summary", title)
        inside = ui.element("div").classes("unfolded")


def _draw_steps(steps: Iterable[Mapping[str, Any]]) -> None:
    Words("pre", "\n".join(map(told_step, steps)), "source").props('tabindex=0 aria-label="Every step"')


def _draw_rooms(world: World) -> None:
    ui.html(floorplan(world, None, world.robot), sanitize=False).classes("map")
    with ui.element("dl").classes("rooms"):
        for room in world.rooms:
            people = map(person_told, room.people)
            there = ", ".join([*people, *room.objects])
            Words("dt", shortened(room.name, 200))
            Words("dd", shortened(there, 500) if there else "nobody and nothing")
