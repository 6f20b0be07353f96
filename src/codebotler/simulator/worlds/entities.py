"""The things and people of a simulated world, and how requests refer to them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from codebotler.core.world import Answer, Person
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worlds.matching import Entity, Matching, best_fits, finds

NO_WORDS: frozenset[str] = frozenset()


@dataclass
class Thing:
    """An object in a room: its label, and the words that describe it."""

    label: str
    is_pattern: bool = True  # whether the label is a regex, and not the literal name of a thing put down
    traits: frozenset[str] = frozenset()  # the words that describe it

    @property
    def entity(self) -> Entity:
        """The label, as a regex, and the traits by which requests refer to this thing."""
        return Entity(self.label if self.is_pattern else re.escape(self.label), self.traits)

    def is_meant_by(self, request: str, matching: Matching = "label-in-request") -> bool:
        """Return whether a request such as "the red mug" means this thing. `matching` is set by the suite."""
        if matching == "longest-name":
            return bool(best_fits(request, [self.entity]))
        if self.is_pattern:
            return finds(request, self.label, matching)
        return self.label.lower() in request.lower()  # a regex of a long name may take minutes


class Somebody:
    """A person in a room, and the answers that this person can still give."""

    def __init__(self, person: Person, traits: frozenset[str] = frozenset()) -> None:
        self.person, self.traits = person, traits
        self.answers = [*person.answers]
        self.looks_before = person.after_looks
        self.is_gone = False

    @property
    def is_here(self) -> bool:
        """Whether the person is in the room now."""
        return self.looks_before == 0 and not self.is_gone

    def is_meant_by(self, request: str, settings: SimulationSettings) -> bool:
        """Return whether a request, which may be a name, a word for people or empty, means this person."""
        if settings.people == "answer-to-any-name" or not request.strip():
            return True
        if settings.matching == "longest-name":
            return bool(best_fits(request, [self.entity], settings.words_for_people))
        names = (self.person.name, *settings.words_for_people)
        return any(finds(request, name, settings.matching) for name in names)

    @property
    def entity(self) -> Entity:
        """The name and the traits by which requests refer to this person."""
        return Entity(self.person.name, self.traits)

    def answer(self, question: str, settings: SimulationSettings) -> Answer | None:
        """Return the person's answer for the question's topic or, by default, their next answer, if any."""
        for topic, answer in self.person.topics:
            if finds(question, topic, settings.matching):
                return answer
        if not self.answers:
            return None
        answer = self.answers[0]
        if len(self.answers) > 1:  # the last answer is repeated
            del self.answers[0]
        else:
            self.is_gone = self.person.leaves
        return answer
