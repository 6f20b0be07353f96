"""A model that is asked no faster than allowed, no further than paid for, and again where that may help."""

from __future__ import annotations

import asyncio
import logging
import math
from dataclasses import dataclass, field

from tenacity import (
    AsyncRetrying,
    RetryCallState,
    retry_if_exception,
    stop_after_attempt,
    wait_exponential_jitter,
)

from codebotler.core.errors import UserError
from codebotler.models.base import BudgetSpentError, Heard, Model, ModelError, Reply, Usage, unheard
from codebotler.prompts import Prompt

LOG = logging.getLogger("codebotler.models")
LONGEST_WAIT = 30.0  # seconds between two tries, where the other side asks for nothing else
LONGEST_PEACE = 600.0  # seconds that the other side may ask for; a request that waits longer has failed
CHARACTERS = 3  # of a text, for a token of it, where nobody says how many it has; a high estimate


@dataclass
class RateLimited:
    """Another model, with limits.

    What may pass is tried again: 429, 5xx, timeouts, connections that fail or break off, and answers that
    make no sense. A whole reply is never asked for again, be it empty or without a program.

    Args:
        model: who is asked.
        concurrency: how many requests may be under way at a time, at least 1.
        requests_per_minute: how many may begin in a minute, evenly spread; None for any number. A further try
            counts as a request.
        retries: how many further tries a request gets.
        token_budget: once this many tokens are used, no request begins; those under way then come to their
            end, so that a little more is used. Where the model does not count tokens, one is taken for every
            three characters. None for any number.
        first_wait: about how many seconds pass before the second try; before each further one, twice as many.

    Raises:
        UserError: one of them is out of its range.
    """

    model: Model
    concurrency: int = 8
    requests_per_minute: float | None = None
    retries: int = 6
    token_budget: int | None = None
    first_wait: float = 0.5
    requests: int = field(default=0, init=False)
    """How many requests were begun."""
    retried: int = field(default=0, init=False)
    """How many of them were further tries."""
    usage: Usage = field(default_factory=Usage, init=False)
    """The tokens of all replies, as far as the model counts them."""
    spent: int = field(default=0, init=False)
    """The tokens that count against the budget, with estimates where the model does not count them."""
    _has_heard: bool = field(default=False, init=False, repr=False)
    _free: asyncio.Semaphore = field(init=False, repr=False)
    _gate: asyncio.Lock = field(default_factory=asyncio.Lock, init=False, repr=False)
    _next_start: float = field(default=-math.inf, init=False, repr=False)
    _peace_until: float = field(default=-math.inf, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.concurrency < 1:
            raise UserError(f"the concurrency is {self.concurrency}, but it must be at least 1")
        if self.requests_per_minute is not None and not self.requests_per_minute > 0:
            raise UserError(f"the requests a minute are {self.requests_per_minute:g}, but must be above 0")
        if self.retries < 0:
            raise UserError(f"the retries are {self.retries}, but must be at least 0")
        if self.token_budget is not None and self.token_budget < 1:
            raise UserError(f"the token budget is {self.token_budget}, but it must be at least 1")
        self._free = asyncio.Semaphore(self.concurrency)

    @property
    def name(self) -> str:
        """What the model is called."""
        return self.model.name

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Ask for one reply, as often as needed.

        Args:
            prompt: what is asked.
            number: which sample of this prompt it is, counted from 0.
            heard: told each piece of the text when it comes in, again in each try.

        Raises:
            ModelError: no whole reply came, in the last try either.
            BudgetSpentError: the budget is spent, so that no request was made.
        """
        tries = AsyncRetrying(
            sleep=asyncio.sleep,
            stop=stop_after_attempt(self.retries + 1),
            wait=self._wait,
            retry=retry_if_exception(_may_pass),
            before_sleep=self._before_sleep,
            reraise=True,
        )
        async with self._free:
            try:
                return await tries(self._try, prompt, number, heard)
            except ModelError as error:
                times = tries.statistics["attempt_number"]
                if times == 1:
                    raise
                sentence = f"{error.sentence} (tried {times} times)"
                raise ModelError(sentence, may_pass=error.may_pass, retry_after=error.retry_after) from None

    async def close(self) -> None:
        """Close the model."""
        await self.model.close()

    async def _try(self, prompt: Prompt, number: int, heard: Heard) -> Reply:
        self._check_budget()
        await self._turn()
        self._check_budget()  # others have spent it meanwhile
        self.requests += 1
        length = 0

        def hear(piece: str) -> None:
            nonlocal length
            length += len(piece)
            heard(piece)

        try:
            reply = await self.model.reply(prompt, number=number, heard=hear)
        except BaseException:  # what has come is paid for, whyever no more came
            if length:
                self.spent += _estimate(prompt, length)
            raise
        self._has_heard = True
        self.usage = Usage(
            _sum(self.usage.input_tokens, reply.usage.input_tokens),
            _sum(self.usage.output_tokens, reply.usage.output_tokens),
        )
        self.spent += reply.usage.total or _estimate(prompt, len(reply.text))
        return reply

    def _check_budget(self) -> None:
        if self.token_budget is not None and self.spent >= self.token_budget:
            raise BudgetSpentError(self.token_budget, self.spent)

    async def _turn(self) -> None:
        """Wait until the next request may begin."""
        now = asyncio.get_running_loop().time
        async with self._gate:
            while (wait := max(self._next_start, self._peace_until) - now()) > 0:  # noqa: ASYNC110 - the end may move
                await asyncio.sleep(wait)
            if self.requests_per_minute is not None:
                self._next_start = now() + 60 / self.requests_per_minute

    def _wait(self, state: RetryCallState) -> float:
        wait = wait_exponential_jitter(self.first_wait, LONGEST_WAIT, jitter=self.first_wait / 2)(state)
        return max(wait, _peace(state))

    def _before_sleep(self, state: RetryCallState) -> None:
        self.retried += 1
        if not self._has_heard and self.retried == 1 and state.outcome is not None:
            LOG.warning("trying again, up to %d times: %s", self.retries, state.outcome.exception())
        # Whoever asks for peace means all requests, not only the one that was refused.
        self._peace_until = max(self._peace_until, asyncio.get_running_loop().time() + _peace(state))


def _peace(state: RetryCallState) -> float:
    error = None if state.outcome is None else state.outcome.exception()
    return (error.retry_after or 0.0) if isinstance(error, ModelError) else 0.0


def _may_pass(error: BaseException) -> bool:
    return isinstance(error, ModelError) and error.may_pass and (error.retry_after or 0) <= LONGEST_PEACE


def _sum(one: int | None, other: int | None) -> int | None:
    return one if other is None else (one or 0) + other


def _estimate(prompt: Prompt, length: int) -> int:
    asked = sum(len(message.text) for message in prompt.messages)
    return (asked + length) // CHARACTERS + 1
