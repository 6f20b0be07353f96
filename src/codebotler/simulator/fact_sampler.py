"""Draws the facts of sampled worlds, each from its own name, so that they can be drawn again."""

from __future__ import annotations

from _blake2 import blake2b  # of `hashlib`, which would bring OpenSSL into every child
from dataclasses import dataclass, replace
from typing import Any, Literal

EIGHTS = 8


@dataclass(frozen=True)
class FactSampler:
    """Draws the facts of one sampled world: each from its own name, in whatever order."""

    seed: int = 0
    sample: int = 0  # the number of this world among those of the same seed
    strict: bool = False  # draws also what the program never looked for; else that is as the program assumes
    lucky: bool = False  # what is looked for is there, and who is asked agrees, in seven of eight cases
    forced: tuple[Draw, ...] = ()  # facts that are so, and are not drawn

    def draw(self, count: int, *fact: str) -> int:
        """One of the numbers from 0 to `count - 1` for a fact."""
        texts = [str(self.seed), str(self.sample), *fact]
        named = "".join(f"{len(text)}:{text}" for text in texts).encode(errors="surrogatepass")
        return int.from_bytes(blake2b(named, digest_size=8).digest(), "big") % count

    def answer(self, count: int, agreeing: int, *question: str) -> int:
        """Which of `count` options somebody chooses, of which `agreeing` is the one that agrees most."""
        for fact in self.forced:
            if fact.method == "answer" and fact.arguments == (count, agreeing, *question):
                return fact.result
        if self.lucky and self.draw(EIGHTS, "agrees", *question) < EIGHTS - 1:
            return agreeing
        return self.draw(count, "answer", *question)

    def outcome(self, count: int, statement: str) -> int:
        """Which of `count` outcomes a statement has, of which the first is the one that is hoped for."""
        for fact in self.forced:
            if fact.method == "outcome" and fact.arguments == (count, statement):
                return fact.result
        if self.lucky and self.draw(EIGHTS, "is hoped for", statement) < EIGHTS - 1:
            return 0
        return self.draw(count, "outcome", statement)

    def is_there(self, room: str, name: str) -> bool:
        """Whether somebody or something is in a room."""
        for fact in self.forced:
            if fact.method == "is_there" and fact.arguments == (room, name):
                return bool(fact.result)
        return self.draw(EIGHTS, "is there", room, name) < (EIGHTS - 1 if self.lucky else EIGHTS // 2)


@dataclass(frozen=True)
class Draw:
    """One fact that was drawn: the sampler's method, its arguments, and its result."""

    method: Literal["answer", "outcome", "is_there"]
    arguments: tuple[Any, ...]
    result: int

    @property
    def others(self) -> list[Draw]:
        """The same fact as it might have been."""
        results = (True, False) if self.method == "is_there" else range(self.arguments[0])
        return [replace(self, result=result) for result in results if result != self.result]

    def is_drawn_by(self, sampler: FactSampler) -> bool:
        """Whether the same would be drawn in another world."""
        return bool(getattr(sampler, self.method)(*self.arguments) == self.result)
