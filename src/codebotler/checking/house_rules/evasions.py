"""Find ways to evade a rule: through another name for a room, or through an action inside a custom skill."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from codebotler.checking.house_rules.rooms import room_patterns
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.labels import PLAIN_LABEL
from codebotler.core.text.words import listed
from codebotler.rtl import Regex
from codebotler.rtl.reasoning import samples
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.guard.rule_guard import name_of
from codebotler.simulator.worlds.matching import meant_by


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
        yield (
            f"rules do not see inside the skill {listed(unseen)} while the robot moves; "
            "name the skill in each rule that should limit it"
        )


def _expect_all_names(rule: Rule, room: str, rooms: Sequence[str]) -> None:
    """Raise UserError if a rule names a room but does not match every request that leads there."""
    for pattern in room_patterns(rule):
        text = Regex(pattern)
        words = [*samples(room), *samples(pattern)]
        requests = [
            one for one in (*words, *(f"x {one} x" for one in words)) if meant_by(one, rooms) == [room]
        ]
        missed = [one for one in requests if not text.matches(name_of(room, one))]
        if missed and (len(missed) < len(requests) or text.matches(room)):
            raise UserError(
                f'the rule "{rule.name}" does not cover "{missed[0]}", which also means the room "{room}"; '
                "use a pattern that matches every name of the room"
            )
