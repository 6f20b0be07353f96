"""Storyboards on the page: a strip for each kind of sampled world."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from nicegui import ui

from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.storyboard import event_from_step, select_steps, steps_of
from codebotler.core.phrases import NO_ANSWER, is_question, is_spoken, phrase
from codebotler.core.skills.kinds import CHECK, GOTO
from codebotler.core.terminal import shortened
from codebotler.core.trace import Event
from codebotler.web.frame import PlainText

MOST_TEXT, MOST_WORLD, MOST_STRIPS = 300, 800, 6
LEFT_OUT = "…"  # instead of a room, where steps are left out


@dataclass(frozen=True)
class Deed:
    """Something that the robot does in a room."""

    kind: str  # `say`, `ask` and `answer` for what is spoken; else the event's
    text: str
    step: int = field(default=0, compare=False)  # in the trace, from 1; 0 for an answer


@dataclass(frozen=True)
class Scene:
    """A stay in a room."""

    room: str  # for a drive that fails, the room that was asked for
    deeds: tuple[Deed, ...] = ()
    is_found: bool = True  # whether there is such a room
    step: int = field(default=0, compare=False)  # of the drive there, from 1; 0 where the robot started


@dataclass(frozen=True)
class Strip:
    """The scenes of one sampled world."""

    world: str  # what it is like, as the first half of a sentence
    scenes: tuple[Scene, ...]
    ending: str
    ends_well: bool


@dataclass(frozen=True)
class Reached:
    """How far a robot has come."""

    visited: tuple[str, ...] = ()  # rooms
    looks: tuple[tuple[str, bool], ...] = ()  # what it looked for, and whether it was found
    answers: tuple[str | None, ...] = ()  # to its questions; None where one failed


NOWHERE = Reached()
NONE_FITS = "What happened fits none of the imagined worlds; they are only examples."


def draw_strips(check: CheckResult, reached: Reached = NOWHERE) -> None:
    """Draw what a robot would do, as far as a check found, and tick off the rooms that it has visited.

    A strip that is no longer possible is folded.
    """
    shown = strips(check)
    PlainText("h3", "What the robot would do" if shown else "")
    numbers = [scenes_reached(strip, reached) for strip in shown]
    if shown and all(number is None for number in numbers):
        PlainText("p", NONE_FITS, "quiet unsure")
    for strip, number_reached, is_folded in zip(shown, numbers, folded(numbers), strict=True):
        with ui.element("article").classes("strip other" if is_folded else "strip"):
            if strip.world:
                PlainText("p", f"{strip.world}:", "world")
            with ui.element("ol").classes("scenes").props('aria-label="Room by room"'):
                for number, scene in enumerate(strip.scenes):
                    is_reached = bool(reached.visited and number_reached) and number <= (number_reached or 0)
                    draw_scene(scene, is_reached=is_reached)
            PlainText("p", strip.ending, "ending good" if strip.ends_well else "ending bad")


def folded(numbers: Sequence[int | None]) -> list[bool]:
    """Whether each strip is folded: none is where none fits, since they are but some worlds."""
    is_among_them = any(number is not None for number in numbers)
    return [is_among_them and number is None for number in numbers]


def scenes_reached(strip: Strip, reached: Reached) -> int | None:
    """How many drives of a strip the robot has made; None if it went, found or heard something else."""
    is_whole = all(scene.room != LEFT_OUT for scene in strip.scenes)
    if is_whole and not (_has_seen(strip, reached.looks) and _has_heard(strip, reached.answers)):
        return None
    for number, room in enumerate(reached.visited, start=1):
        scene = strip.scenes[number] if number < len(strip.scenes) else None
        if scene is not None and scene.room == LEFT_OUT:
            return number
        if scene is None or scene.room != shortened(room, MOST_TEXT):
            return None
    return len(reached.visited)


def _has_seen(strip: Strip, looks: Sequence[tuple[str, bool]]) -> bool:
    return _texts(strip, CHECK)[: len(looks)] == [look_text(*look) for look in looks]


def _has_heard(strip: Strip, answers: Sequence[str | None]) -> bool:
    """Robots that hear people may return an option in another case and with blanks around it."""
    heard = [NO_ANSWER if answer is None else shortened(answer, MOST_TEXT) for answer in answers]
    told = _texts(strip, "answer")[: len(answers)]
    return [text.strip().casefold() for text in told] == [text.strip().casefold() for text in heard]


def _texts(strip: Strip, kind: str) -> list[str]:
    return [deed.text for scene in strip.scenes for deed in scene.deeds if deed.kind == kind]


def draw_scene(
    scene: Scene, wrong: Container[int] = frozenset(), *, is_reached: bool = False, anchor: str = ""
) -> None:
    """Draw a stay in a room, and mark the steps whose numbers are wrong.

    With an `anchor`, each step has it and its number as an id, to which links lead.
    """
    kinds = ["scene"] if scene.deeds or not scene.is_found else ["scene", "passing"]
    kinds += ["wrong"] * (scene.step in wrong) + ["reached"] * is_reached
    with ui.element("li").classes(" ".join(kinds)):
        _number(PlainText("b", scene.room, "room"), scene.step, anchor)
        if is_reached:
            PlainText("span", "✓", "tick").props('role=img aria-label="reached"')
        if not scene.is_found:
            PlainText("span", "there is no such room", "deed missing")
        for deed in scene.deeds:
            look = f"deed deed-{deed.kind}" if deed.kind == "answer" or is_spoken(deed.kind) else "deed"
            shown = PlainText("span", deed.text, f"{look} wrong" if deed.step in wrong else look)
            _number(shown, deed.step, anchor)


def _number(element: PlainText, step: int, anchor: str) -> None:
    if anchor and step:
        element.props(f"id={anchor}{step} data-step={step}")


# --- which strips and scenes


def strips(check: CheckResult) -> list[Strip]:
    """One strip for each kind of world that makes a difference: those that show a problem first."""
    different: dict[tuple[tuple[Scene, ...], str], tuple[bool, Strip]] = {}
    for sample in check.samples:
        strip = _strip(sample, check)
        different.setdefault((strip.scenes, strip.ending), (sample.number in check.evidence, strip))
    ranked = sorted(different.values(), key=lambda each: (not each[0], not each[1].ends_well))
    return [strip for _, strip in ranked[:MOST_STRIPS]]


def _strip(sample: Sample, check: CheckResult) -> Strip:
    error = sample.outcome.error
    if sample.in_vain:
        ending = "The robot waits or searches without success, which is not counted as a problem."
    elif error is not None:
        ending = f"Fails: {shortened(error.message, MOST_TEXT)} ({shortened(error.kind)})"
    else:
        ending = "Done."
    world = shortened(f"If {sample.world}", MOST_WORLD) if sample.facts else ""
    shown = scenes(steps_of(sample.outcome.trace, has_places=True), check.room_map.start)
    return Strip(world, shown, ending, error is None or sample.in_vain)


def scenes(
    steps: Sequence[Mapping[str, Any]], start: str, needed: Container[int | None] = frozenset()
) -> tuple[Scene, ...]:
    """The scenes of a trace from its start on; of a long one its ends, and the steps that are needed."""
    found: list[Scene] = [Scene(shortened(start, MOST_TEXT))]
    for is_shown, some in select_steps(steps, needed):
        if not is_shown:
            found.append(Scene(LEFT_OUT, (Deed("more", f"{len(some):,} more steps"),)))
            continue
        for step in some:
            if step["kind"] == GOTO:
                to = step["to"]
                room = shortened(to or step["text"], MOST_TEXT)
                found.append(Scene(room, is_found=to is not None, step=step["step"]))
            else:
                found[-1] = replace(found[-1], deeds=(*found[-1].deeds, *_deeds(step)))
    return tuple(found)


def _deeds(step: Mapping[str, Any]) -> Sequence[Deed]:
    kind, text, number = step["kind"], shortened(step["text"], MOST_TEXT), step["step"]
    if not is_question(kind) and not is_spoken(kind):
        return (Deed(kind, _phrase(event_from_step(step)), number),)
    if "answer" not in step:
        return (Deed(kind, text, number),)
    heard = NO_ANSWER if step["answer"] is None else shortened(str(step["answer"]), MOST_TEXT)
    return (Deed(kind, text, number), Deed("answer", heard))


def look_text(what: str, is_found: bool) -> str:  # noqa: FBT001 - as in the trace
    """A look and its result in words."""
    return _phrase(Event(CHECK, what, found=is_found))


def _phrase(event: Event) -> str:
    return phrase(event, "third", show=lambda text: shortened(text, MOST_TEXT), quote="")
