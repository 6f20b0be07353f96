"""Draws random facts of sampled worlds: a pure function of seed, sample and the fact's name."""

from __future__ import annotations

from _blake2 import blake2b  # of `hashlib`, which would bring OpenSSL into every child
from dataclasses import dataclass, replace
from typing import Any, Literal

EIGHTS = 8


@dataclass(frozen=True)
class FactSampler:
    """Draws the facts of one sampled world, in any order."""

    seed: int = 0
    sample: int = 0  # the number of this world among those of the same seed
    strict: bool = False  # also draw facts that the program never looked for; else they are as it assumes
    lucky: bool = False  # things and people are there, and people agree, in seven of eight cases
    forced: tuple[Draw, ...] = ()  # facts with a given result instead of a random one

    def draw(self, count: int, *fact: str) -> int:
        """One of the numbers from 0 to `count - 1` for a fact."""
        texts = [str(self.seed), str(self.sample), *fact]
        named = "".join(f"{len(text)}:{text}" for text in texts).encode(errors="surrogatepass")
        return int.from_bytes(blake2b(named, digest_size=8).digest(), "big") % count

    def answer(self, count: int, agreeing: int, *question: str) -> int:
        """The option, of `count`, that somebody chooses; `agreeing` is the one that agrees most."""
        known = self._forced("answer", count, agreeing, *question)
        if known is not None:
            return known
        if self.lucky and self.draw(EIGHTS, "agrees", *question) < EIGHTS - 1:
            return agreeing
        return self.draw(count, "answer", *question)

    def outcome(self, count: int, statement: str) -> int:
        """The outcome, of `count`, of a statement; the first one is the hoped-for one."""
        known = self._forced("outcome", count, statement)
        if known is not None:
            return known
        if self.lucky and self.draw(EIGHTS, "is hoped for", statement) < EIGHTS - 1:
            return 0
        return self.draw(count, "outcome", statement)

    def is_there(self, room: str, name: str) -> bool:
        """Whether somebody or something is in a room."""
        known = self._forced("is_there", room, name)
        if known is not None:
            return bool(known)
        return self.draw(EIGHTS, "is there", room, name) < (EIGHTS - 1 if self.lucky else EIGHTS // 2)

    def _forced(self, method: str, *arguments: object) -> int | None:
        same = (fact.result for fact in self.forced if (fact.method, fact.arguments) == (method, arguments))
        return next(same, None)


@dataclass(frozen=True)
class Draw:
    """A random fact: the sampler's method, its arguments, and its result."""

    method: Literal["answer", "outcome", "is_there"]
    arguments: tuple[Any, ...]
    result: int

    @property
    def alternatives(self) -> list[Draw]:
        """The same fact with each other result."""
        results = (True, False) if self.method == "is_there" else range(self.arguments[0])
        return [replace(self, result=result) for result in results if result != self.result]

    def holds_in(self, sampler: FactSampler) -> bool:
        """Whether another world has the same result."""
        return bool(getattr(sampler, self.method)(*self.arguments) == self.result)
