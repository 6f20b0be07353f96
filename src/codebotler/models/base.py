"""What all ways of talking to a model have in common."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol, TypeAlias
from urllib.parse import urlsplit

from codebotler.core.errors import UserError
from codebotler.prompts import Prompt
from codebotler.prompts.extract import program_of

Heard: TypeAlias = Callable[[str], None]

HUGE = 20_000  # characters
A_URL = "write one like http://localhost:8000/v1"
NOT_IN_URL = "keys belong into the environment, not into a URL, which is recorded with a run"


@dataclass(frozen=True)
class SamplingSettings:
    """How a model is to be asked.

    Args:
        temperature: from 0 (always the likeliest token) up to about 2; None leaves it to the model.
        top_p: the share of likely tokens that are drawn from, above 0 and up to 1; None leaves it to the
            model.
        max_tokens: how long a reply may be, in tokens, at least 1.
        seed: what fixes the random numbers, where a model takes a seed; reply number n is asked for with
            `seed + n`.
        timeout: how many seconds one request may take altogether.
        base_url: where the model is served, such as `http://localhost:8000/v1`; None for the provider's own.

    Raises:
        UserError: one of them is out of its range.
    """

    temperature: float | None = 0.2
    top_p: float | None = 0.95
    max_tokens: int = 512
    seed: int | None = None
    timeout: float = 60.0
    base_url: str | None = None

    def __post_init__(self) -> None:
        if self.temperature is not None and not 0 <= self.temperature <= 100:  # noqa: PLR2004 - a typo beyond it
            raise UserError(f"the temperature is {self.temperature:g}, but it must be between 0 and 100")
        if self.top_p is not None and not 0 < self.top_p <= 1:
            raise UserError(f"top-p is {self.top_p:g}, but it must be above 0 and at most 1")
        if self.max_tokens < 1:
            raise UserError(f"the limit of tokens is {self.max_tokens}, but it must be at least 1")
        if not 0 < self.timeout < math.inf:
            raise UserError(f"the timeout is {self.timeout:g} seconds, but it must be above 0")
        if self.base_url is not None:
            _check_url(self.base_url)

    def seed_of(self, number: int) -> int | None:
        """The seed for reply number `number`, counted from 0."""
        return None if self.seed is None else self.seed + number


def _check_url(url: str) -> None:
    # Nothing of it is quoted: where it is mistyped, nobody knows which part of it is a password.
    if any(mark in url for mark in "@?#"):
        raise UserError(f"the base URL has a user name, a password, a query or a fragment; {NOT_IN_URL}")
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError:
        raise UserError(f"the base URL has no valid host and port; {A_URL}") from None
    if parts.scheme not in {"http", "https"} or not parts.hostname:
        raise UserError(f"the base URL does not begin with http:// or https:// and a host; {A_URL}")


@dataclass(frozen=True)
class Usage:
    """How many tokens a request took; None where the model does not say."""

    input_tokens: int | None = None
    output_tokens: int | None = None

    @property
    def total(self) -> int:
        """All tokens that are known of."""
        return (self.input_tokens or 0) + (self.output_tokens or 0)


@dataclass(frozen=True)
class Reply:
    """What a model answered.

    Args:
        text: all it said.
        program: the program it means; any text, which need not even parse.
        usage: how many tokens it took.
        latency_s: how many seconds passed from the request to the end of the reply.
        finish_reason: why it ended, such as `stop` or `length`; None where the model does not say.
    """

    text: str = field(repr=False)
    program: str = field(repr=False)
    usage: Usage
    latency_s: float
    finish_reason: str | None


async def program_in(text: str) -> str:
    """The program that a text means; a huge text takes seconds, in which other replies go on coming in."""
    if len(text) < HUGE:
        return program_of(text).source
    return (await asyncio.to_thread(program_of, text)).source


def unheard(_piece: str) -> None:
    """Listen to nothing."""


class Model(Protocol):
    """Anything that writes programs when it is asked to.

    It may be asked for several replies at the same time, all from one event loop; a request that is cancelled
    is given up.
    """

    @property
    def name(self) -> str:
        """What it is called on a command line and in a run."""

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Ask for one reply.

        Args:
            prompt: what is asked.
            number: which sample of this prompt it is, counted from 0.
            heard: told each piece of the text when it comes in. Where a reply is asked for again after an
                error, the pieces come again as well.

        Raises:
            ModelError: no whole reply came.
        """

    async def close(self) -> None:
        """Give back what it holds; no request may be under way."""


class ModelError(Exception):
    """A model did not reply.

    A reply without a program in it is none of these: that is the model's fault, and counts against it.

    Args:
        sentence: what went wrong, and where it helps, the mend; it quotes no keys.
        may_pass: whether the same request may succeed later.
        retry_after: how many seconds the other side wants to be left in peace; None where it does not say.
    """

    def __init__(self, sentence: str, *, may_pass: bool, retry_after: float | None = None) -> None:
        super().__init__(sentence)
        self.sentence, self.may_pass, self.retry_after = sentence, may_pass, retry_after

    def __reduce__(self) -> tuple[object, ...]:
        made = partial(type(self), may_pass=self.may_pass, retry_after=self.retry_after)
        return made, (self.sentence,), vars(self)


class BudgetSpentError(Exception):
    """No further request may be made, because as many tokens are used as were allowed.

    Args:
        budget: how many were allowed.
        used: how many are used.
    """

    def __init__(self, budget: int, used: int) -> None:
        self.budget, self.used = budget, used
        self.sentence = f"the token budget of {budget:,} is spent: {used:,} tokens are used"
        super().__init__(self.sentence)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.budget, self.used), vars(self)
