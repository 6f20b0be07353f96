"""Chat models of every provider that pydantic-ai knows."""

from __future__ import annotations

import difflib
import inspect
import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol, cast, get_args
from urllib.parse import urlsplit

import openai
from openai.types import CompletionUsage
from pydantic_ai import exceptions, messages
from pydantic_ai.direct import model_request_stream
from pydantic_ai.models import Model, infer_model, known_model_names
from pydantic_ai.models.openai import OpenAIChatModel, OpenAIResponsesModel, OpenAIStreamedResponse
from pydantic_ai.providers import Provider, gateway, infer_provider, infer_provider_class
from pydantic_ai.settings import ModelSettings, ThinkingEffort

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, Usage, reply_from, unheard
from codebotler.models.http_client import bound, cannot_open, limit_of, with_proxy, without_proxy
from codebotler.models.keys import blank_is_unset, guard_logs, key_in, without_keys
from codebotler.models.openai_stream import Chunks, make_lenient
from codebotler.models.sampling import DEMANDED_MAX_TOKENS, SamplingSettings
from codebotler.models.server_errors import (
    broken_off,
    error_in_reply,
    error_text,
    failure,
    is_filtered,
    model_error_in,
    refused,
    timed_out,
    unreachable,
)
from codebotler.prompts import PictureMessage, Prompt, PromptMessage

BASE_URL = "OPENAI_BASE_URL"
OWN_SERVER = "openai-chat"  # the protocol of vLLM, llama.cpp and the like
NEW_LIMIT = ("api.openai.com", ".openai.azure.com")
"""Hosts that know OpenAI's newer name for the limit of tokens."""
EFFORTS = ("none", *get_args(ThinkingEffort))
NO_TAGS = ("\0", "\0")  # tags of thoughts are found in the whole text, since a stream may cut them anywhere
VARIABLE = re.compile(r"`([A-Z][A-Z0-9]*_[A-Z0-9_]+)`")
KEY_VARIABLE = re.compile(r"\b[A-Z][A-Z0-9]*_[A-Z0-9_]*(?:KEY|TOKEN)[A-Z0-9_]*")
INSTALL = re.compile(r'pip install "?[\w\[\],.-]+"?')
TRANSPORTS = ("httpx", "httpx2", "httpcore", "httpcore2", "anyio", "ssl")


class ChatModel:
    """A chat model, named `provider:model` as in pydantic-ai.

    With a base URL `openai:` means `openai-chat:`, for hardly any other server has the Responses API.

    Args:
        name: of the model.
        settings: the settings of its requests.
        http_client: the client that sends them, of the library that the provider uses; one of its own by
            default.
    """

    def __init__(self, name: str, settings: SamplingSettings, http_client: object = None) -> None:
        provider, _, model = name.partition(":")
        if provider == "openai" and settings.base_url is not None:
            name = f"{OWN_SERVER}:{model}"
        elif provider == OWN_SERVER and settings.base_url is None and os.environ.get(BASE_URL):
            settings = replace(settings, base_url=os.environ[BASE_URL])
        self.name = name
        self._model = _model(name, settings, http_client)
        self.settings = taken_settings(self._model, name, settings)
        self._asked = _request_settings(self._model, self.settings)
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply."""
        start = time.monotonic()
        asked = self._asked
        if (seed := self.settings.seed_of(number)) is not None:
            asked = ModelSettings(**asked, seed=seed)
        try:
            response, chunks = await self._response(messages_of(prompt.messages), asked, heard)
        except ModelError:
            raise
        except Exception as error:  # noqa: BLE001 - each provider's library has errors of its own
            failed = model_error_in(error) or with_proxy(self._error(error), self.settings.base_url)
            if not _is_filtered(error):
                raise failed from None
            latency = time.monotonic() - start
            return reply_from(failed.sentence, Usage(), latency, None, said="filtered", has_answer=False)
        return self._reply(response, chunks, time.monotonic() - start)

    async def close(self) -> None:
        """Close the connections."""
        async with self._model:  # leaving it closes them
            pass

    async def _response(
        self, asked: list[messages.ModelMessage], settings: ModelSettings, heard: Heard
    ) -> tuple[messages.ModelResponse, Chunks | None]:
        async with model_request_stream(self._model, asked, model_settings=settings) as stream:
            chunks = None
            if isinstance(stream, OpenAIStreamedResponse):
                chunks = stream._response = Chunks(stream._response)  # type: ignore[assignment]  # noqa: SLF001
            hear = _marking_thoughts(heard)
            async for event in stream:
                match event:
                    case messages.PartStartEvent(part=messages.TextPart() as part):
                        hear(part.content, is_thought=False)
                    case messages.PartDeltaEvent(delta=messages.TextPartDelta() as delta):
                        hear(delta.content_delta, is_thought=False)
                    case messages.PartStartEvent(part=messages.ThinkingPart() as part):
                        hear(part.content, is_thought=True)
                    case messages.PartDeltaEvent(delta=messages.ThinkingPartDelta() as delta):
                        hear(delta.content_delta or "", is_thought=True)
            response = stream.get()
        # A stream that ends too early, but in good order, differs from a whole one only by what it lacks; for
        # chat completions pydantic-ai makes up a reason for the end.
        ended = response.finish_reason is not None if chunks is None else chunks.is_whole
        if chunks is not None and chunks.error is not None:
            raise error_in_reply(self.name, chunks.error)
        if not ended or response.state != "complete":
            raise broken_off(self.name, begun=bool(response.parts))
        return response, chunks

    def _reply(self, response: messages.ModelResponse, chunks: Chunks | None, latency_s: float) -> Reply:
        details = response.provider_details or {}
        refusal = details.get("refusal") or ""
        calls = [part for part in response.parts if isinstance(part, messages.ToolCallPart)]
        texts = [response.text or "", str(refusal), *map(_call_in_words, calls)]
        thoughts = [p.content for p in response.parts if isinstance(p, messages.ThinkingPart) and p.content]
        said = chunks and chunks.finish_reason
        return reply_from(
            without_keys("\n".join(filter(None, texts))),
            _usage(response) if chunks is None else _usage_in_chunk(chunks.usage),
            latency_s,
            said or details.get("finish_reason") or (None if chunks else response.finish_reason),
            reasoning=without_keys("\n".join(thoughts)),
            said="refusal" if refusal else "tool-call" if calls else None,
            has_answer=bool(response.text),
        )

    def _error(self, error: Exception) -> ModelError:
        is_out_of_money = isinstance(error, exceptions.ModelQuotaExceededError)
        match error:
            case exceptions.ModelTimeoutError() | exceptions.ModelRequestTimeout():
                return timed_out(self.name, self.settings.timeout)
            case exceptions.ModelHTTPError(status_code=status, body=body, retry_after=wait):
                return refused(self.name, status, body, retry_after=wait, hopeless=is_out_of_money)
            case exceptions.ModelAPIError(__cause__=openai.APIError(body=body)) if body is not None:
                return error_in_reply(self.name, body)
            case exceptions.ModelAPIError() | exceptions.ContentFilterError() | exceptions.UserError():
                may_pass = isinstance(error, exceptions.ModelAPIError) and not is_out_of_money
                nobody = unreachable(self.name, error, self.settings.base_url)
                return nobody or failure(self.name, error, may_pass=may_pass)
            case exceptions.UnexpectedModelBehavior():
                return broken_off(self.name, begun=False)
        is_transport = isinstance(error, OSError) or type(error).__module__.split(".")[0] in TRANSPORTS
        return failure(self.name, f"{type(error).__name__}: {error_text(error)}", may_pass=is_transport)


class _Hear(Protocol):
    def __call__(self, piece: str, *, is_thought: bool) -> None: ...


def _marking_thoughts(heard: Heard) -> _Hear:
    """Pass pieces of a reply on, with marks around thoughts that a server sends apart from the text."""
    was_thought = False

    def hear(piece: str, *, is_thought: bool) -> None:
        nonlocal was_thought
        if not piece:
            return
        if is_thought != was_thought:
            heard("<think>\n" if is_thought else "\n</think>\n")
        was_thought = is_thought
        heard(piece)

    return hear


def messages_of(conversation: tuple[PromptMessage, ...]) -> list[messages.ModelMessage]:
    """A conversation in the types of pydantic-ai."""
    made: list[messages.ModelMessage] = []
    for message in conversation:
        if message.role == "assistant":
            made.append(messages.ModelResponse(parts=[messages.TextPart(message.text)]))
            continue
        is_system = message.role == "system"
        part = messages.SystemPromptPart(message.text) if is_system else _user_part(message)
        if made and isinstance(made[-1], messages.ModelRequest):
            made[-1] = messages.ModelRequest(parts=[*made[-1].parts, part])
        else:
            made.append(messages.ModelRequest(parts=[part]))
    return made


def _user_part(message: PromptMessage) -> messages.UserPromptPart:
    if not isinstance(message, PictureMessage):
        return messages.UserPromptPart(message.text)
    picture = messages.BinaryContent(message.jpeg, media_type="image/jpeg")
    return messages.UserPromptPart([message.text, picture])


def _is_filtered(error: Exception) -> bool:
    if isinstance(error, exceptions.ModelHTTPError):
        return is_filtered(error.status_code, error.body)
    return isinstance(error, exceptions.ContentFilterError)


def _call_in_words(call: messages.ToolCallPart) -> str:
    return f"[tool call] {call.tool_name}({call.args_as_json_str()})"


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


def taken_settings(model: Model, name: str, settings: SamplingSettings) -> SamplingSettings:
    """The settings without what a model does not take, and with the limit that its provider demands."""
    if "seed" in model.unsupported_settings:
        settings = replace(settings, seed=None)
    if settings.extra_body is not None and "extra_body" in model.unsupported_settings:
        raise UserError(f"{name} takes no extra body; leave it out")
    if isinstance(model, OpenAIChatModel | OpenAIResponsesModel):
        return _taken_by_openai(model.profile, settings)
    if settings.reasoning_effort is not None and not model.profile.get("supports_thinking"):
        raise UserError(f"{name} takes no reasoning effort; leave it out")
    if settings.reasoning_effort not in {None, *EFFORTS}:
        effort, known = settings.reasoning_effort, ", ".join(EFFORTS)
        raise UserError(f'{name} knows no reasoning effort "{effort}"; use one of {known}')
    return _taken_by_anthropic(model.profile, settings) if model.system == "anthropic" else settings


def _taken_by_anthropic(profile: Mapping[str, Any], settings: SamplingSettings) -> SamplingSettings:
    thinks = settings.reasoning_effort not in {None, "none"}
    if thinks or profile.get("anthropic_disallows_sampling_settings"):
        settings = replace(settings, temperature=None, top_p=None)
    elif settings.temperature is not None:  # newer models refuse both together
        settings = replace(settings, top_p=None)
    # Thoughts have a budget of their own, which has to be smaller than the limit.
    demanded = 2 * DEMANDED_MAX_TOKENS if thinks else DEMANDED_MAX_TOKENS
    return replace(settings, max_tokens=settings.max_tokens or demanded)


def _taken_by_openai(profile: Mapping[str, Any], settings: SamplingSettings) -> SamplingSettings:
    refused_settings = profile.get("openai_unsupported_model_settings", ())
    reasons = _reasons(profile, settings.reasoning_effort)
    if reasons or "temperature" in refused_settings:
        settings = replace(settings, temperature=None)
    if reasons or "top_p" in refused_settings:
        settings = replace(settings, top_p=None)
    return settings


def _reasons(profile: Mapping[str, Any], effort: str | None) -> bool:
    """Whether a model of OpenAI's reasons when it is asked so; then it refuses sampling settings."""
    if not profile.get("openai_supports_reasoning"):
        return False
    efforts = profile.get("openai_reasoning_efforts")
    can_be_off = (
        profile.get("openai_supports_reasoning_effort_none") if efforts is None else "none" in efforts
    )
    if effort is None:
        return not can_be_off or bool(profile.get("thinking_enabled_by_default"))
    return not (can_be_off and effort == "none")


def _request_settings(model: Model, settings: SamplingSettings) -> ModelSettings:
    """The settings as pydantic-ai takes them; what is None is left out."""
    is_openai = isinstance(model, OpenAIChatModel | OpenAIResponsesModel)
    effort = settings.reasoning_effort
    given: dict[str, Any] = {
        "max_tokens": settings.max_tokens,
        "temperature": settings.temperature,
        "top_p": settings.top_p,
        "openai_reasoning_effort" if is_openai else "thinking": False
        if effort == "none" and not is_openai
        else effort,
        "extra_body": None if settings.extra_body is None else dict(settings.extra_body),
        "max_retries": 0,
        "timeout": settings.timeout,
        "request_timeout": settings.timeout,
    }
    unkept = {"timeout", "max_retries"} & model.unsupported_settings  # pydantic-ai warns of them
    kept = {key: value for key, value in given.items() if value is not None and key not in unkept}
    return cast("ModelSettings", kept)


# --- opening


def _model(name: str, settings: SamplingSettings, http_client: object) -> Model:
    provider = name.partition(":")[0]
    try:
        variables = _key_variables(provider)
        for variable in variables:
            key_in(variable)
        with blank_is_unset(variables):
            with without_proxy(settings.base_url):
                model = infer_model(
                    name,
                    lambda wanted: _bounded(
                        _provider(wanted, settings.base_url, http_client), name, settings
                    ),
                )
            model.profile["thinking_tags"] = NO_TAGS
            if isinstance(model, OpenAIChatModel) and provider in {"openai", OWN_SERVER, "ollama"}:
                # Own servers know `max_tokens`, and many of them ignore OpenAI's newer name for it.
                host = urlsplit(model.base_url).hostname or ""
                is_new = host.endswith(NEW_LIMIT) or bool(model.profile.get("openai_supports_reasoning"))
                model.profile["openai_chat_supports_max_completion_tokens"] = is_new
            return model
    except UserError:
        raise
    except ImportError as error:
        command = INSTALL.search(str(error))
        mend = f"install it with: {command[0]}" if command else error_text(error)
        raise UserError(f"{name} needs a library that is not installed; {mend}") from None
    except Exception as error:  # noqa: BLE001 - each provider's library has errors of its own
        missing = VARIABLE.search(str(error))
        if missing is None:
            raise cannot_open(name, error) from None
        raise UserError(f"{name} needs the key in {missing[1]}; set it in the environment") from None


def _key_variables(provider: str) -> list[str]:
    """The variables that a provider takes its key from, which only its source names."""
    try:
        made = infer_provider_class(provider)
    except ValueError:
        raise UserError(_unknown(provider)) from None
    source = inspect.getsource(gateway if provider.startswith("gateway/") else made)
    return sorted(set(KEY_VARIABLE.findall(source)))


def _unknown(provider: str) -> str:
    known = sorted({known.partition(":")[0] for known in known_model_names() if ":" in known})
    close = difflib.get_close_matches(provider, known, n=1)
    mend = f'did you mean "{close[0]}"?' if close else "use one such as openai-chat, anthropic or google"
    return f'there is no provider "{provider}"; {mend}'


def _provider(name: str, base_url: str | None, http_client: object) -> Provider[object]:
    if base_url is None:
        return infer_provider(name)
    made: Callable[..., Provider[object]] = infer_provider_class(name)
    if name.startswith("gateway/") or "base_url" not in inspect.signature(made).parameters:
        raise UserError(
            f'the provider "{name}" takes no base URL; for a server of your own use {OWN_SERVER}:MODEL'
        )
    return (
        made(base_url=base_url) if http_client is None else made(base_url=base_url, http_client=http_client)
    )


def _bounded(provider: Provider[object], name: str, settings: SamplingSettings) -> Provider[object]:
    """The provider, with a limit on the replies that its client takes, and any client that replaces it."""
    if isinstance(client := provider.client, openai.AsyncOpenAI):
        make_lenient(client)
    first, make = provider._own_http_client, provider._http_client_factory  # noqa: SLF001 - no public way
    if first is None or make is None:  # it uses no client of HTTP, or a library keeps that to itself
        return provider
    limit = limit_of(settings.max_tokens)

    def bounded() -> Any:  # noqa: ANN401 - see bound
        with without_proxy(settings.base_url):
            return bound(make(), name, limit)

    bound(first, name, limit)
    provider._http_client_factory = bounded  # noqa: SLF001 - it has no other way
    return provider
