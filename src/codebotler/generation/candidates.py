"""Ask a model for several programs for the same prompt."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from codebotler.generation.generate import Attempt, ignore_attempt, make_attempt
from codebotler.models.base import Model
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import Prompt

CONCURRENT_REQUESTS = 4


async def gather_candidates(
    model: Model, prompt: Prompt, count: int, on_attempt: Callable[[Attempt], None] = ignore_attempt
) -> list[Attempt]:
    """Ask a model `count` times for a program, check none of them, and close the model.

    Raises:
        ModelError: the model sent no complete reply to one of the requests.
    """
    limited = RateLimited(model, concurrency=CONCURRENT_REQUESTS)
    try:
        replies = await asyncio.gather(*(limited.reply(prompt, number=number) for number in range(count)))
    finally:
        await model.close()
    attempts = [
        await make_attempt(number, prompt, reply, model.settings) for number, reply in enumerate(replies)
    ]
    for attempt in attempts:
        on_attempt(attempt)
    return attempts
