"""Finds rooms, things and people that a requirement names but its world lacks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from codebotler.checking.house_rules.rooms import may_mean
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.paper import SKILLS
from codebotler.core.world import Room, World
from codebotler.rtl import EventPattern
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.sample_strings import patterns
from roboeval.suites.load import Requirement, Scenario, Task

WORDS_FOR_ANYBODY = ("person", "people", "human", "anybody", "anyone", "somebody", "someone")


def absent_names(requirement: Requirement, scenario: Scenario, task: Task) -> Iterator[tuple[str, str]]:
    """Yield what a requirement mentions but its world lacks: kind and name, such as `("room", "lab")`."""
    for category, name, known in _names(requirement, scenario.world, task):
        if not may_mean(name, known):
            yield category, name


def _names(requirement: Requirement, world: World, task: Task) -> Iterator[tuple[str, str, Sequence[str]]]:
    """Yield the category and name of everything that a requirement names, and all names in that category."""
    rooms, described = world.rooms, [*map(re.escape, world.descriptions)]
    objects = [*described, *(label for room in rooms for label in room.objects)]
    people = [*described, *(person.name for room in rooms for person in room.people)]
    known_names = {
        "room": [room.name for room in rooms],
        "object": objects,
        "object or person": [*objects, *people, *WORDS_FOR_ANYBODY],
    }
    for element in elements(requirement.formula):
        row = by_event(element.kind)
        category = row.recording.names if row is not None and row.recording is not None else ""
        is_own = row is not None and row.name not in SKILLS  # may take any description, such as "red fruit"
        if (known := known_names.get(category)) is not None:
            found = [one for pattern in patterns(element.text) for one in _alternatives(pattern)]
            prompts = "\n".join(task.prompts) if is_own else ""
            asked = [one for one in found if re.search(one, prompts, re.IGNORECASE)]
            yield from ((category, one, known) for one in found if one not in asked)
        elif not category:
            yield from (("person", one, [*people, *_owners(rooms)]) for one in _mentioned(element, task))
        if element.holding is not None:
            yield from (("object", one, objects) for one in patterns(element.holding))
        if element.to is not None:
            known = [*people, *_owners(rooms), *WORDS_FOR_ANYBODY]
            yield from (("person", one, known) for one in patterns(element.to))
        if element.place is not None:
            yield from (("room", one, known_names["room"]) for one in _alternatives(element.place))
    check = next(check for check in task.checks if check.name == requirement.check)
    for parameter, argument in zip(check.parameters, requirement.arguments, strict=True):
        if parameter == "person" or argument.lower() in _people(task):
            yield "person", argument, [*people, *WORDS_FOR_ANYBODY]


def _mentioned(element: EventPattern, task: Task) -> Iterator[str]:
    texts = (text for text in (element.text, element.options) if text is not None)
    found = " | ".join(pattern for text in texts for pattern in patterns(text)).lower()
    plain = re.sub(r"\\(.)", lambda escape: " " if escape[1].isalnum() else escape[1], found)
    for name in sorted(_people(task)):
        if re.search(rf"\b{re.escape(name)}\b", plain):
            yield name


def _people(task: Task) -> set[str]:
    """Return the lower-case names of all people in a task's worlds, and of the owners of offices and labs."""
    scenarios = (*task.scenarios, *(task.ablation or ()))
    rooms = [room for scenario in scenarios for room in scenario.world.rooms]
    names = [*(person.name for room in rooms for person in room.people), *_owners(rooms)]
    return {name.lower() for name in names}


def _owners(rooms: Iterable[Room]) -> list[str]:
    owners = (re.fullmatch(r"(.+)'s (?:office|lab)", room.name, re.IGNORECASE) for room in rooms)
    return [owner[1] for owner in owners if owner]


def _alternatives(pattern: str) -> list[str]:
    """Split a regex such as `kitchen|mail room` at its bars. Any other regex is one name."""
    return pattern.split("|") if re.fullmatch(r"[\w' ]+(\|[\w' ]+)*", pattern) else [pattern]
