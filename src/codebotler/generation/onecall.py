"""A program for an instruction in one call: what `codebotler generate` does, for programs in Python."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor

from codebotler.checking.check import check
from codebotler.core.arguments import expect_text, expect_texts, expect_whole
from codebotler.core.errors import UserError
from codebotler.generation.generate import Generation
from codebotler.generation.generate import generate as ask
from codebotler.models.base import Model, SamplingSettings
from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import prompt_for
from codebotler.simulator.engine import WorkerPool


def generate(
    instruction: str,
    *,
    model: str = "recorded",
    rooms: Sequence[str] | None = None,
    retries: int | None = None,
    repair: bool = False,
    temperature: float | None = 0.2,
    top_p: float | None = 0.95,
    max_tokens: int = 512,
    seed: int | None = None,
    timeout: float = 60.0,
    base_url: str | None = None,
) -> Generation:
    """Have a model write a program, check that in imagined worlds, and wait for the result.

    A program with problems is returned all the same, with them: its last attempt counts.

    Args:
        instruction: what the robot is to do, in plain words.
        model: who is asked, such as `recorded` or `openai-chat:gpt-5.1`.
        rooms: the names of all rooms, for the model and for the check; without them, the rooms are those that
            the program goes to.
        retries: how many times a program with problems is asked for again, at least 0; by default once with
            `repair`, else never.
        repair: whether to ask again with the program and its problems in the request.
        temperature: from 0 (always the likeliest token) up to about 2; None leaves it to the model.
        top_p: the share of likely tokens that are drawn from, above 0 and up to 1; None leaves it to the
            model.
        max_tokens: how long a reply may be, in tokens, at least 1.
        seed: what fixes the random numbers, where a model takes a seed.
        timeout: how many seconds one request may take altogether.
        base_url: where the model is served, such as `http://localhost:8000/v1`.

    Raises:
        UserError: there is no such model, or an argument is out of its range.
        ModelError: no whole reply came.
        EngineError: no isolated process could be started.
    """
    expect_text(instruction, "the instruction")
    expect_texts(rooms or (), "the rooms")
    tries = int(repair) if retries is None else retries
    expect_whole(tries, "the number of retries", least=0)
    if not instruction.strip():
        raise UserError("the instruction is empty; say what the robot is to do")
    settings = SamplingSettings(temperature, top_p, max_tokens, seed, timeout, base_url)
    prompt = prompt_for(instruction, rooms=rooms or ())
    asked = open_model(model, settings)
    with WorkerPool(1) as pool:

        def problems(program: str) -> list[str]:
            return [problem.sentence for problem in check(program, rooms=rooms, pool=pool).problems]

        async def written() -> Generation:
            paced = RateLimited(asked, concurrency=1)
            return await ask(paced, prompt, problems, retries=tries, repair=repair)

        return _result(written, asked)


def _result(work: Callable[[], Coroutine[None, None, Generation]], model: Model) -> Generation:
    async def whole() -> Generation:
        try:
            return await work()
        finally:
            await model.close()

    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(whole())
    with ThreadPoolExecutor(1) as beside:  # in a notebook: a loop is running here already
        return beside.submit(lambda: asyncio.run(whole())).result()
