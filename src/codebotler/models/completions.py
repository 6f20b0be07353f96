"""Base models behind a text-completion endpoint, as served by vLLM, TGI and llama.cpp."""

from __future__ import annotations

import asyncio
import json
import time

import openai
from pydantic_ai.exceptions import ModelHTTPError

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, SamplingSettings, Usage, unheard
from codebotler.models.keys import guard_logs, key_in, without_keys
from codebotler.models.reply_limit import bound, limit_of
from codebotler.models.server_errors import (
    broken_off,
    failure,
    model_error_in,
    refused,
    timed_out,
    unreachable,
)
from codebotler.prompts import Prompt
from codebotler.prompts.extract import program_of

KEY = "OPENAI_API_KEY"
NO_KEY = "none"  # for servers that want none, since the client does
NO_MONEY = "insufficient_quota"  # a 429 that no waiting mends


class CompletionsModel:
    """A base model on a server, which continues a text."""

    def __init__(self, model: str, settings: SamplingSettings) -> None:
        self.name = f"completions:{model}"
        key = key_in(KEY)
        if settings.base_url is None and not key:
            raise UserError(f"{self.name} needs --base-url, or {KEY} in the environment for OpenAI's own")
        self.model, self.settings = model, settings
        self.client = openai.AsyncOpenAI(
            api_key=key or NO_KEY,
            base_url=settings.base_url,
            timeout=settings.timeout,
            max_retries=0,
            http_client=bound(openai.DefaultAsyncHttpxClient(), self.name, limit_of(settings.max_tokens)),
        )
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply."""
        start = time.monotonic()
        try:
            async with asyncio.timeout(self.settings.timeout):
                text, finish_reason, usage = await self._continuation(prompt, number, heard)
        except TimeoutError:
            raise timed_out(self.name, self.settings.timeout) from None
        except openai.OpenAIError as error:
            raise (model_error_in(error) or self._error(error)) from None
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise failure(self.name, f"the server sent invalid JSON ({error})", may_pass=True) from None
        if finish_reason is None:
            raise broken_off(self.name, begun=bool(text))
        text = without_keys(text)
        program = program_of(prompt.program_from(text), continues=True).source
        return Reply(text, program, usage, time.monotonic() - start, finish_reason)

    async def close(self) -> None:
        """Close the connections."""
        await self.client.close()

    async def _continuation(self, prompt: Prompt, number: int, heard: Heard) -> tuple[str, str | None, Usage]:
        settings = self.settings
        seed = settings.seed_of(number)
        pieces: list[str] = []
        finish_reason: str | None = None
        usage = Usage()
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
        )
        async with stream:
            async for chunk in stream:
                if chunk.usage:
                    usage = Usage(chunk.usage.prompt_tokens, chunk.usage.completion_tokens)
                for choice in chunk.choices:
                    if choice.finish_reason:  # null until the last piece
                        finish_reason = choice.finish_reason
                    if choice.text:
                        pieces.append(choice.text)
                        heard(choice.text)
        return "".join(pieces), finish_reason, usage

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
        nobody = unreachable(self.name, error, self.settings.base_url)
        return nobody or failure(self.name, error, may_pass=True)  # an error within a stream has no status
