"""Base models behind a text-completion endpoint, such as vLLM, TGI and llama.cpp."""

from __future__ import annotations

import asyncio
import json
import time

import httpx2
import openai
from pydantic_ai.exceptions import ModelHTTPError

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError, Reply, TextListener, Usage, ignore_text, make_reply
from codebotler.models.keys import guard_logs, read_key, remove_keys
from codebotler.models.sampling import SamplingSettings
from codebotler.models.servers.http_client import (
    byte_limit,
    limit_replies,
    mention_proxy,
    opening_error,
    without_proxy,
)
from codebotler.models.servers.openai_stream import Chunks, make_lenient
from codebotler.models.servers.server_errors import (
    connection_error,
    error_in_reply,
    find_model_error,
    incomplete_error,
    is_filtered,
    model_error,
    status_error,
    timeout_error,
)
from codebotler.prompts import Prompt

OPENAI_KEY = "OPENAI_API_KEY"
PLACEHOLDER_KEY = "none"  # the client requires a key even if the server does not
QUOTA_ERROR = "insufficient_quota"  # a status of 429 for which waiting does not help


class CompletionsModel:
    """A base model on a server, which continues the text of a prompt."""

    def __init__(
        self, model: str, settings: SamplingSettings, http_client: httpx2.AsyncClient | None = None
    ) -> None:
        self.name = f"completions:{model}"
        key = read_key(OPENAI_KEY)
        if settings.base_url is None and not key:
            raise UserError(f"{self.name} needs --base-url, or {OPENAI_KEY} for OpenAI's server")
        self.model, self.settings = model, settings.for_base_model(self.name)
        try:
            with without_proxy(settings.base_url):
                client = http_client or openai.DefaultAsyncHttpxClient()
        except Exception as error:  # noqa: BLE001 - wrong proxies and certificates cause many kinds of errors
            raise opening_error(self.name, error) from None
        self.client = make_lenient(
            openai.AsyncOpenAI(
                api_key=key or PLACEHOLDER_KEY,
                base_url=settings.base_url,
                timeout=settings.timeout,
                max_retries=0,
                http_client=limit_replies(client, self.name, byte_limit(self.settings.max_tokens)),
            )
        )
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        """Request reply `number` to a prompt, from 0. Raise ModelError if no complete reply arrives."""
        start = time.monotonic()
        try:
            async with asyncio.timeout(self.settings.timeout):
                text, chunks = await self._request(prompt, number, on_text)
        except TimeoutError:
            raise timeout_error(self.name, self.settings.timeout) from None
        except openai.OpenAIError as error:
            failed = find_model_error(error) or mention_proxy(self._convert(error), self.settings.base_url)
            if not isinstance(error, openai.APIStatusError) or not is_filtered(error.status_code, error.body):
                raise failed from None
            text, latency = failed.sentence, time.monotonic() - start
            return make_reply(text, Usage(), latency, None, known_kind="filtered", has_answer=False)
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            fault = f"the server sent invalid JSON ({error})"
            raise model_error(self.name, fault, is_temporary=True) from None
        if chunks.error is not None:
            raise error_in_reply(self.name, chunks.error)
        if not chunks.is_whole:
            raise incomplete_error(self.name, has_begun=bool(text))
        sent = chunks.usage
        usage = Usage() if sent is None else Usage(sent.prompt_tokens, sent.completion_tokens)
        text, latency = remove_keys(text), time.monotonic() - start
        return make_reply(text, usage, latency, chunks.finish_reason, opening=prompt)

    async def close(self) -> None:
        """Close the connections."""
        await self.client.close()

    async def _request(self, prompt: Prompt, number: int, on_text: TextListener) -> tuple[str, Chunks]:
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
                        on_text(choice.text)
        return "".join(pieces), chunks

    def _convert(self, error: openai.OpenAIError) -> ModelError:
        if isinstance(error, openai.APITimeoutError):
            return timeout_error(self.name, self.settings.timeout)
        if isinstance(error, openai.APIStatusError):
            status, body = error.status_code, error.body or error.response.text
            wait = ModelHTTPError(0, self.name, headers=error.response.headers).retry_after
            is_quota = error.code == QUOTA_ERROR
            return status_error(self.name, status, body, retry_after=wait, is_permanent=is_quota)
        if isinstance(error, openai.APIError) and error.body is not None:
            return error_in_reply(self.name, error.body)
        no_connection = connection_error(self.name, error, self.settings.base_url)
        return no_connection or model_error(self.name, error, is_temporary=True)
