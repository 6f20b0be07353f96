"""Chat models of every provider that pydantic-ai knows."""

from __future__ import annotations

import difflib
import inspect
import re
import time
from collections.abc import Callable

from pydantic_ai import exceptions
from pydantic_ai.direct import model_request_stream
from pydantic_ai.messages import (
    BinaryContent,
    ModelMessage,
    ModelRequest,
    ModelResponse,
    PartDeltaEvent,
    PartStartEvent,
    SystemPromptPart,
    TextPart,
    TextPartDelta,
    UserContent,
    UserPromptPart,
)
from pydantic_ai.models import Model as Spoken
from pydantic_ai.models import infer_model, known_model_names
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers import Provider, gateway, infer_provider, infer_provider_class
from pydantic_ai.settings import ModelSettings

from codebotler.core.errors import UserError
from codebotler.models.base import Heard, ModelError, Reply, SamplingSettings, Usage, program_in, unheard
from codebotler.models.keys import blank_is_unset, key_in
from codebotler.models.redaction import guard_logs, without_keys
from codebotler.models.reply_limit import bound, limit_of
from codebotler.models.server_errors import (
    brief,
    broken_off,
    fault,
    late,
    refused,
    retry_after,
    told_before,
    unreachable,
)
from codebotler.prompts import Message, PictureMessage, Prompt

OWN_SERVER = "openai-chat"  # what servers of one's own speak
VARIABLE = re.compile(r"`([A-Z][A-Z0-9]*_[A-Z0-9_]+)`")
KEY_VARIABLE = re.compile(r"\b[A-Z][A-Z0-9]*_[A-Z0-9_]*(?:KEY|TOKEN)[A-Z0-9_]*")
INSTALL = re.compile(r'pip install "?[\w\[\],.-]+"?')
TRANSPORTS = ("httpx", "httpx2", "httpcore", "httpcore2", "anyio", "ssl")


class Chat:
    """A model that one talks to.

    Args:
        name: `provider:model` as pydantic-ai spells it. With a base URL `openai:` is `openai-chat:`, since
            servers of one's own speak chat completions, and hardly any the Responses API.
        settings: how it is to be asked.

    Raises:
        UserError: there is no such provider, its key is not in the environment or cannot be sent, or its
            library is missing.
    """

    def __init__(self, name: str, settings: SamplingSettings) -> None:
        provider, _, model = name.partition(":")
        if provider == "openai" and settings.base_url is not None:
            name = f"{OWN_SERVER}:{model}"
        self.name, self.settings = name, settings
        self.spoken = _spoken(name, settings)
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
        self._unsupported = self.spoken.unsupported_settings
        for guarantee in ("timeout", "max_retries"):  # it warns of what it cannot keep
            if guarantee in self._unsupported:
                del asked[guarantee]
        self._asked = asked
        guard_logs()

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Ask for one reply.

        Raises:
            ModelError: no whole reply came.
        """
        start = time.monotonic()
        asked = self._asked
        if (seed := self.settings.seed_of(number)) is not None:
            asked = ModelSettings(**asked, seed=seed)
        try:
            response = await self._ask(messages_of(prompt.messages), asked, heard)
        except ModelError:
            raise
        except Exception as error:  # noqa: BLE001 - libraries of many providers, each with errors of its own
            raise (told_before(error) or self._told(error)) from None
        text = without_keys(response.text or "")
        program = await program_in(text)
        return Reply(text, program, _usage(response), time.monotonic() - start, response.finish_reason)

    async def close(self) -> None:
        """Close the connections."""
        async with self.spoken:  # what it holds is closed by whoever leaves last
            pass

    async def _ask(self, messages: list[ModelMessage], asked: ModelSettings, heard: Heard) -> ModelResponse:
        async with model_request_stream(self.spoken, messages, model_settings=asked) as stream:
            async for event in stream:
                match event:
                    case PartStartEvent(part=TextPart(content=piece)) if piece:
                        heard(piece)
                    case PartDeltaEvent(delta=TextPartDelta(content_delta=piece)) if piece:
                        heard(piece)
            response = stream.get()
        # A stream that ends early, but in good order, is told from a whole one only by what it lacks; for
        # chat completions pydantic-ai makes up a reason for the end.
        made_up = isinstance(self.spoken, OpenAIChatModel) and "finish_reason" not in (
            response.provider_details or {}
        )
        if made_up or response.finish_reason is None or response.state != "complete":
            raise broken_off(self.name, begun=bool(response.parts))
        return response

    def _told(self, error: Exception) -> ModelError:
        if isinstance(error, exceptions.ModelTimeoutError | exceptions.ModelRequestTimeout):
            return late(self.name, self.settings.timeout)
        if isinstance(error, exceptions.ModelHTTPError):
            peace = retry_after(error.headers or {})
            return refused(
                self.name,
                error.status_code,
                error.body,
                retry_after=error.retry_after if peace is None else peace,
                hopeless=isinstance(error, exceptions.ModelQuotaExceededError),
            )
        if isinstance(error, exceptions.ModelAPIError):
            hopeless = isinstance(
                error, exceptions.ModelRequestRejectedError | exceptions.ModelQuotaExceededError
            )
            nobody = unreachable(self.name, error, self.settings.base_url)
            return nobody or fault(self.name, error, may_pass=not hopeless)
        if isinstance(error, exceptions.ContentFilterError | exceptions.UserError):
            return fault(self.name, error, may_pass=False)
        if isinstance(error, exceptions.UnexpectedModelBehavior):
            return broken_off(self.name, begun=False)
        is_transport = isinstance(error, OSError) or type(error).__module__.split(".")[0] in TRANSPORTS
        return fault(self.name, f"{type(error).__name__}: {brief(error)}", may_pass=is_transport)


def messages_of(messages: tuple[Message, ...]) -> list[ModelMessage]:
    """A conversation as pydantic-ai has it."""
    spoken: list[ModelMessage] = []
    for message in messages:
        if message.role == "assistant":
            spoken.append(ModelResponse(parts=[TextPart(message.text)]))
            continue
        is_system = message.role == "system"
        part = SystemPromptPart(message.text) if is_system else UserPromptPart(_content(message))
        if spoken and isinstance(spoken[-1], ModelRequest):
            spoken[-1] = ModelRequest(parts=[*spoken[-1].parts, part])
        else:
            spoken.append(ModelRequest(parts=[part]))
    return spoken


def _content(message: Message) -> str | list[UserContent]:
    if isinstance(message, PictureMessage):
        return [message.text, BinaryContent(message.jpeg, media_type="image/jpeg")]
    return message.text


def _usage(response: ModelResponse) -> Usage:
    told = response.usage
    if told.unmeasured_requests or not (told.input_tokens or told.output_tokens):
        return Usage()
    return Usage(told.input_tokens, told.output_tokens)


def _spoken(name: str, settings: SamplingSettings) -> Spoken:
    provider = name.partition(":")[0]
    try:
        made = infer_provider_class(provider)
    except ValueError:
        raise UserError(_unknown(provider)) from None
    except ImportError as error:
        raise UserError(_not_installed(name, error)) from None
    variables = _key_variables(provider, made)
    for variable in variables:
        key_in(variable)
    try:
        with blank_is_unset(variables):
            return infer_model(
                name, lambda wanted: _bounded(_provider(wanted, settings.base_url), name, settings)
            )
    except UserError:
        raise
    except ImportError as error:
        raise UserError(_not_installed(name, error)) from None
    except Exception as error:  # noqa: BLE001 - libraries of many providers, each with errors of its own
        raise UserError(_not_set(name, error)) from None


def _key_variables(provider: str, made: type[Provider[object]]) -> list[str]:
    """The variables that a provider takes its key from; nothing but its source tells them all."""
    source = inspect.getsource(gateway if provider.startswith("gateway/") else made)
    return sorted(set(KEY_VARIABLE.findall(source)))


def _provider(name: str, base_url: str | None) -> Provider[object]:
    if base_url is None:
        return infer_provider(name)
    made: Callable[..., Provider[object]] = infer_provider_class(name)
    if name.startswith("gateway/") or "base_url" not in inspect.signature(made).parameters:
        raise UserError(
            f'the provider "{name}" takes no base URL; for a server of your own name {OWN_SERVER}:MODEL'
        )
    return made(base_url=base_url)


def _bounded(provider: Provider[object], name: str, settings: SamplingSettings) -> Provider[object]:
    """A provider whose own client takes no endless reply, and neither does one that takes its place."""
    first, make = provider._own_http_client, provider._http_client_factory  # noqa: SLF001 - nothing else tells
    if first is None or make is None:  # what talks to it is no client of HTTP, or one that a library keeps
        return provider

    limit = limit_of(settings.max_tokens)
    bound(first, name, limit)
    provider._http_client_factory = lambda: bound(make(), name, limit)  # noqa: SLF001
    return provider


def _unknown(provider: str) -> str:
    known = sorted({known.partition(":")[0] for known in known_model_names() if ":" in known})
    close = difflib.get_close_matches(provider, known, n=1)
    known_ones = "name one that pydantic-ai knows, such as openai-chat, anthropic or google"
    return f'there is no provider "{provider}"; ' + (f'is "{close[0]}" meant?' if close else known_ones)


def _not_installed(name: str, error: ImportError) -> str:
    command = INSTALL.search(str(error))
    mend = f"install it with: {command[0]}" if command else brief(error)
    return f"{name} needs a library that is not installed; {mend}"


def _not_set(name: str, error: Exception) -> str:
    variable = VARIABLE.search(str(error))
    if variable is None:
        return f"{name} cannot be asked: {brief(error)}"
    return f"{name} needs {variable[1]} in the environment"
