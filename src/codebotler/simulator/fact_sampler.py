"""Lots: how the facts of imagined worlds are drawn, so that each can be drawn again."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b
from typing import TypeAlias

EIGHTS = 8


@dataclass(frozen=True)
class FactSampler:
    """How the facts of one imagined world are drawn: each from its own name, in whatever order.

    Args:
        seed: any whole number.
        sample: the number of this world among those of the same seed.
        strict: whether what the program never looked for is drawn, too; else it is as the program takes it.
        lucky: whether who or what is looked for is there, and who is asked agrees, in seven of eight cases.
    """

    seed: int = 0
    sample: int = 0
    strict: bool = False
    lucky: bool = False

    def draw(self, count: int, *fact: str) -> int:
        """One of the numbers from 0 to `count - 1` for a fact."""
        texts = [str(self.seed), str(self.sample), *fact]
        named = "".join(f"{len(text)}:{text}" for text in texts).encode(errors="surrogatepass")
        return int.from_bytes(blake2b(named, digest_size=8).digest(), "big") % count

    def answer(self, count: int, agreeing: int, *question: str) -> int:
        """The position of the option that somebody chooses, by chance.

        Args:
            count: how many options there are.
            agreeing: the position of the one that agrees most.
            question: which question it is.
        """
        if self.lucky and self.draw(EIGHTS, "agrees", *question) < EIGHTS - 1:
            return agreeing
        return self.draw(count, "answer", *question)

    def is_there(self, room: str, name: str) -> bool:
        """Whether somebody or something is in a room, by chance."""
        return self.draw(EIGHTS, "is there", room, name) < (EIGHTS - 1 if self.lucky else EIGHTS // 2)


@dataclass(frozen=True)
class Presence:
    """What was drawn on whether somebody or something is in a room.

    Args:
        room: the room.
        name: who or what, as `meant` names it.
        drawn: whether it is there.
    """

    room: str
    name: str
    drawn: bool

    def is_drawn_by(self, lot: FactSampler) -> bool:
        """Whether the same would be drawn in another world."""
        return lot.is_there(self.room, self.name) == self.drawn


@dataclass(frozen=True)
class Answer:
    """What was drawn for the answer to a question.

    Args:
        count: how many options there were.
        agreeing: the position of the one that agrees most.
        question: which question it was.
        drawn: the position of the option that was chosen.
    """

    count: int
    agreeing: int
    question: tuple[str, ...]
    drawn: int

    def is_drawn_by(self, lot: FactSampler) -> bool:
        """Whether the same would be drawn in another world."""
        return lot.answer(self.count, self.agreeing, *self.question) == self.drawn


Draw: TypeAlias = Presence | Answer
