"""The options of `@skill`: for each, a test of its value, and words for the values that pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from keyword import iskeyword
from math import inf
from typing import Any

from codebotler.core.skills.table import RosAction
from codebotler.core.skills.verbs import Verb

SORTS_OF_THINGS = ("room", "object", "object or person", "thing", "")


def _is_state_name(name: object) -> bool:
    return isinstance(name, str) and (not name or (name.isidentifier() and not iskeyword(name)))


SKILL_OPTIONS: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "verb": (lambda it: it is None or isinstance(it, str | Verb), 'a string such as "open {door}"'),
    "past": (lambda it: isinstance(it, str), "a string"),
    "results": (
        lambda it: isinstance(it, tuple | list) and len(it) == 2 and all(isinstance(one, str) for one in it),  # noqa: PLR2004 - for False and True
        "two texts, for False and True",
    ),
    "fails": (
        lambda it: (
            isinstance(it, Mapping) and all(isinstance(one, str) for pair in it.items() for one in pair)
        ),
        'errors with clauses, as in {"DoorLocked": "the door is locked"}',
    ),
    "ros": (
        lambda it: it is None or isinstance(it, str | RosAction),
        "a string such as lab_msgs/OpenDoor:/open_door",
    ),
    "example": (lambda it: isinstance(it, str), "a string that calls the skill"),
    "event": (
        lambda it: it is None or (isinstance(it, str) and (it or "x").isidentifier()),
        "a name, or None",
    ),
    "text": (lambda it: isinstance(it, str), "the name of a parameter"),
    "names": (lambda it: it in SORTS_OF_THINGS, "one of " + ", ".join(f'"{one}"' for one in SORTS_OF_THINGS)),
    "to": (lambda it: it is None or isinstance(it, str), "the name of a parameter"),
    "when_tried": (lambda it: it is None or isinstance(it, bool), "True, False or None"),
    "sets": (_is_state_name, 'the name of a state, such as "on"'),
    "clears": (_is_state_name, 'the name of a state, such as "on"'),
    "seconds": (lambda it: type(it) in {int, float} and 0 <= it < inf, "a number of at least 0"),
    "is_idle": (lambda it: isinstance(it, bool), "True or False"),
    "adds_event": (lambda it: isinstance(it, bool), "True or False"),
}
