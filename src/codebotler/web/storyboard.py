"""Draw what the robot would do, room by room, in a strip for each different outcome of a check."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any, NamedTuple

from nicegui import ui

from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.storyboard import event_from_step, select_steps, steps_of, wait_text
from codebotler.core.skills.kinds import CHECK, GOTO
from codebotler.core.terminal import shortened
from codebotler.core.text.phrases import NO_ANSWER, bracketed, is_question, is_spoken, phrase
from codebotler.core.trace import Event
from codebotler.missions.display.progress import ANSWER
from codebotler.simulator.worlds.sampled_facts import PRESENT_FORM
from codebotler.web.frame import PlainText

_MAX_STEP_TEXT, _MAX_WORLD_TEXT, MAX_STRIPS = 300, 800, 6
SCENE_MARKS = {
    "reached": ("✓", "reached"),
    "failed": ("✗", "failed here"),
    "stopped": ("■", "stopped here"),
}
"""For each way in which a visit to a room ended: the sign at the room, and its meaning in words."""
_LEFT_OUT = "…"  # replaces rooms in a shortened strip
_NO_STRIP_FITS = "The actual run matches none of these imagined worlds, which are only examples."


@dataclass(frozen=True)
class Action:
    """An action of the robot in a room, such as a question, or an answer that the robot hears."""

    kind: str  # the kind of event, or `ANSWER`
    text: str
    step: int = field(default=0, compare=False)  # the position in the trace, from 1; 0 for an answer
    is_repeated: bool = False  # whether an earlier mission has done the same


@dataclass(frozen=True)
class Scene:
    """One visit to a room, with the robot's actions there."""

    room: str  # the requested room if the drive fails
    deeds: tuple[Action, ...] = ()
    is_found: bool = True  # whether the room exists
    step: int = field(default=0, compare=False)  # the drive's position in the trace, from 1; 0 at the start


@dataclass(frozen=True)
class Strip:
    """The robot's visits to rooms in one imagined world, and how the program ends there."""

    world: str  # a description of the world, as the first half of a sentence
    scenes: tuple[Scene, ...]
    ending: str
    ends_well: bool


class Storyboard(NamedTuple):
    """The expected course of a mission, from its check, and how far the real robot has come."""

    check: CheckResult
    title: str
    visited: tuple[str, ...]  # the rooms of completed drives
    learned: tuple[Event, ...]  # looks and questions, with what came of them
    end: str  # how the mission ended early after that: a key of `SCENE_MARKS`


def draw_strips(board: Storyboard) -> None:
    """Draw a row of rooms for each expected outcome. Tick visited rooms; fold rows that no longer match."""
    shown = strips(board.check)
    PlainText("h3", board.title if shown else "")
    numbers = [scenes_reached(strip, board.visited, board.learned) for strip in shown]
    is_among_them = any(number is not None for number in numbers)
    if shown and not is_among_them:
        PlainText("p", _NO_STRIP_FITS, "quiet unsure")
    for strip, number_reached in zip(shown, numbers, strict=True):
        is_folded = is_among_them and number_reached is None
        with ui.element("article").classes("strip other" if is_folded else "strip"):
            if strip.world:
                PlainText("p", f"{strip.world}:", "world")
            with ui.element("ol").classes("scenes").props('aria-label="Room by room"'):
                for number, scene in enumerate(strip.scenes):
                    is_reached = number <= (number_reached or -1)
                    end = board.end if number == number_reached else ""
                    draw_scene(scene, mark=end or ("reached" if is_reached else ""))
            quality = "good" if strip.ends_well else "bad"
            PlainText("p", strip.ending, "ending quiet" if board.end else f"ending {quality}")


def scenes_reached(strip: Strip, visited: Sequence[str], learned: Sequence[Event]) -> int | None:
    """Return how many drives of an expected run are done, or None if the robot did or saw something else."""
    known = [*takewhile(lambda scene: scene.room != _LEFT_OUT, strip.scenes)]
    expected = [deed.text for scene in known for deed in scene.deeds if deed.kind in {CHECK, ANSWER}]
    actual = [_phrase(one) if one.kind == CHECK else _answer_text(one.answer) for one in learned]
    if len(known) < len(strip.scenes):  # what was left out may contain the rest
        actual = actual[: len(expected)]
    # Speech recognition may change the case of an option and add spaces.
    if _spoken(expected[: len(actual)]) != _spoken(actual):
        return None
    for number, room in enumerate(visited, start=1):
        scene = strip.scenes[number] if number < len(strip.scenes) else None
        if scene is not None and scene.room == _LEFT_OUT:
            return number
        if scene is None or scene.room != shortened(room, _MAX_STEP_TEXT):
            return None
    return len(visited)


def _spoken(texts: Iterable[str]) -> list[str]:
    return [text.strip().casefold() for text in texts]


def draw_scene(
    scene: Scene,
    marked: Container[int] = frozenset(),
    *,
    mark: str = "",
    anchor: str = "",
) -> None:
    """Draw one visit to a room. `marked` holds the numbers of steps to highlight.

    `mark` is a key of `SCENE_MARKS`, or "". With the anchor `s`, for example, step 2 gets the HTML ID `s2`.
    """
    kinds = ["scene"] if scene.deeds or not scene.is_found else ["scene", "passing"]
    kinds += ["marked"] * (scene.step in marked) + [mark] * bool(mark)
    with ui.element("li").classes(" ".join(kinds)):
        _number(PlainText("b", scene.room, "room"), scene.step, anchor)
        if mark:
            sign, words = SCENE_MARKS[mark]
            PlainText("span", sign, f"tick {mark}").props(f'role=img aria-label="{words}"')
        if not scene.is_found:
            PlainText("span", "there is no such room", "deed missing")
        for deed in scene.deeds:
            look = f"deed deed-{deed.kind}" if deed.kind == ANSWER or is_spoken(deed.kind) else "deed"
            shown = PlainText("span", deed.text, f"{look} marked" if deed.step in marked else look)
            _number(shown, deed.step, anchor)
            if deed.is_repeated:
                PlainText("span", "done already, would happen again", "repeated")


def _number(element: PlainText, step: int, anchor: str) -> None:
    if anchor and step:
        element.props(f"id={anchor}{step} data-step={step}")


# --- which strips and scenes


def strips(check: CheckResult) -> list[Strip]:
    """Return a strip for each distinct outcome of a check: at most 6, those with problems first."""
    different: dict[tuple[tuple[Scene, ...], str], tuple[Sample, Strip]] = {}
    for sample in check.samples:
        strip = _strip(sample, check)
        different.setdefault((strip.scenes, strip.ending), (sample, strip))

    def rank(each: tuple[Sample, Strip]) -> tuple[bool, bool, int]:
        """Prefer worlds in which fewer people and things are in several rooms: they are more usual."""
        places = {fact.names for fact in each[0].facts if fact.form == PRESENT_FORM}
        more = len(places) - len({name for name, _ in places})
        return each[0].number not in check.evidence, not each[1].ends_well, more

    return [strip for _, strip in sorted(different.values(), key=rank)[:MAX_STRIPS]]


def _strip(sample: Sample, check: CheckResult) -> Strip:
    error = sample.outcome.error
    is_harmless = sample.in_vain and sample.number not in check.evidence
    if is_harmless and error is not None:
        end = "Does not end" if error.kind == "TimeoutError" else "Ends without success"
        ending = f"{end} ({shortened(error.message)}), which does not count as a problem in this world."
    elif error is not None:
        ending = f"Fails: {shortened(error.message, _MAX_STEP_TEXT)} ({shortened(error.kind)})"
    else:
        ending = "Done."
    world = shortened(f"If {sample.world}", _MAX_WORLD_TEXT) if sample.facts else ""
    steps = steps_of(sample.outcome.trace, has_places=True, has_waits=True)
    repeated = {(event, event.place) for event in sample.repeated}
    for step, event in zip(steps, sample.outcome.trace, strict=True):
        step["is_repeated"] = (event, event.place) in repeated
    needed = [step["step"] for step in steps if step["is_repeated"]]
    shown = scenes(steps, check.room_map.start, needed)
    return Strip(world, shown, ending, error is None or is_harmless)


def scenes(
    steps: Sequence[Mapping[str, Any]], start: str, needed: Container[int | None] = frozenset()
) -> tuple[Scene, ...]:
    """Group steps into visits to rooms, from `start` on. Shorten long runs, but keep steps in `needed`."""
    found: list[Scene] = [Scene(shortened(start, _MAX_STEP_TEXT))]
    for is_shown, some in select_steps(steps, needed):
        if not is_shown:
            found.append(Scene(_LEFT_OUT, (Action("more", f"{len(some):,} more steps"),)))
            continue
        if found[-1].room == _LEFT_OUT and some[0]["kind"] != GOTO:
            found.append(Scene(shortened(some[0]["place"], _MAX_STEP_TEXT)))
        for step in some:
            if wait := wait_text(step):
                found[-1] = replace(found[-1], deeds=(*found[-1].deeds, Action("wait", wait)))
            if step["kind"] == GOTO:
                to = step["to"]
                room = shortened(to or step["text"], _MAX_STEP_TEXT)
                found.append(Scene(room, is_found=to is not None, step=step["step"]))
            else:
                found[-1] = replace(found[-1], deeds=(*found[-1].deeds, *_actions(step)))
    return tuple(found)


def _actions(step: Mapping[str, Any]) -> Sequence[Action]:
    kind, text, number = step["kind"], shortened(step["text"], _MAX_STEP_TEXT), step["step"]
    is_repeated = bool(step.get("is_repeated"))
    if not is_question(kind) and not is_spoken(kind):
        return (Action(kind, _phrase(event_from_step(step)), number, is_repeated),)
    if "answer" not in step:
        return (Action(kind, text, number, is_repeated),)
    text += bracketed(event_from_step(step), shortened)
    return (Action(kind, text, number, is_repeated), Action(ANSWER, _answer_text(step["answer"])))


def _answer_text(answer: object) -> str:
    return NO_ANSWER if answer is None else shortened(str(answer), _MAX_STEP_TEXT)


def _phrase(event: Event) -> str:
    return phrase(event, "third", show=lambda text: shortened(text, _MAX_STEP_TEXT), quote="")
