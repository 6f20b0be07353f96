"""Limits on the rate, the concurrency and the tokens of requests to a model, and retries after errors."""

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
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt

LOG = logging.getLogger("codebotler.models")
LONGEST_WAIT = 30.0  # seconds between two tries, where the server asks for nothing else
LONGEST_RETRY_AFTER = 600.0  # seconds; a request that a server defers for longer has failed
CHARACTERS = 3  # for each token of a text, where the model counts none; a high estimate


@dataclass
class RateLimited:
    """A model with limits.

    Errors that may pass are retried: statuses such as 429 and 500, timeouts, failed and broken connections,
    and answers that are no reply. A whole reply is never requested again, even without a program in it.

    Args:
        model: the model that it asks.
        concurrency: the requests that may be under way at a time, at least 1.
        requests_per_minute: the requests, further tries included, that may begin in a minute, evenly spread;
            None for any number.
        retries: the further tries of each request, at least 0.
        token_budget: no request begins once so many tokens are used; those under way are completed. Where
            the model counts no tokens, one is assumed for every three characters. None for any number.
        first_wait: about the seconds before the second try; they double before each further one.

    Raises:
        UserError: a limit is out of its range.
    """

    model: Model
    concurrency: int = 8
    requests_per_minute: float | None = None
    retries: int = 6
    token_budget: int | None = None
    first_wait: float = 0.5
    requests: int = field(default=0, init=False)
    """The requests so far, further tries included."""
    retried: int = field(default=0, init=False)
    """The further tries so far."""
    usage: Usage = field(default_factory=Usage, init=False)
    """The tokens of all replies, as counted by the model."""
    spent: int = field(default=0, init=False)
    """The tokens that count against the budget, with estimates where the model counts none."""
    _has_replied: bool = field(default=False, init=False, repr=False)
    _free: asyncio.Semaphore = field(init=False, repr=False)
    _gate: asyncio.Lock = field(default_factory=asyncio.Lock, init=False, repr=False)
    _next_start: float = field(default=-math.inf, init=False, repr=False)
    _deferred_until: float = field(default=-math.inf, init=False, repr=False)

    def __post_init__(self) -> None:
        for name, value, least in (
            ("concurrency", self.concurrency, 1),
            ("number of retries", self.retries, 0),
            ("token budget", self.token_budget, 1),
        ):
            if value is not None and value < least:
                raise UserError(f"the {name} is {value}, but it must be at least {least}")
        if self.requests_per_minute is not None and not self.requests_per_minute > 0:
            rate = f"{self.requests_per_minute:g}"
            raise UserError(f"the number of requests per minute is {rate}, but it must be above 0")
        self._free = asyncio.Semaphore(self.concurrency)

    @property
    def name(self) -> str:
        """The name of the model."""
        return self.model.name

    @property
    def settings(self) -> SamplingSettings:
        """The settings that the model sends."""
        return self.model.settings

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply, with further tries.

        Args:
            prompt: the request.
            number: which sample of this prompt it is, counted from 0.
            heard: called with each piece of the text as it arrives, from the beginning again in each try.

        Raises:
            ModelError: the last try brought no whole reply either.
            BudgetSpentError: the budget is spent, and no request was made.
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
                raise ModelError(
                    sentence,
                    may_pass=error.may_pass,
                    retry_after=error.retry_after,
                    is_refusal=error.is_refusal,
                ) from None

    async def close(self) -> None:
        """Close the model."""
        await self.model.close()

    async def _try(self, prompt: Prompt, number: int, heard: Heard) -> Reply:
        self._check_budget()
        await self._turn()
        self._check_budget()  # other requests may have spent it meanwhile
        self.requests += 1
        length = 0

        def hear(piece: str) -> None:
            nonlocal length
            length += len(piece)
            heard(piece)

        try:
            reply = await self.model.reply(prompt, number=number, heard=hear)
        except BaseException:  # the pieces that came are paid for
            if length:
                self.spent += _estimate(prompt, length)
            raise
        self._has_replied = True
        self.usage = Usage(
            _sum(self.usage.input_tokens, reply.usage.input_tokens),
            _sum(self.usage.output_tokens, reply.usage.output_tokens),
            _sum(self.usage.reasoning_tokens, reply.usage.reasoning_tokens),
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
            while (wait := max(self._next_start, self._deferred_until) - now()) > 0:  # noqa: ASYNC110 - both may move
                await asyncio.sleep(wait)
            if self.requests_per_minute is not None:
                self._next_start = now() + 60 / self.requests_per_minute

    def _wait(self, state: RetryCallState) -> float:
        wait = wait_exponential_jitter(self.first_wait, LONGEST_WAIT, jitter=self.first_wait / 2)(state)
        return max(wait, _retry_after(state))

    def _before_sleep(self, state: RetryCallState) -> None:
        self.retried += 1
        if not self._has_replied and self.retried == 1 and state.outcome is not None:
            LOG.warning("trying again, up to %d times: %s", self.retries, state.outcome.exception())
        # A server that asks to wait means all requests, not only the one that it refused.
        now = asyncio.get_running_loop().time()
        self._deferred_until = max(self._deferred_until, now + _retry_after(state))


def _retry_after(state: RetryCallState) -> float:
    error = None if state.outcome is None else state.outcome.exception()
    return (error.retry_after or 0.0) if isinstance(error, ModelError) else 0.0


def _may_pass(error: BaseException) -> bool:
    return (
        isinstance(error, ModelError) and error.may_pass and (error.retry_after or 0) <= LONGEST_RETRY_AFTER
    )


def _sum(one: int | None, other: int | None) -> int | None:
    return one if other is None else (one or 0) + other


def _estimate(prompt: Prompt, length: int) -> int:
    asked = sum(len(message.text) for message in prompt.messages)
    return (asked + length) // CHARACTERS + 1
