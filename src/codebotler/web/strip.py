"""What a robot would do in an imagined world, as a strip of rooms with what happens in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codebotler.problems import Check, Sample
from codebotler.storyboard import FIRST_STEPS, LAST_STEPS, MOST_STEPS, steps_of
from codebotler.terminal import shortened

MOST_TEXT = 300
MOST_STRIPS = 6
WORDS = {"pick": "picks up", "place": "puts down"}


@dataclass(frozen=True)
class Deed:
    """Something that the robot does in a room.

    Args:
        kind: `say` and `ask` for what is spoken, `answer` for what is heard; else the event's.
        text: it, in words; any text.
    """

    kind: str
    text: str


@dataclass(frozen=True)
class Scene:
    """A stay in a room.

    Args:
        room: its name; for a drive that fails what was asked for.
        deeds: what happens there, in order.
        is_found: whether there is such a room.
    """

    room: str
    deeds: tuple[Deed, ...] = ()
    is_found: bool = True


@dataclass(frozen=True)
class Strip:
    """One world.

    Args:
        world: what is special about it, in words; empty where the program does the same in all.
        scenes: in order.
        ending: how it ends, in a sentence.
        ends_well: whether that is as one would wish.
    """

    world: str
    scenes: tuple[Scene, ...]
    ending: str
    ends_well: bool


def strips(found: Check) -> list[Strip]:
    """One strip for each kind of world that makes a difference; those that end well first.

    Args:
        found: by a check.
    """
    different: dict[tuple[tuple[Scene, ...], str], Strip] = {}
    for sample in found.samples:
        strip = _strip(sample, found)
        different.setdefault((strip.scenes, strip.ending), strip)
    return sorted(different.values(), key=lambda strip: not strip.ends_well)[:MOST_STRIPS]


def _strip(sample: Sample, found: Check) -> Strip:
    error = sample.outcome.error
    if sample.in_vain:
        ending = "It waits or searches in vain here, which is not held against the program."
    elif error is not None:
        ending = f"{error.kind}: {shortened(error.message, MOST_TEXT)}"
    else:
        ending = "The program comes to its end."
    return Strip(
        shortened(sample.world, MOST_TEXT), _scenes(sample, found), ending, error is None or sample.in_vain
    )


def _scenes(sample: Sample, found: Check) -> tuple[Scene, ...]:
    steps = steps_of(sample.outcome.trace, found.plan.room)
    scenes: list[Scene] = [Scene(shortened(found.plan.start, MOST_TEXT))]
    cut = len(steps) > MOST_STEPS
    for number, step in enumerate(steps):
        if cut and FIRST_STEPS <= number < len(steps) - LAST_STEPS:
            if number == FIRST_STEPS:
                hidden = len(steps) - FIRST_STEPS - LAST_STEPS
                scenes.append(Scene("…", (Deed("more", f"{hidden:,} more steps"),)))
        elif step["kind"] == "goto":
            to = step["to"]
            scenes.append(Scene(shortened(to or step["text"], MOST_TEXT), is_found=to is not None))
        else:
            last = scenes[-1]
            scenes[-1] = Scene(last.room, (*last.deeds, *_deeds(step)), last.is_found)
    return tuple(scenes)


def _deeds(step: dict[str, object]) -> Sequence[Deed]:
    kind, text = str(step["kind"]), shortened(str(step["text"]), MOST_TEXT)
    if kind == "ask":
        answer = step["answer"]
        heard = "no answer" if answer is None else shortened(str(answer), MOST_TEXT)
        return (Deed("ask", text), Deed("answer", heard))
    if kind == "check":
        return (Deed("check", f"looks for {text}: {'found' if step.get('found') else 'not found'}"),)
    return (Deed(kind, text if kind == "say" else f"{WORDS.get(kind, kind)} {text}"),)
