"""Chat models of every provider that pydantic-ai knows."""

from __future__ import annotations

import difflib
import inspect
import re
import time
from collections.abc import Callable

from pydantic_ai import exceptions, messages
from pydantic_ai.direct import model_request_stream
from pydantic_ai.models import Model, infer_model, known_model_names
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers import Provider, gateway, infer_provider, infer_provider_class
from pydantic_ai.settings import ModelSettings

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, SamplingSettings, Usage, unheard
from codebotler.models.keys import blank_is_unset, guard_logs, key_in, without_keys
from codebotler.models.reply_limit import bound, limit_of
from codebotler.models.server_errors import (
    broken_off,
    failure,
    model_error_in,
    refused,
    timed_out,
    told,
    unreachable,
)
from codebotler.prompts import Message, PictureMessage, Prompt
from codebotler.prompts.extract import program_of

OWN_SERVER = "openai-chat"  # the protocol of vLLM, llama.cpp and the like
VARIABLE = re.compile(r"`([A-Z][A-Z0-9]*_[A-Z0-9_]+)`")
KEY_VARIABLE = re.compile(r"\b[A-Z][A-Z0-9]*_[A-Z0-9_]*(?:KEY|TOKEN)[A-Z0-9_]*")
INSTALL = re.compile(r'pip install "?[\w\[\],.-]+"?')
TRANSPORTS = ("httpx", "httpx2", "httpcore", "httpcore2", "anyio", "ssl")


class ChatModel:
    """A chat model, named `provider:model` as in pydantic-ai.

    With a base URL `openai:` means `openai-chat:`, for hardly any other server has the Responses API.
    """

    def __init__(self, name: str, settings: SamplingSettings) -> None:
        provider, _, model = name.partition(":")
        if provider == "openai" and settings.base_url is not None:
            name = f"{OWN_SERVER}:{model}"
        self.name, self.settings = name, settings
        self._model = _model(name, settings)
        asked = ModelSettings(
            max_tokens=settings.max_tokens,
            timeout=settings.timeout,
            max_retries=0,
            request_timeout=settings.timeout,
        )
        if settings.temperature is not None:
            asked["temperature"] = settings.temperature
        if settings.top_p is not None:
            asked["top_p"] = settings.top_p
        for guarantee in ("timeout", "max_retries"):  # pydantic-ai warns of what it cannot keep
            if guarantee in self._model.unsupported_settings:
                del asked[guarantee]
        self._asked = asked
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply."""
        start = time.monotonic()
        asked = self._asked
        if (seed := self.settings.seed_of(number)) is not None:
            asked = ModelSettings(**asked, seed=seed)
        try:
            response = await self._response(messages_of(prompt.messages), asked, heard)
        except ModelError:
            raise
        except Exception as error:  # noqa: BLE001 - each provider's library has errors of its own
            raise (model_error_in(error) or self._error(error)) from None
        text = without_keys(response.text or "")
        latency = time.monotonic() - start
        return Reply(text, program_of(text).source, _usage(response), latency, response.finish_reason)

    async def close(self) -> None:
        """Close the connections."""
        async with self._model:  # leaving it closes them
            pass

    async def _response(
        self, asked: list[messages.ModelMessage], settings: ModelSettings, heard: Heard
    ) -> messages.ModelResponse:
        async with model_request_stream(self._model, asked, model_settings=settings) as stream:
            async for event in stream:
                match event:
                    case messages.PartStartEvent(part=messages.TextPart(content=piece)) if piece:
                        heard(piece)
                    case messages.PartDeltaEvent(delta=messages.TextPartDelta(content_delta=piece)) if piece:
                        heard(piece)
            response = stream.get()
        # A stream that ends too early, but in good order, differs from a whole one only by what it lacks; for
        # chat completions pydantic-ai makes up a reason for the end.
        details = response.provider_details or {}
        is_made_up = isinstance(self._model, OpenAIChatModel) and "finish_reason" not in details
        if is_made_up or response.finish_reason is None or response.state != "complete":
            raise broken_off(self.name, begun=bool(response.parts))
        return response

    def _error(self, error: Exception) -> ModelError:
        is_hopeless = isinstance(
            error, exceptions.ModelRequestRejectedError | exceptions.ModelQuotaExceededError
        )
        match error:
            case exceptions.ModelTimeoutError() | exceptions.ModelRequestTimeout():
                return timed_out(self.name, self.settings.timeout)
            case exceptions.ModelHTTPError(status_code=status, body=body, retry_after=wait):
                return refused(self.name, status, body, retry_after=wait, hopeless=is_hopeless)
            case exceptions.ModelAPIError():
                nobody = unreachable(self.name, error, self.settings.base_url)
                return nobody or failure(self.name, error, may_pass=not is_hopeless)
            case exceptions.ContentFilterError() | exceptions.UserError():
                return failure(self.name, error, may_pass=False)
            case exceptions.UnexpectedModelBehavior():
                return broken_off(self.name, begun=False)
        is_transport = isinstance(error, OSError) or type(error).__module__.split(".")[0] in TRANSPORTS
        return failure(self.name, f"{type(error).__name__}: {told(error)}", may_pass=is_transport)


def messages_of(conversation: tuple[Message, ...]) -> list[messages.ModelMessage]:
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


def _user_part(message: Message) -> messages.UserPromptPart:
    if not isinstance(message, PictureMessage):
        return messages.UserPromptPart(message.text)
    picture = messages.BinaryContent(message.jpeg, media_type="image/jpeg")
    return messages.UserPromptPart([message.text, picture])


def _usage(response: messages.ModelResponse) -> Usage:
    usage = response.usage
    if usage.unmeasured_requests or not (usage.input_tokens or usage.output_tokens):
        return Usage()
    return Usage(usage.input_tokens, usage.output_tokens)


# --- opening


def _model(name: str, settings: SamplingSettings) -> Model:
    provider = name.partition(":")[0]
    try:
        variables = _key_variables(provider)
        for variable in variables:
            key_in(variable)
        with blank_is_unset(variables):
            return infer_model(
                name, lambda wanted: _bounded(_provider(wanted, settings.base_url), name, settings)
            )
    except UserError:
        raise
    except ImportError as error:
        command = INSTALL.search(str(error))
        mend = f"install it with: {command[0]}" if command else told(error)
        raise UserError(f"{name} needs a library that is not installed; {mend}") from None
    except Exception as error:  # noqa: BLE001 - each provider's library has errors of its own
        missing = VARIABLE.search(str(error))
        if missing is None:
            raise UserError(f"{name} cannot be used: {told(error)}") from None
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


def _provider(name: str, base_url: str | None) -> Provider[object]:
    if base_url is None:
        return infer_provider(name)
    made: Callable[..., Provider[object]] = infer_provider_class(name)
    if name.startswith("gateway/") or "base_url" not in inspect.signature(made).parameters:
        raise UserError(
            f'the provider "{name}" takes no base URL; for a server of your own use {OWN_SERVER}:MODEL'
        )
    return made(base_url=base_url)


def _bounded(provider: Provider[object], name: str, settings: SamplingSettings) -> Provider[object]:
    """The provider, with a limit on the replies that its client takes, and any client that replaces it."""
    first, make = provider._own_http_client, provider._http_client_factory  # noqa: SLF001 - no public way
    if first is None or make is None:  # it uses no client of HTTP, or a library keeps that to itself
        return provider
    limit = limit_of(settings.max_tokens)
    bound(first, name, limit)
    provider._http_client_factory = lambda: bound(make(), name, limit)  # noqa: SLF001 - it has no other way
    return provider
