"""Chooses random facts for sampled worlds, each by the seed, the sample number and the fact's name only."""

from __future__ import annotations

from _blake2 import blake2b  # `hashlib` would load OpenSSL into every child
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

DrawMethod: TypeAlias = Literal["answer", "outcome", "is_there"]
EIGHTS = 8


@dataclass(frozen=True)
class FactSampler:
    """Chooses the random facts of one sampled world. The order in which they are chosen does not matter.

    Args:
        seed: a number that determines all results together with `sample`.
        sample: the number of this world among the worlds with the same seed.
        strict: whether facts that the program takes for granted are random; by default, they are true.
        lucky: whether seven in eight results are favourable: things and people are there, and people agree.
        forced: facts with given results, which are not chosen at random.
        by_options: whether an answer depends on the room and the options, and not on the question.
        draws_people: whether the presence of a person is random even if the program takes it for granted.
    """

    seed: int = 0
    sample: int = 0
    strict: bool = False
    lucky: bool = False
    forced: tuple[Draw, ...] = ()
    by_options: bool = False
    draws_people: bool = False

    def draw(self, count: int, *fact: str) -> int:
        """Return a random number from 0 to `count - 1` for a fact, always the same for the same texts."""
        texts = [str(self.seed), str(self.sample), *fact]
        named = "".join(f"{len(text)}:{text}" for text in texts).encode(errors="surrogatepass")
        return int.from_bytes(blake2b(named, digest_size=8).digest(), "big") % count

    def decide(self, method: DrawMethod, *arguments: str | int) -> Draw:
        """Return a fact with its result: the one given in `forced`, or else a random one.

        Args:
            method: `answer`, `outcome` or `is_there`.
            arguments: for an answer, the number of options, the position of the most affirmative one, and
                the question; for an outcome, the number of outcomes, the first of which is desired, and the
                statement; for the presence of a person or thing, the room and the name.
        """
        for given in self.forced:
            if (given.method, given.arguments) == (method, arguments):
                return given
        return Draw(method, arguments, getattr(self, f"_{method}")(*arguments))

    def _answer(self, count: int, agreeing: int, *question: str) -> int:
        if self.lucky and self.draw(EIGHTS, "agrees", *question) < EIGHTS - 1:
            return agreeing
        return self.draw(count, "answer", *question)

    def _outcome(self, count: int, statement: str) -> int:
        if self.lucky and self.draw(EIGHTS, "is hoped for", statement) < EIGHTS - 1:
            return 0
        return self.draw(count, "outcome", statement)

    def _is_there(self, room: str, name: str) -> bool:
        return self.draw(EIGHTS, "is there", room, name) < (EIGHTS - 1 if self.lucky else EIGHTS // 2)


@dataclass(frozen=True)
class Draw:
    """A random decision: what `FactSampler.decide` was asked, and the result (an index or bool)."""

    method: DrawMethod
    arguments: tuple[Any, ...]
    result: int

    @property
    def alternatives(self) -> list[Draw]:
        """Copies of this decision, one for each result that it could have had instead."""
        results = (True, False) if self.method == "is_there" else range(self.arguments[0])
        return [replace(self, result=result) for result in results if result != self.result]

    def holds_in(self, sampler: FactSampler) -> bool:
        """Return whether this decision has the same result in the world of another sampler."""
        return sampler.decide(self.method, *self.arguments).result == self.result
