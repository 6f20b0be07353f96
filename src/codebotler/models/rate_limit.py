"""Limit the rate, concurrency and tokens of requests to a model, and retry after errors."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

from tenacity import (
    AsyncRetrying,
    RetryCallState,
    retry_if_exception,
    stop_after_attempt,
    wait_exponential_jitter,
)

from codebotler.core.errors import UserError
from codebotler.models.base import BudgetSpentError, Model, ModelError, Reply, TextListener, ignore_text
from codebotler.prompts import Prompt

MODELS_LOG = logging.getLogger("codebotler.models")
MAX_WAIT = 30.0  # seconds between two tries, unless the server asks for more
MAX_RETRY_AFTER = 600.0  # seconds; a request that a server delays for longer fails
CHARACTERS_PER_TOKEN = 3  # a high estimate, used if the model does not count tokens


@dataclass
class RateLimited:
    """Wraps a model to limit and repeat its requests.

    It retries temporary errors: statuses such as 429 and 500, timeouts, failed connections and invalid
    answers. It never repeats a complete reply, even one without a program.

    Args:
        model: the model to ask.
        concurrency: how many requests may run at the same time, at least 1.
        requests_per_minute: how many tries may start per minute, evenly spaced, or None for no limit.
        retries: how many times to repeat a failed request, at least 0.
        token_budget: the number of tokens after which no request starts. Running requests complete. If the
            model does not count tokens, three characters are assumed per token. None for no limit.
        first_wait: about how many seconds to wait before the second try. The wait doubles with each try.

    Raises:
        UserError: a limit is out of range.
    """

    model: Model
    concurrency: int = 8
    requests_per_minute: float | None = None
    retries: int = 6
    token_budget: int | None = None
    first_wait: float = 0.5
    requests: int = field(default=0, init=False)  # including retries
    retry_count: int = field(default=0, init=False)
    tokens_used: int = field(default=0, init=False)  # estimated if the model does not count them
    _has_replied: bool = field(default=False, init=False, repr=False)
    _free: asyncio.Semaphore = field(init=False, repr=False)
    _gate: asyncio.Lock = field(default_factory=asyncio.Lock, init=False, repr=False)
    _next_start: float = field(default=-math.inf, init=False, repr=False)
    _deferred_until: float = field(default=-math.inf, init=False, repr=False)

    def __post_init__(self) -> None:
        limits = self.concurrency, self.requests_per_minute, self.token_budget
        if self.retries < 0 or any(limit is not None and not limit > 0 for limit in limits):
            raise UserError("concurrency, request rate and token budget must be above 0; retries at least 0")
        self._free = asyncio.Semaphore(self.concurrency)

    async def reply(
        self,
        prompt: Prompt,
        *,
        number: int,
        on_text: TextListener = ignore_text,
        around: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> Reply:
        """Request reply `number`, with retries. Each try passes its text to `on_text` from the beginning.

        Each try runs inside a context manager from `around`, which can log when the try starts, for example.

        Raises:
            ModelError: the last try failed.
            BudgetSpentError: the budget is used up, so no request was made.
        """
        tries = AsyncRetrying(
            sleep=asyncio.sleep,
            stop=stop_after_attempt(self.retries + 1),
            wait=self._wait,
            retry=retry_if_exception(_is_retryable),
            before_sleep=self._before_sleep,
            reraise=True,
        )
        async with self._free:
            try:
                return await tries(self._try, prompt, number, on_text, around)
            except ModelError as error:
                if (times := tries.statistics["attempt_number"]) > 1:
                    error.sentence += f" (tried {times} times)"
                    error.args = (error.sentence,)
                raise

    async def close(self) -> None:
        """Close the wrapped model."""
        await self.model.close()

    async def _try(
        self,
        prompt: Prompt,
        number: int,
        on_text: TextListener,
        around: Callable[[], AbstractContextManager[None]],
    ) -> Reply:
        self._check_budget()
        await self._wait_for_turn()
        self._check_budget()  # other requests may have used up the budget by now
        self.requests += 1
        length = 0

        def count(piece: str) -> None:
            nonlocal length
            length += len(piece)
            on_text(piece)

        try:
            with around():
                reply = await self.model.reply(prompt, number=number, on_text=count)
        except BaseException:  # the received pieces cost tokens
            if length:
                self.tokens_used += _estimate(prompt, length)
            raise
        self._has_replied = True
        self.tokens_used += reply.usage.total or _estimate(prompt, len(reply.text))
        return reply

    def _check_budget(self) -> None:
        if self.token_budget is not None and self.tokens_used >= self.token_budget:
            raise BudgetSpentError(self.token_budget, self.tokens_used)

    async def _wait_for_turn(self) -> None:
        """Wait until the next request may start."""
        now = asyncio.get_running_loop().time
        async with self._gate:
            while (wait := max(self._next_start, self._deferred_until) - now()) > 0:  # noqa: ASYNC110 - other requests may postpone both times
                await asyncio.sleep(wait)
            if self.requests_per_minute is not None:
                self._next_start = now() + 60 / self.requests_per_minute

    def _wait(self, state: RetryCallState) -> float:
        wait = wait_exponential_jitter(self.first_wait, MAX_WAIT, jitter=self.first_wait / 2)(state)
        return max(wait, _retry_after(state))

    def _before_sleep(self, state: RetryCallState) -> None:
        self.retry_count += 1
        if not self._has_replied and self.retry_count == 1 and state.outcome is not None:
            MODELS_LOG.warning("trying again, up to %d times: %s", self.retries, state.outcome.exception())
        # A delay that a server asks for applies to all requests, not only to the rejected request.
        now = asyncio.get_running_loop().time()
        self._deferred_until = max(self._deferred_until, now + _retry_after(state))


def _retry_after(state: RetryCallState) -> float:
    error = None if state.outcome is None else state.outcome.exception()
    return (error.retry_after or 0.0) if isinstance(error, ModelError) else 0.0


def _is_retryable(error: BaseException) -> bool:
    return (
        isinstance(error, ModelError) and error.is_temporary and (error.retry_after or 0) <= MAX_RETRY_AFTER
    )


def _estimate(prompt: Prompt, length: int) -> int:
    asked = sum(len(message.text) for message in prompt.messages)
    return (asked + length) // CHARACTERS_PER_TOKEN + 1
