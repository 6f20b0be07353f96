"""What a robot would do in an imagined world, as a strip of rooms with what happens in each."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from codebotler.checking.problems import Check, Sample
from codebotler.checking.storyboard import FIRST_STEPS, LAST_STEPS, MOST_STEPS, steps_of
from codebotler.core.skills import SKILLS
from codebotler.core.terminal import shortened
from codebotler.web.supposing import supposed

MOST_TEXT, MOST_WORLD = 300, 800
MOST_STRIPS = 6
VERBS = SKILLS.verbs


@dataclass(frozen=True)
class Deed:
    """Something that the robot does in a room.

    Args:
        kind: `say` and `ask` for what is spoken, `answer` for what is heard; else the event's.
        text: it, in words; any text.
        step: its number in the trace, counted from 1; 0 for what is none.
    """

    kind: str
    text: str
    step: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Scene:
    """A stay in a room.

    Args:
        room: its name; for a drive that fails what was asked for.
        deeds: what happens there, in order.
        is_found: whether there is such a room.
        step: the number of the drive there, counted from 1; 0 where the robot was at first.
    """

    room: str
    deeds: tuple[Deed, ...] = ()
    is_found: bool = True
    step: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Strip:
    """One world.

    Args:
        world: what it is like, as the first half of a sentence; empty where nothing was settled about it.
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
        ending = f"Here it breaks off: {shortened(error.message, MOST_TEXT)} ({shortened(error.kind)})"
    else:
        ending = "The program comes to its end."
    world = shortened(supposed(sample.facts), MOST_WORLD)
    return Strip(world, _scenes(sample, found), ending, error is None or sample.in_vain)


def _scenes(sample: Sample, found: Check) -> tuple[Scene, ...]:
    return scenes(steps_of(sample.outcome.trace, found.plan.room), found.plan.start)


def scenes(
    steps: Sequence[Mapping[str, Any]], start: str, needed: Container[int] = frozenset()
) -> tuple[Scene, ...]:
    """What happens, room by room; of a long trace its ends, and the steps that somebody speaks of.

    Args:
        steps: of the trace, with the rooms that drives find.
        start: the room where the robot is at first.
        needed: numbers of steps that are not left out.
    """
    found: list[Scene] = [Scene(shortened(start, MOST_TEXT))]
    cut = len(steps) > MOST_STEPS
    hidden = 0
    for number, step in enumerate(steps):
        if cut and FIRST_STEPS <= number < len(steps) - LAST_STEPS and step["step"] not in needed:
            hidden += 1
            continue
        found += _left_out(hidden)
        hidden = 0
        if step["kind"] == "goto":
            to = step["to"]
            room = shortened(to or step["text"], MOST_TEXT)
            found.append(Scene(room, is_found=to is not None, step=step["step"]))
        else:
            found[-1] = replace(found[-1], deeds=(*found[-1].deeds, *_deeds(step)))
    return tuple(found)


def _left_out(count: int) -> list[Scene]:
    return [Scene("…", (Deed("more", f"{count:,} more steps"),))] if count else []


def _deeds(step: Mapping[str, Any]) -> Sequence[Deed]:
    kind, text, number = step["kind"], shortened(step["text"], MOST_TEXT), step["step"]
    if kind == "ask":
        answer = step["answer"]
        heard = "no answer" if answer is None else shortened(str(answer), MOST_TEXT)
        return (Deed("ask", text, number), Deed("answer", heard))
    if kind == "check":
        seen = "and finds it" if step.get("found") else "but does not find it"
        return (Deed("check", f"{VERBS[kind].third} {text}, {seen}", number),)
    return (
        Deed(
            kind,
            text if kind == "say" else f"{VERBS[kind].third if kind in VERBS else shortened(kind)} {text}",
            number,
        ),
    )
