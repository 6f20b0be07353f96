"""From an instruction to a program: ask a model, check what it wrote, ask again if that has problems."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, TypeAlias

from codebotler.core.words import counted
from codebotler.models.base import Heard, Model, Reply, unheard
from codebotler.prompts import Prompt

Checker: TypeAlias = Callable[[str], Sequence[str]]
"""Says what is wrong with a program, each problem in a sentence; nothing if it is accepted."""


@dataclass(frozen=True)
class Attempt:
    """One reply of a model, and what the check says of it.

    Args:
        number: which sample of the prompt it is, counted from 0.
        prompt: what was asked; that of a repair holds the program before and its problems.
        reply: what the model wrote.
        problems: what is wrong with it, each in a sentence; none if it was accepted, or not checked.
    """

    number: int
    prompt: Prompt = field(repr=False)
    reply: Reply = field(repr=False)
    problems: tuple[str, ...]

    def data(self, model: str) -> dict[str, Any]:
        """The attempt as a row of JSON.

        Args:
            model: the name of who was asked.
        """
        return {
            "instruction": self.prompt.instruction,
            "model": model,
            "number": self.number,
            "prompt": [asdict(message) for message in self.prompt.messages],
            "program": self.reply.program,
            "problems": list(self.problems),
            "raw_reply": self.reply.text,
            "usage": asdict(self.reply.usage),
            "latency_s": round(self.reply.latency_s, 3),
            "finish_reason": self.reply.finish_reason,
        }


@dataclass(frozen=True)
class Generation:
    """All attempts at a program, in order; the last one counts.

    Args:
        attempts: at least one.
    """

    attempts: tuple[Attempt, ...]

    def __repr__(self) -> str:
        attempts, problems = counted(len(self.attempts), "attempt"), counted(len(self.problems), "problem")
        return f"Generation({attempts}, {problems})"

    @property
    def program(self) -> str:
        """The program that came out of it."""
        return self.attempts[-1].reply.program

    @property
    def problems(self) -> tuple[str, ...]:
        """What is still wrong with it."""
        return self.attempts[-1].problems


def untold(_attempt: Attempt) -> None:
    """Tell nobody."""


async def generate(
    model: Model,
    prompt: Prompt,
    check: Checker | None = None,
    *,
    retries: int = 0,
    repair: bool = False,
    number: int = 0,
    heard: Heard = unheard,
    tried: Callable[[Attempt], None] = untold,
) -> Generation:
    """Ask for a program until the check accepts one (rejection sampling; paper, section V).

    Args:
        model: who is asked.
        prompt: what is asked.
        check: what accepts or rejects programs; without it, the first one is taken.
        retries: how many times a rejected program is asked for again, at least 0.
        repair: whether to ask again with the program and its problems in the request, not as the first time.
        number: which sample of the prompt the first attempt is, counted from 0; further ones count on.
        heard: told each piece of text as it comes in.
        tried: told each attempt as it ends, before the next one begins.

    Raises:
        ModelError: no whole reply came.
        BudgetSpentError: no further request may be made.
    """
    attempts: list[Attempt] = []
    asked = prompt
    for sample in range(number, number + retries + 1):
        reply = await model.reply(asked, number=sample, heard=heard)
        problems = () if check is None else tuple(await asyncio.to_thread(check, reply.program))
        attempts.append(Attempt(sample, asked, reply, problems))
        tried(attempts[-1])
        if not problems:
            break
        if repair:
            asked = prompt.after(reply.program, problems)
    return Generation(tuple(attempts))
