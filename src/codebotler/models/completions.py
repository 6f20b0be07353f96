"""Base models behind a text-completion endpoint, as served by vLLM, TGI and llama.cpp."""

from __future__ import annotations

import asyncio
import json
import time

import httpx2
import openai
from pydantic_ai.exceptions import ModelHTTPError

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, Usage, reply_from, unheard
from codebotler.models.http_client import bound, cannot_open, limit_of, with_proxy, without_proxy
from codebotler.models.keys import guard_logs, key_in, without_keys
from codebotler.models.openai_stream import Chunks, make_lenient
from codebotler.models.sampling import SamplingSettings
from codebotler.models.server_errors import (
    broken_off,
    error_in_reply,
    failure,
    is_filtered,
    model_error_in,
    refused,
    timed_out,
    unreachable,
)
from codebotler.prompts import Prompt

KEY = "OPENAI_API_KEY"
NO_KEY = "none"  # for servers that want none, since the client does
NO_MONEY = "insufficient_quota"  # a 429 that no waiting mends


class CompletionsModel:
    """A base model on a server, which continues a text."""

    def __init__(
        self, model: str, settings: SamplingSettings, http_client: httpx2.AsyncClient | None = None
    ) -> None:
        self.name = f"completions:{model}"
        key = key_in(KEY)
        if settings.base_url is None and not key:
            raise UserError(f"{self.name} needs --base-url, or {KEY} in the environment for OpenAI's own")
        self.model, self.settings = model, settings.for_base_model(self.name)
        try:
            with without_proxy(settings.base_url):
                client = http_client or openai.DefaultAsyncHttpxClient()
        except Exception as error:  # noqa: BLE001 - of wrong proxies and certificates
            raise cannot_open(self.name, error) from None
        self.client = make_lenient(
            openai.AsyncOpenAI(
                api_key=key or NO_KEY,
                base_url=settings.base_url,
                timeout=settings.timeout,
                max_retries=0,
                http_client=bound(client, self.name, limit_of(self.settings.max_tokens)),
            )
        )
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply."""
        start = time.monotonic()
        try:
            async with asyncio.timeout(self.settings.timeout):
                text, chunks = await self._continuation(prompt, number, heard)
        except TimeoutError:
            raise timed_out(self.name, self.settings.timeout) from None
        except openai.OpenAIError as error:
            failed = model_error_in(error) or with_proxy(self._error(error), self.settings.base_url)
            if not isinstance(error, openai.APIStatusError) or not is_filtered(error.status_code, error.body):
                raise failed from None
            latency = time.monotonic() - start
            return reply_from(failed.sentence, Usage(), latency, None, said="filtered", has_answer=False)
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise failure(self.name, f"the server sent invalid JSON ({error})", may_pass=True) from None
        if chunks.error is not None:
            raise error_in_reply(self.name, chunks.error)
        if not chunks.is_whole:
            raise broken_off(self.name, begun=bool(text))
        usage = (
            Usage()
            if chunks.usage is None
            else Usage(chunks.usage.prompt_tokens, chunks.usage.completion_tokens)
        )
        text, latency = without_keys(text), time.monotonic() - start
        return reply_from(text, usage, latency, chunks.finish_reason, opening=prompt)

    async def close(self) -> None:
        """Close the connections."""
        await self.client.close()

    async def _continuation(self, prompt: Prompt, number: int, heard: Heard) -> tuple[str, Chunks]:
        settings = self.settings
        seed = settings.seed_of(number)
        pieces: list[str] = []
        stream = await self.client.completions.create(
            model=self.model,
            prompt=prompt.text,
            max_tokens=settings.max_tokens,
            temperature=openai.omit if settings.temperature is None else settings.temperature,
            top_p=openai.omit if settings.top_p is None else settings.top_p,
            seed=openai.omit if seed is None else seed,
            stop=list(prompt.stop),
            stream=True,
            stream_options={"include_usage": True},
            extra_body=None if settings.extra_body is None else dict(settings.extra_body),
        )
        async with stream:
            async for chunk in (chunks := Chunks(stream)):
                for choice in chunk.choices or ():
                    if choice.text:
                        pieces.append(choice.text)
                        heard(choice.text)
        return "".join(pieces), chunks

    def _error(self, error: openai.OpenAIError) -> ModelError:
        if isinstance(error, openai.APITimeoutError):
            return timed_out(self.name, self.settings.timeout)
        if isinstance(error, openai.APIStatusError):
            return refused(
                self.name,
                error.status_code,
                error.body or error.response.text,
                retry_after=ModelHTTPError(0, self.name, headers=error.response.headers).retry_after,
                hopeless=error.code == NO_MONEY,
            )
        if isinstance(error, openai.APIError) and error.body is not None:
            return error_in_reply(self.name, error.body)
        nobody = unreachable(self.name, error, self.settings.base_url)
        return nobody or failure(self.name, error, may_pass=True)
