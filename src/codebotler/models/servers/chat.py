"""Chat models of all providers that pydantic-ai supports."""

from __future__ import annotations

import difflib
import inspect
import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast, get_args
from urllib.parse import urlsplit

import openai
from openai.types import CompletionUsage
from pydantic_ai import exceptions, messages
from pydantic_ai.direct import model_request_stream
from pydantic_ai.models import Model, ModelRequestParameters, infer_model, known_model_names
from pydantic_ai.models.openai import OpenAIChatModel, OpenAIResponsesModel, OpenAIStreamedResponse
from pydantic_ai.providers import Provider, gateway, infer_provider, infer_provider_class
from pydantic_ai.settings import ModelSettings, ThinkingEffort

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError, Reply, TextListener, Usage, ignore_text, make_reply
from codebotler.models.keys import guard_logs, hide_variables, read_key, remove_keys
from codebotler.models.sampling import CHAT_MAX_TOKENS, SamplingSettings
from codebotler.models.servers.chat_messages import definition_of, to_messages, turn_of
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
    error_text,
    find_model_error,
    incomplete_error,
    is_filtered,
    model_error,
    status_error,
    timeout_error,
)
from codebotler.prompts import Prompt
from codebotler.prompts.tools import ToolPrompt

BASE_URL_VARIABLE = "OPENAI_BASE_URL"
OWN_SERVER = "openai-chat"  # the protocol of vLLM, llama.cpp and similar servers
NEW_LIMIT_HOSTS = ("api.openai.com", ".openai.azure.com")
"""Hosts that support `max_completion_tokens`, OpenAI's newer name for the token limit."""
EFFORTS = ("none", *get_args(ThinkingEffort))
NO_TAGS = ("\0", "\0")  # reasoning is extracted from the complete text, since a stream may split its tags
QUOTED_VARIABLE = re.compile(r"`([A-Z][A-Z0-9]*_[A-Z0-9_]+)`")
KEY_VARIABLE = re.compile(r"\b[A-Z][A-Z0-9]*_[A-Z0-9_]*(?:KEY|TOKEN)[A-Z0-9_]*")
PIP_COMMAND = re.compile(r'pip install "?[\w\[\],.-]+"?')
TRANSPORT_PACKAGES = ("httpx", "httpx2", "httpcore", "httpcore2", "anyio", "ssl")


class ChatModel:
    """A chat model, named `provider:model` as in pydantic-ai.

    With a base URL, `openai:` means `openai-chat:`, since few other servers support the Responses API. An
    `http_client` must come from the HTTP library that the provider uses.
    """

    def __init__(self, name: str, settings: SamplingSettings, http_client: object = None) -> None:
        provider, _, model = name.partition(":")
        if provider == "openai" and settings.base_url is not None:
            name = f"{OWN_SERVER}:{model}"
        elif provider == OWN_SERVER and settings.base_url is None and os.environ.get(BASE_URL_VARIABLE):
            settings = replace(settings, base_url=os.environ[BASE_URL_VARIABLE])
        self.name = name
        self._model = _open_model(name, settings, http_client)
        self.settings = supported_settings(self._model, name, settings)
        self._request_settings = _request_settings(self._model, self.settings)
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        """Request reply `number` to a prompt, from 0. Raise ModelError if no complete reply arrives."""
        start = time.monotonic()
        settings = self._request_settings
        if (seed := self.settings.seed_of(number)) is not None:
            settings = ModelSettings(**settings, seed=seed)
        try:
            response, chunks = await self._request(prompt, settings, on_text)
        except ModelError:
            raise
        except Exception as error:  # noqa: BLE001 - each provider's library raises its own errors
            failed = find_model_error(error) or mention_proxy(self._convert(error), self.settings.base_url)
            if not _is_filtered(error):
                raise failed from None
            text, latency = failed.sentence, time.monotonic() - start
            return make_reply(text, Usage(), latency, None, known_kind="filtered", has_answer=False)
        reply = self._reply(response, chunks, time.monotonic() - start)
        return turn_of(reply, response) if isinstance(prompt, ToolPrompt) else reply

    async def close(self) -> None:
        """Close the connections."""
        async with self._model:  # leaving the block closes them
            pass

    async def _request(
        self, prompt: Prompt, settings: ModelSettings, on_text: TextListener
    ) -> tuple[messages.ModelResponse, Chunks | None]:
        tools = [*map(definition_of, prompt.tools)] if isinstance(prompt, ToolPrompt) else []
        async with model_request_stream(
            self._model,
            to_messages(prompt.messages),
            model_settings=settings,
            model_request_parameters=ModelRequestParameters(function_tools=tools),
        ) as stream:
            chunks = None
            if isinstance(stream, OpenAIStreamedResponse):
                chunks = stream._response = Chunks(stream._response)  # type: ignore[assignment]  # noqa: SLF001 - no public way
            was_thought = False
            async for event in stream:
                piece, is_thought = _piece_of(event)
                if piece and is_thought != was_thought:
                    on_text("<think>\n" if is_thought else "\n</think>\n")
                    was_thought = is_thought
                if piece:
                    on_text(piece)
            response = stream.get()
        # A stream that ends early without an error can be noticed only by its missing finish reason, but for
        # chat completions pydantic-ai makes up a reason.
        is_complete = response.finish_reason is not None if chunks is None else chunks.is_whole
        if chunks is not None and chunks.error is not None:
            raise error_in_reply(self.name, chunks.error)
        if not is_complete or response.state != "complete":
            raise incomplete_error(self.name, has_begun=bool(response.parts))
        return response, chunks

    def _reply(self, response: messages.ModelResponse, chunks: Chunks | None, latency_s: float) -> Reply:
        details = response.provider_details or {}
        refusal = details.get("refusal") or ""
        calls = [part for part in response.parts if isinstance(part, messages.ToolCallPart)]
        texts = [response.text or "", str(refusal)]
        texts += [f"[tool call] {call.tool_name}({call.args_as_json_str()})" for call in calls]
        thoughts = [p.content for p in response.parts if isinstance(p, messages.ThinkingPart) and p.content]
        finish_reason = chunks and chunks.finish_reason
        return make_reply(
            remove_keys("\n".join(filter(None, texts))),
            _usage(response) if chunks is None else _usage_in_chunk(chunks.usage),
            latency_s,
            finish_reason or details.get("finish_reason") or (None if chunks else response.finish_reason),
            reasoning=remove_keys("\n".join(thoughts)),
            known_kind="refusal" if refusal else "tool-call" if calls else None,
            has_answer=bool(response.text),
        )

    def _convert(self, error: Exception) -> ModelError:
        is_out_of_money = isinstance(error, exceptions.ModelQuotaExceededError)
        match error:
            case exceptions.ModelTimeoutError() | exceptions.ModelRequestTimeout():
                return timeout_error(self.name, self.settings.timeout)
            case exceptions.ModelHTTPError(status_code=status, body=body, retry_after=wait):
                return status_error(self.name, status, body, retry_after=wait, is_permanent=is_out_of_money)
            case exceptions.ModelAPIError(__cause__=openai.APIError(body=body)) if body is not None:
                return error_in_reply(self.name, body)
            case exceptions.ModelAPIError() | exceptions.ContentFilterError() | exceptions.UserError():
                is_temporary = isinstance(error, exceptions.ModelAPIError) and not is_out_of_money
                no_connection = connection_error(self.name, error, self.settings.base_url)
                return no_connection or model_error(self.name, error, is_temporary=is_temporary)
            case exceptions.UnexpectedModelBehavior():
                return incomplete_error(self.name, has_begun=False)
        library = type(error).__module__.split(".")[0]
        is_temporary = isinstance(error, OSError) or library in TRANSPORT_PACKAGES
        fault = f"{type(error).__name__}: {error_text(error)}"
        return model_error(self.name, fault, is_temporary=is_temporary)


def _piece_of(event: object) -> tuple[str, bool]:
    """Return the text that an event of a stream adds to a reply, and whether it is reasoning."""
    match event:
        case messages.PartStartEvent(part=messages.TextPart() | messages.ThinkingPart() as part):
            return part.content, isinstance(part, messages.ThinkingPart)
        case messages.PartDeltaEvent(delta=messages.TextPartDelta() as delta):
            return delta.content_delta, False
        case messages.PartDeltaEvent(delta=messages.ThinkingPartDelta() as delta):
            return delta.content_delta or "", True
    return "", False


def _is_filtered(error: Exception) -> bool:
    if isinstance(error, exceptions.ModelHTTPError):
        return is_filtered(error.status_code, error.body)
    return isinstance(error, exceptions.ContentFilterError)


def _usage(response: messages.ModelResponse) -> Usage:
    usage = response.usage
    if usage.unmeasured_requests or not (usage.input_tokens or usage.output_tokens):
        return Usage()
    reasoning = usage.details.get("reasoning_tokens", usage.details.get("thoughts_tokens"))
    return Usage(usage.input_tokens, usage.output_tokens, reasoning)


def _usage_in_chunk(usage: CompletionUsage | None) -> Usage:
    if usage is None:
        return Usage()
    details = usage.completion_tokens_details
    reasoning = None if details is None else details.reasoning_tokens
    return Usage(usage.prompt_tokens, usage.completion_tokens, reasoning)


# --- settings


def supported_settings(model: Model, name: str, settings: SamplingSettings) -> SamplingSettings:
    """Return the settings that a model supports, with a token limit if its provider requires a limit.

    Raise UserError for an extra body or a reasoning effort that the model does not support.
    """
    if "seed" in model.unsupported_settings:
        settings = replace(settings, seed=None)
    if settings.extra_body is not None and "extra_body" in model.unsupported_settings:
        raise UserError(f"{name} does not support an extra body; remove it")
    if isinstance(model, OpenAIChatModel | OpenAIResponsesModel):
        return _supported_by_openai(model.profile, settings)
    if settings.reasoning_effort is not None and not model.profile.get("supports_thinking"):
        raise UserError(f"{name} does not support a reasoning effort; remove it")
    if settings.reasoning_effort not in {None, *EFFORTS}:
        known = ", ".join(EFFORTS)
        raise UserError(f'unknown reasoning effort "{settings.reasoning_effort}"; {name} supports {known}')
    return _supported_by_anthropic(model.profile, settings) if model.system == "anthropic" else settings


def _supported_by_anthropic(profile: Mapping[str, Any], settings: SamplingSettings) -> SamplingSettings:
    thinks = settings.reasoning_effort not in {None, "none"}
    if thinks or profile.get("anthropic_disallows_sampling_settings"):
        settings = replace(settings, temperature=None, top_p=None)
    elif settings.temperature is not None:  # newer models reject requests with both settings
        settings = replace(settings, top_p=None)
    # Reasoning has its own budget, which must be smaller than the limit.
    limit = 2 * CHAT_MAX_TOKENS if thinks else CHAT_MAX_TOKENS
    return replace(settings, max_tokens=settings.max_tokens or limit)


def _supported_by_openai(profile: Mapping[str, Any], settings: SamplingSettings) -> SamplingSettings:
    unsupported = profile.get("openai_unsupported_model_settings", ())
    is_reasoning = _is_reasoning(profile, settings.reasoning_effort)
    if is_reasoning or "temperature" in unsupported:
        settings = replace(settings, temperature=None)
    if is_reasoning or "top_p" in unsupported:
        settings = replace(settings, top_p=None)
    return settings


def _is_reasoning(profile: Mapping[str, Any], effort: str | None) -> bool:
    """Whether an OpenAI model reasons at this effort, and therefore rejects sampling settings."""
    if not profile.get("openai_supports_reasoning"):
        return False
    efforts = profile.get("openai_reasoning_efforts")
    supports_none = profile.get("openai_supports_reasoning_effort_none")
    can_be_off = supports_none if efforts is None else "none" in efforts
    if effort is None:
        return not can_be_off or bool(profile.get("thinking_enabled_by_default"))
    return not (can_be_off and effort == "none")


def _request_settings(model: Model, settings: SamplingSettings) -> ModelSettings:
    """Convert settings for pydantic-ai, leaving out settings that are None."""
    is_openai = isinstance(model, OpenAIChatModel | OpenAIResponsesModel)
    effort = settings.reasoning_effort
    is_off = effort == "none" and not is_openai
    given: dict[str, Any] = {
        "max_tokens": settings.max_tokens,
        "temperature": settings.temperature,
        "top_p": settings.top_p,
        "openai_reasoning_effort" if is_openai else "thinking": False if is_off else effort,
        "extra_body": None if settings.extra_body is None else dict(settings.extra_body),
        "max_retries": 0,
        "timeout": settings.timeout,
        "request_timeout": settings.timeout,
    }
    unsupported = {"timeout", "max_retries"} & model.unsupported_settings  # pydantic-ai warns about them
    sent = {key: value for key, value in given.items() if value is not None and key not in unsupported}
    return cast("ModelSettings", sent)


# --- opening


def _open_model(name: str, settings: SamplingSettings, http_client: object) -> Model:
    provider = name.partition(":")[0]
    try:
        blank = [variable for variable in _key_variables(provider) if read_key(variable) is None]
        with hide_variables(blank):  # since libraries only test whether a variable exists
            with without_proxy(settings.base_url):
                model = infer_model(
                    name,
                    lambda wanted: _limit_provider(
                        _open_provider(wanted, settings.base_url, http_client), name, settings
                    ),
                )
            model.profile["thinking_tags"] = NO_TAGS
            if isinstance(model, OpenAIChatModel) and provider in {"openai", OWN_SERVER, "ollama"}:
                # Local servers support `max_tokens`, but many ignore OpenAI's newer name for it.
                host = urlsplit(model.base_url).hostname or ""
                can_reason = bool(model.profile.get("openai_supports_reasoning"))
                is_new = host.endswith(NEW_LIMIT_HOSTS) or can_reason
                model.profile["openai_chat_supports_max_completion_tokens"] = is_new
            return model
    except UserError:
        raise
    except ImportError as error:
        command = PIP_COMMAND.search(str(error))
        fix = f"install it with: {command[0]}" if command else error_text(error)
        raise UserError(f"{name} needs a library that is not installed; {fix}") from None
    except Exception as error:  # noqa: BLE001 - each provider's library raises its own errors
        missing = QUOTED_VARIABLE.search(str(error))
        if missing is None:
            raise opening_error(name, error) from None
        raise UserError(f"{name} needs an API key; set the environment variable {missing[1]}") from None


def _key_variables(provider: str) -> list[str]:
    """Find the environment variables for a provider's key, which are named only in its source code."""
    try:
        found = infer_provider_class(provider)
    except ValueError:
        raise UserError(_unknown_provider(provider)) from None
    source = inspect.getsource(gateway if provider.startswith("gateway/") else found)
    return sorted(set(KEY_VARIABLE.findall(source)))


def _unknown_provider(provider: str) -> str:
    known = sorted({known.partition(":")[0] for known in known_model_names() if ":" in known})
    close = difflib.get_close_matches(provider, known, n=1)
    fix = f'did you mean "{close[0]}"?' if close else "use one such as openai-chat, anthropic or google"
    return f'unknown provider "{provider}"; {fix}'


def _open_provider(name: str, base_url: str | None, http_client: object) -> Provider[object]:
    if base_url is None:
        return infer_provider(name)
    make: Callable[..., Provider[object]] = infer_provider_class(name)
    if name.startswith("gateway/") or "base_url" not in inspect.signature(make).parameters:
        fix = f"for your own server, use {OWN_SERVER}:MODEL"
        raise UserError(f'the provider "{name}" does not support a base URL; {fix}')
    client = {} if http_client is None else {"http_client": http_client}
    return make(base_url=base_url, **client)


def _limit_provider(provider: Provider[object], name: str, settings: SamplingSettings) -> Provider[object]:
    """Limit the size of replies to a provider's HTTP client, and to clients that replace it."""
    if isinstance(client := provider.client, openai.AsyncOpenAI):
        make_lenient(client)
    first, make = provider._own_http_client, provider._http_client_factory  # noqa: SLF001 - no public way
    if first is None or make is None:  # the provider uses no HTTP client that we can reach
        return provider
    limit = byte_limit(settings.max_tokens)

    def make_limited() -> Any:  # noqa: ANN401 - a client of httpx or httpx2, which share no type
        with without_proxy(settings.base_url):
            return limit_replies(make(), name, limit)

    limit_replies(first, name, limit)
    provider._http_client_factory = make_limited  # noqa: SLF001 - no public way
    return provider
