"""`Contract`: the most that a program may do. A person approves it before the program runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from codebotler.core.skills.kinds import PICK, PLACE
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import as_text
from codebotler.core.text.text_template import TextTemplate
from codebotler.core.text.words import brief, counted, elide_list, listed
from codebotler.core.trace import Event, Option, attempted_event
from codebotler.rtl import And
from codebotler.simulator.guard.house_rule import UNKNOWN_ROOM, Rule, RuleViolationError
from codebotler.simulator.worlds.robot import Argument

CONTRACT = Rule("approved contract", "Do only what the contract allows", And(()))
"""The rule that error messages name if a call breaks a contract. Names of house rules have no spaces."""

TELLING_SKILLS = frozenset({"get_all_rooms", "get_current_location"})
"""The skills that only return names of rooms. Every contract allows them."""

KINDS_WITH_PLACE = {PICK, PLACE}

Templates: TypeAlias = tuple[TextTemplate, ...]


@dataclass(frozen=True)
class RequestedCall:
    """A call that a program makes, before the skill is executed.

    Args:
        skill: the name of the skill.
        texts: for each argument, its texts (several for a list); for a goal, all rooms that it may mean.
        place: the robot's room; "" if it is unknown.
    """

    skill: str
    texts: tuple[tuple[str, ...], ...]
    place: str = ""

    @classmethod
    def of(cls, row: Skill, arguments: Sequence[Argument], rooms: Sequence[str], place: str) -> RequestedCall:
        """Create a skill call in the room `place`. For a drive, `rooms` are those that its goal may mean."""
        texts = []
        for parameter, value in zip(row.parameters, arguments, strict=True):
            if is_goal(row, parameter.name) and rooms and isinstance(value, str):
                texts.append(tuple(rooms))
            elif isinstance(value, tuple):
                some = (each.text if isinstance(each, Option) else as_text(each) for each in value)
                texts.append(tuple(some))
            else:
                texts.append((as_text(value),))
        return cls(row.name, tuple(texts), place)


def is_goal(row: Skill, parameter: str) -> bool:
    """Return whether this parameter of a skill is the room to which the robot will drive."""
    return row.is_drive and row.recording is not None and row.recording.text == parameter


def has_place(row: Skill) -> bool:
    """Return whether a contract limits in which rooms a skill may be called, as for `pick` and `place`."""
    return row.recording is not None and row.recording.kind in KINDS_WITH_PLACE


@dataclass(frozen=True)
class SkillBound:
    """The limits within which a program may call one skill.

    Args:
        texts: for each parameter, its name and templates; a text is allowed if it matches one of them.
        places: the rooms in which the skill may be called; None for any.
        at_most: how many calls one run may make, failed ones included; None for any number.
    """

    texts: tuple[tuple[str, Templates], ...] = ()
    places: tuple[str, ...] | None = None
    at_most: int | None = None

    def objection(self, call: RequestedCall) -> str:
        """Return why a call is forbidden (`since its obj may be "mug", and not "pen"`), or "" if allowed."""
        for (name, allowed), texts in zip(self.texts, call.texts, strict=True):
            for text in texts:
                if not any(template.matches(text) for template in allowed):
                    return f'since its {name} may be {_some(allowed)}, and not "{brief(text)}"'
        if self.places is not None and not call.place:
            return UNKNOWN_ROOM
        if self.places is None or call.place.casefold() in map(str.casefold, self.places):
            return ""
        return f'since it may happen in {_some(self.places)}, and not in "{brief(call.place)}"'

    def excess_over(self, other: SkillBound) -> SkillBound | None:
        """Return the part of this bound that the other bound forbids, or None if there is none.

        If this bound is wider in several ways, such as more rooms and more calls, return the whole bound.
        """
        added: list[tuple[str, Templates]] = []
        for (name, templates), (_, allowed) in zip(self.texts, other.texts, strict=True):
            added.append((name, tuple(TextTemplate.excess(templates, allowed))))
        places: tuple[str, ...] | None = ()
        if other.places is not None:
            known = {place.casefold() for place in other.places}
            places = self.places and tuple(place for place in self.places if place.casefold() not in known)
        is_more = other.at_most is not None and (self.at_most is None or self.at_most > other.at_most)
        wider = [*(new != () for _, new in added), places != (), is_more]
        if sum(wider) != 1:
            return self if any(wider) else None
        texts = (new if new[1] != () else old for new, old in zip(added, self.texts, strict=True))
        most = self.at_most if is_more else 0
        return SkillBound(tuple(texts), self.places if places == () else places, most)


@dataclass(frozen=True)
class Contract:
    """The limits of a program: the skills that it may call, with which arguments, where and how often.

    Args:
        skills: the bound of each skill that may be called; no other skill may be called.
    """

    skills: Mapping[str, SkillBound]

    def objection(self, call: RequestedCall, earlier: int = 0) -> str:
        """Return why a call is forbidden, such as "since ask may not be called", or "" if it is allowed.

        `earlier` is the number of calls of this skill in the run so far.
        """
        bound = self.skills.get(call.skill)
        if call.skill in TELLING_SKILLS:
            return ""
        if bound is None:
            return f"since {call.skill} may not be called"
        if bound.at_most is not None and earlier >= bound.at_most:
            return f"since {call.skill} may be called at most {counted(bound.at_most, 'time')}"
        return bound.objection(call)

    def excess_over(self, other: Contract) -> Contract:
        """Return the part of this contract that the other contract forbids, as a contract."""
        new = {
            name: bound if name not in other.skills else bound.excess_over(other.skills[name])
            for name, bound in self.skills.items()
            if name not in TELLING_SKILLS
        }
        return Contract({name: bound for name, bound in new.items() if bound is not None})


def contract_violation(row: Skill, arguments: Sequence[Argument], place: str, why: str) -> RuleViolationError:
    """Return the error for a forbidden call in the room `place`. `why` comes from `Contract.objection`."""
    event = attempted_event(row, arguments, place=place, time=0.0)
    return RuleViolationError(CONTRACT, event or Event(row.name, ""), "forbids", why)


def _some(values: Iterable[object]) -> str:
    shown = [f'"{brief(str(value))}"' for value in values]
    return listed(elide_list(shown), "or") or "nothing"
