"""Compare the rooms that house rules name with the rooms of a house, and find ways to evade a rule."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from codebotler.checking.problems import closest_room
from codebotler.core.errors import UserError
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.labels import PLAIN_LABEL
from codebotler.core.text.words import listed
from codebotler.rtl import Regex
from codebotler.rtl.reasoning import samples
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.sample_strings import patterns
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.guard.rule_guard import name_of
from codebotler.simulator.worlds.matching import is_in_request, meant_by


def unknown_rooms_in(rule: Rule, rooms: Sequence[str]) -> Iterator[str]:
    """Yield an error message for each unknown room that a rule names; none if `rooms` is empty."""
    if rule.any_room or not rooms:
        return
    poses = {pattern for one in rule.inside for pattern in patterns(one.text)}
    for pattern in dict.fromkeys(room_patterns(rule)):
        if not may_mean(pattern, rooms) or (pattern in poses and not any(map(Regex(pattern).matches, rooms))):
            missing = f'the room "{pattern}", which does not exist{closest_room(pattern, rooms)}'
            yield f'the rule "{rule.name}" names {missing}; correct it, or add "any: true"'


def room_patterns(rule: Rule) -> Iterator[str]:
    """Yield the regexes in a rule that name rooms."""
    for element in elements(rule.formula):
        if element.place is not None:
            yield element.place
        row = by_event(element.kind)
        if row is not None and row.is_drive:
            yield from patterns(element.text)


def may_mean(pattern: str, labels: Iterable[str]) -> bool:
    """Whether a regex may mean one of the labels. Also True if it is too general or complex to tell."""
    matches, texts = Regex(pattern).matches, samples(pattern)
    return (
        not texts
        or matches("")
        or matches("\uffff")
        or any(matches(label) or any(is_in_request(label, text) for text in texts) for label in labels)
    )


# --- evasions


def find_evasions(rules: Sequence[Rule], rooms: Sequence[str], skills: SkillTable) -> Iterator[str]:
    """Yield a warning if programs could evade rules through custom skills that no rule names.

    Args:
        rules: the rules in force.
        rooms: the names of the rooms, which may be regexes.
        skills: the skills that a program may call.

    Raises:
        UserError: a rule covers only some names of a room.
    """
    for rule in rules:
        for room in rooms:
            if not PLAIN_LABEL.fullmatch(room):
                _expect_all_names(rule, room, rooms)
    named = {one.kind for rule in rules for one in elements(rule.formula)}
    unseen = [
        name
        for name, row in skills.items()
        if name not in SKILLS
        and (row.is_drive or not row.is_random)
        and (row.recording is None or row.recording.kind not in named)
    ]
    if rules and unseen:
        act = f"what the skill {listed(unseen)} makes the robot do"
        yield f"rules do not see {act}; name the skill in each rule that should limit it"


def _expect_all_names(rule: Rule, room: str, rooms: Sequence[str]) -> None:
    """Raise UserError if a rule names a room but does not match every request that leads there."""
    for pattern in room_patterns(rule):
        text = Regex(pattern)
        words = [*samples(room), *samples(pattern)]
        asked = (*words, *(f"x {one} x" for one in words))
        requests = [one for one in asked if meant_by(one, rooms) == [room]]
        missed = [one for one in requests if not text.matches(name_of(room, one))]
        if missed and (len(missed) < len(requests) or text.matches(room)):
            other = f'"{missed[0]}", another name of the room "{room}"'
            fix = "use a pattern for all names of the room"
            raise UserError(f'the rule "{rule.name}" does not cover {other}; {fix}')
