"""The facts of a sampled world, and what a program has found out about its rooms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from codebotler.core.words import brief
from codebotler.simulator.matching import SOMEBODY, contains


@dataclass(frozen=True)
class Whereabouts:
    """The fact that a person or thing is, or is not, in a room."""

    name: str  # the canonical name, as returned by `normalized`
    room: str
    is_there: bool
    is_random: bool = True  # False if it holds because the program assumed it

    @property
    def sentence(self) -> str:
        """The fact in words."""
        if self.name == SOMEBODY:
            subject = f"{SOMEBODY} is" if self.is_there else "nobody is"
        else:
            subject = f'"{brief(self.name)}" is' if self.is_there else f'"{brief(self.name)}" is not'
        return f'{subject} in "{brief(self.room)}"'


@dataclass(frozen=True)
class GivenAnswer:
    """The fact that a person answers a question in a particular way."""

    room: str
    question: str
    answer: str
    is_random: bool = True

    @property
    def sentence(self) -> str:
        """The fact in words."""
        where = f'in "{brief(self.room)}" to "{brief(self.question)}"'
        return f'the answer {where} is "{brief(self.answer)}"'


@dataclass(frozen=True)
class RandomOutcome:
    """The fact that a statement is true or false, or that a skill has a particular result."""

    statement: str
    outcome: str
    is_random: bool = True

    @property
    def sentence(self) -> str:
        """The fact in words."""
        return f"{brief(self.statement)} {self.outcome}"


SampledFact: TypeAlias = Whereabouts | GivenAnswer | RandomOutcome


# --- the program's knowledge, by canonical names


@dataclass
class ExploredRoom:
    """What a program knows about one room."""

    missed: set[str] = field(default_factory=set)  # looked for and not found
    gone: set[str] = field(default_factory=set)  # picked up here
    people: set[str] = field(default_factory=set)

    def lacks(self, name: str) -> bool:
        """Return whether a name, or a longer name that contains it, is known to be absent."""
        missed = self.missed
        return name in missed or (name != SOMEBODY and any(contains(longer, name) for longer in missed))


@dataclass
class RoomSearch:
    """The rooms in which a program looked for a person or thing."""

    vain: set[str] = field(default_factory=set)
    found: set[str] = field(default_factory=set)

    @property
    def is_lost(self) -> bool:
        """Whether the program searched several rooms without success."""
        return len(self.vain) > 1 and not self.found
