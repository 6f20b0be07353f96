"""Measures how much processor time we add to a request, compared with a bare call of the same client.

    python bench/generate.py [REQUESTS]

A server in another process answers both. Each of our requests, which include rate limits and extracting the
program, is paired with a streamed request that the client makes with the same messages and settings. The
order of the two is random. The script prints the median processor time of this process over all requests, in
milliseconds. The target is that we add less than 3 ms.
"""

import asyncio
import os
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import openai
from pydantic_ai.direct import model_request_stream
from pydantic_ai.messages import ModelMessage
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider
from pydantic_ai.settings import ModelSettings

from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.models.sampling import SamplingSettings
from codebotler.models.servers.chat_messages import to_messages
from codebotler.prompts import prompt_for

SERVER = Path(__file__).parents[1] / "tests/codebotler/models/server.py"
INSTRUCTION = "Go to the lobby and tell whoever is there that the bus leaves at five."
AIM = 3.0  # milliseconds
WARM_UP = 20  # requests that are not counted


def bare_chat(url: str) -> Callable[[], Awaitable[object]]:
    """Return a function that makes a request with pydantic-ai alone."""
    model = OpenAIChatModel("m", provider=OpenAIProvider(base_url=url))
    asked = ModelSettings(temperature=0.2, top_p=0.95, max_tokens=512, max_retries=0)
    messages: list[ModelMessage] = to_messages(prompt_for(INSTRUCTION).messages)

    async def ask() -> object:
        async with model_request_stream(model, messages, model_settings=asked) as stream:
            async for _ in stream:
                pass
            return stream.get()

    return ask


def bare_completions(url: str) -> Callable[[], Awaitable[object]]:
    """Return a function that makes a request with the openai library alone."""
    client = openai.AsyncOpenAI(api_key="none", base_url=url, max_retries=0)
    prompt = prompt_for(INSTRUCTION)

    async def ask() -> object:
        stream = await client.completions.create(
            model="m",
            prompt=prompt.text,
            stop=list(prompt.stop),
            temperature=0.2,
            top_p=0.95,
            max_tokens=512,
            stream=True,
            stream_options={"include_usage": True},
        )
        return [chunk async for chunk in stream]

    return ask


def ours(name: str, url: str) -> Callable[[], Awaitable[object]]:
    """Return a function that makes our request, from the instruction to the program."""
    model = RateLimited(open_model(name, SamplingSettings(base_url=url)), token_budget=10**9)
    return lambda: model.reply(prompt_for(INSTRUCTION), number=0, on_text=lambda _piece: None)


async def measure_pairs(count: int, *asks: Callable[[], Awaitable[object]]) -> list[list[float]]:
    """Return the processor time of each request in milliseconds, by client."""
    spent: list[list[float]] = [[] for _ in asks]
    dice = random.Random(0)
    for number in range(WARM_UP + count):
        for way in dice.sample(range(len(asks)), len(asks)):
            start = time.process_time()
            await asks[way]()
            if number >= WARM_UP:
                spent[way].append(1000 * (time.process_time() - start))
    return spent


async def compare(count: int, url: str) -> None:
    """Print the figures for both protocols."""
    for client, name, bare in (
        ("pydantic-ai", "openai-chat:m", bare_chat),
        ("openai", "completions:m", bare_completions),
    ):
        alone, with_us = await measure_pairs(count, bare(url), ours(name, url))
        added = statistics.median(after - before for before, after in zip(alone, with_us, strict=True))
        print(
            f"{client}: {statistics.median(alone):.2f} ms bare, {statistics.median(with_us):.2f} ms with us, "
            f"{added:.2f} ms added ({'less' if added < AIM else 'NOT less'} than {AIM:g})"
        )


def main() -> None:
    """Start the server, measure, and stop the server."""
    os.environ.pop("OPENAI_API_KEY", None)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    with subprocess.Popen(
        [sys.executable, str(SERVER)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        asyncio.run(compare(count, server.stdout.readline().strip()))
        server.stdin.close()


if __name__ == "__main__":
    main()
