"""Base models behind an endpoint of text completions, which vLLM, TGI and llama.cpp speak as well."""

from __future__ import annotations

import asyncio
import json
import time

import openai
from openai.types import Completion

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, SamplingSettings, Usage, program_in, unheard
from codebotler.models.keys import key_in
from codebotler.models.redaction import guard_logs, without_keys
from codebotler.models.reply_limit import bound, limit_of
from codebotler.models.server_errors import (
    broken_off,
    fault,
    late,
    refused,
    retry_after,
    told_before,
    unreachable,
)
from codebotler.prompts import Prompt

KEY = "OPENAI_API_KEY"
NO_KEY = "none"  # servers of one's own ask for no key, but the client wants one
NO_MONEY = "insufficient_quota"  # a 429 that no waiting mends


class Completions:
    """A model that goes on from a text.

    Args:
        model: what the server calls it.
        settings: how it is to be asked.

    Raises:
        UserError: neither a URL nor a key is given, or the key cannot be sent.
    """

    def __init__(self, model: str, settings: SamplingSettings) -> None:
        key = key_in(KEY)
        if settings.base_url is None and not key:
            raise UserError(
                f"completions:{model} needs --base-url, or {KEY} in the environment for OpenAI's own"
            )
        self.model, self.settings = model, settings
        self.client = openai.AsyncOpenAI(
            api_key=key or NO_KEY,
            base_url=settings.base_url,
            timeout=settings.timeout,
            max_retries=0,
            http_client=bound(openai.DefaultAsyncHttpxClient(), self.name, limit_of(settings.max_tokens)),
        )
        guard_logs()

    @property
    def name(self) -> str:
        """Such as `completions:codellama/CodeLlama-34b-Python-hf`."""
        return f"completions:{self.model}"

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Ask for one reply.

        Raises:
            ModelError: no whole reply came.
        """
        start = time.monotonic()
        try:
            async with asyncio.timeout(self.settings.timeout):
                text, finish_reason, usage = await self._ask(prompt, number, heard)
        except TimeoutError:
            raise late(self.name, self.settings.timeout) from None
        except openai.OpenAIError as error:
            raise (told_before(error) or self._told(error)) from None
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise fault(self.name, f"the server sent no valid JSON ({error})", may_pass=True) from None
        if finish_reason is None:
            raise broken_off(self.name, begun=bool(text))
        text = without_keys(text)
        program = await program_in(prompt.program_from(text))
        return Reply(text, program, usage, time.monotonic() - start, finish_reason)

    async def close(self) -> None:
        """Close the connections."""
        await self.client.close()

    async def _ask(self, prompt: Prompt, number: int, heard: Heard) -> tuple[str, str | None, Usage]:
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
                usage = _usage(chunk) or usage
                for choice in chunk.choices:
                    if choice.finish_reason:  # null until the last piece
                        finish_reason = choice.finish_reason
                    if choice.text:
                        pieces.append(choice.text)
                        heard(choice.text)
        return "".join(pieces), finish_reason, usage

    def _told(self, error: openai.OpenAIError) -> ModelError:
        if isinstance(error, openai.APITimeoutError):
            return late(self.name, self.settings.timeout)
        if isinstance(error, openai.APIStatusError):
            return refused(
                self.name,
                error.status_code,
                error.body or error.response.text,
                retry_after=retry_after(error.response.headers),
                hopeless=error.code == NO_MONEY,
            )
        nobody = unreachable(self.name, error, self.settings.base_url)
        return nobody or fault(self.name, error, may_pass=True)  # what is told within a stream has no status


def _usage(chunk: Completion) -> Usage | None:
    told = chunk.usage
    return None if told is None else Usage(told.prompt_tokens, told.completion_tokens)
