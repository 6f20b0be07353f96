"""Find ways to evade a rule: another name of a room, or an action inside a custom skill."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator, Sequence
from textwrap import dedent

from codebotler.checking.rule_rooms import room_patterns
from codebotler.core.errors import UserError
from codebotler.core.labels import PLAIN_LABEL
from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE, SAY
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.rtl import Regex
from codebotler.rtl.reasoning import samples
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.rule_guard import name_of
from codebotler.simulator.settings import resolve_room

KIND_OF_METHOD = {"drive": GOTO, "take": PICK, "put": PLACE, "look": CHECK, "ask": ASK}
"""The kind of event that each method of a simulated robot records."""
HARMLESS_MEMBERS = {"room", "rooms", "state", "outcome", "truth", "fail"}


def find_evasions(rules: Sequence[Rule], rooms: Sequence[str], skills: SkillTable) -> Iterator[str]:
    """Yield a sentence for each way in which a program could evade rules.

    Args:
        rules: the rules in force.
        rooms: the names of the rooms, which may be regexes.
        skills: the skills that a program may call.

    Raises:
        UserError: a rule cannot hold in these rooms.
    """
    yield from _partly_named_rooms(rules, rooms)
    yield from _unseen_skills(rules, skills)


def _unseen_skills(rules: Sequence[Rule], skills: SkillTable) -> Iterator[str]:
    """Yield a sentence for each custom skill that may act against a rule that does not name it."""
    kinds = {
        rule.name: {one.kind for one in elements(rule.formula)} for rule in rules if rule.when == "always"
    }
    for name, row in skills.items():
        done = set() if name in SKILLS else acts_inside(row)
        own = "" if row.recording is None else row.recording.kind
        evaded = [rule for rule, spoken_of in kinds.items() if done & spoken_of and own not in spoken_of]
        if evaded:
            yield (
                f'while a robot moves, rules such as "{evaded[0]}" do not see inside the skill "{name}"; '
                "name it in the rule as well"
            )


def acts_inside(row: Skill) -> set[str]:
    """Return the kinds of events that a custom skill may record; all kinds if its code is unclear."""
    always = {GOTO} if row.is_drive else set()
    if row.is_random or row.does is None:
        return always
    try:
        tree = ast.parse(dedent(inspect.getsource(row.does)))
    except (OSError, SyntaxError):
        return {*KIND_OF_METHOD.values(), SAY}
    robot = row.does.__code__.co_varnames[0]
    used = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    members = [node.attr for node in used if isinstance(node.value, ast.Name) and node.value.id == robot]
    mentions = sum(isinstance(node, ast.Name) and node.id == robot for node in ast.walk(tree))
    acts = {*members} - HARMLESS_MEMBERS
    if mentions > len(members) or acts - {*KIND_OF_METHOD}:  # the robot is passed to a function, for example
        return {*KIND_OF_METHOD.values(), SAY}
    return always | {KIND_OF_METHOD[act] for act in acts}


def _partly_named_rooms(rules: Sequence[Rule], rooms: Sequence[str]) -> Iterator[str]:
    """Yield a sentence for each rule that covers only some of the names that a room's regex allows.

    Raises:
        UserError: a rule names such a room with `^` or `$`, so that any further word of a request evades it,
            or names the room but not all of its names.
    """
    regexes = [room for room in rooms if not PLAIN_LABEL.fullmatch(room)]

    def leads_to(room: str, request: str) -> bool:
        return resolve_room(rooms, request) == room

    for rule in rules:
        for pattern in dict.fromkeys(room_patterns(rule) if regexes else ()):
            for room in regexes:
                text = Regex(pattern)
                requests = [one for one in (*samples(room), *samples(pattern)) if leads_to(room, one)]
                matching = [one for one in requests if text.matches(name_of(room, one))]
                longer = [f"x {one} x" for one in matching if leads_to(room, f"x {one} x")]
                if not all(text.matches(name_of(room, one)) for one in longer):
                    raise UserError(
                        f'the rule "{rule.name}" names a room with ^ or $, '
                        f'which other words for "{room}" evade; write the name alone'
                    )
                missed = next((one for one in requests if one not in matching), None)
                if missed is not None and text.matches(
                    room
                ):  # the author may believe that the rule covers all names
                    raise UserError(
                        f'the rule "{rule.name}" does not name "{missed}", which also means "{room}"; '
                        "write all names of the room"
                    )
                if matching and missed is not None:
                    yield (
                        f'the rule "{rule.name}" names the room "{room}" by some of its names only; '
                        f'"{missed}" does not count'
                    )
