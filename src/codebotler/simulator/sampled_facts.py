"""The facts of a sampled world, in the words of the messages about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from codebotler.core.words import brief

SOMEBODY = "somebody"


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
