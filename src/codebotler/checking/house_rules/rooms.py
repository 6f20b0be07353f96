"""Compare the rooms that house rules name with the rooms of a house."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from codebotler.checking.problems import closest_room
from codebotler.core.skills.declaration import by_event
from codebotler.rtl import Regex
from codebotler.rtl.reasoning import samples
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.sample_strings import patterns
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worlds.matching import is_in_request


def unknown_rooms_in(rule: Rule, rooms: Sequence[str]) -> Iterator[str]:
    """Yield a sentence for each room that a rule names but the house lacks, unless `rooms` is empty."""
    if rule.any_room or not rooms:
        return
    poses = {pattern for one in rule.inside for pattern in patterns(one.text)}
    for pattern in dict.fromkeys(room_patterns(rule)):
        if not may_mean(pattern, rooms) or (pattern in poses and not any(map(Regex(pattern).matches, rooms))):
            yield (
                f'the rule "{rule.name}" names the room "{pattern}", which does not exist'
                f'{closest_room(pattern, rooms)}; correct it, or add "any: true"'
            )


def room_patterns(rule: Rule) -> Iterator[str]:
    """Yield the regexes in a rule that name rooms."""
    for element in elements(rule.formula):
        if element.place is not None:
            yield element.place
        row = by_event(element.kind)
        if row is not None and row.is_drive:
            yield from patterns(element.text)


def may_mean(pattern: str, labels: Iterable[str]) -> bool:
    """Whether a regex may refer to one of these labels, or matches everything or nothing."""
    matches, texts = Regex(pattern).matches, samples(pattern)
    return (
        not texts
        or matches("")
        or matches("\uffff")
        or any(matches(label) or any(is_in_request(label, text) for text in texts) for label in labels)
    )
