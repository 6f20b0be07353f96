"""Build request files and parse answer files for batch endpoints that use OpenAI's protocol."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import httpx2

from codebotler.core.errors import UserError
from codebotler.models.base import Reply
from codebotler.models.sampling import SamplingSettings
from codebotler.models.servers.chat import OWN_SERVER, ChatModel
from codebotler.models.servers.completions import CompletionsModel
from codebotler.models.servers.server_errors import FIRST_ERROR, error_in_reply
from codebotler.prompts import Prompt

OPENAI_URL = "https://api.openai.com/v1"
STREAM_FIELDS = ("stream", "stream_options")  # not allowed in batches
EMPTY_ANSWER = {
    "choices": [{"index": 0, "finish_reason": "stop", "text": "pass", "message": {"content": "pass"}}]
}
STREAM_HEADERS = {"content-type": "text/event-stream"}


@dataclass(frozen=True)
class BatchRequest:
    """A request for a batch endpoint: the path of the endpoint, and the JSON body."""

    url: str  # the path of the endpoint, such as `/v1/chat/completions`
    body: Mapping[str, Any]  # as JSON


class BatchModel:
    """Builds the requests of a batch file and parses the responses, without sending anything or using a key.

    Internally, a `ChatModel` or `CompletionsModel` talks to a fake server in this process.
    """

    def __init__(self, name: str, settings: SamplingSettings) -> None:
        kind, _, rest = name.partition(":")
        client = httpx2.AsyncClient(transport=httpx2.MockTransport(self._answer_request))
        usable = replace(settings, base_url=settings.base_url or OPENAI_URL, timeout=SamplingSettings.timeout)
        self._model: ChatModel | CompletionsModel
        if kind == "completions":
            self._model = CompletionsModel(rest, usable, client)
        elif kind == OWN_SERVER or (kind == "openai" and settings.base_url is not None):
            self._model = ChatModel(name, usable, client)
        else:
            raise UserError(f"{name} does not support batch files; use {OWN_SERVER}:NAME or completions:NAME")
        self.name = self._model.name
        self.settings = replace(self._model.settings, base_url=settings.base_url, timeout=settings.timeout)
        self._runner = asyncio.Runner()
        self._bodies: dict[Prompt, Mapping[str, Any]] = {}
        self._sent: httpx2.Request | None = None
        self._answer = _response(200, EMPTY_ANSWER)

    def request(self, prompt: Prompt, *, number: int) -> BatchRequest:
        """Return the request for reply `number` to a prompt, counted from 0."""
        if prompt not in self._bodies:
            self._reply(prompt, number, _response(200, EMPTY_ANSWER))
            assert self._sent is not None, "the model sent no request"
            sent = json.loads(self._sent.content)
            self._bodies[prompt] = {name: value for name, value in sent.items() if name not in STREAM_FIELDS}
        seed = self.settings.seed_of(number)  # requests for the same prompt differ only in their seed
        body = {**self._bodies[prompt], **({} if seed is None else {"seed": seed})}
        is_chat = isinstance(self._model, ChatModel)
        return BatchRequest("/v1/chat/completions" if is_chat else "/v1/completions", body)

    def reply(self, prompt: Prompt, *, number: int, status: int, body: object) -> Reply:
        """Parse the reply in a response with this HTTP status and JSON body, or raise ModelError."""
        if status < FIRST_ERROR and not _has_choice(body):
            raise error_in_reply(self.name, body)
        short = replace(prompt, messages=prompt.messages[-1:])  # encoding a long prompt would only cost time
        return replace(self._reply(short, number, _response(status, body)), latency_s=None)

    def close(self) -> None:
        """Release all resources."""
        self._runner.run(self._model.close())
        self._runner.close()

    def _reply(self, prompt: Prompt, number: int, answer: httpx2.Response) -> Reply:
        self._answer = answer
        return self._runner.run(self._model.reply(prompt, number=number))

    def _answer_request(self, request: httpx2.Request) -> httpx2.Response:
        self._sent = request
        return self._answer


def _has_choice(body: object) -> bool:
    choices = body.get("choices") if isinstance(body, Mapping) else None
    return isinstance(choices, list) and bool(choices) and isinstance(choices[0], Mapping)


def _response(status: int, body: Any) -> httpx2.Response:  # noqa: ANN401 - any JSON
    """Build the response that a server would have sent as a stream."""
    if status >= FIRST_ERROR:
        return httpx2.Response(status, json=body)
    choice = dict(body["choices"][0])
    if isinstance(message := choice.pop("message", None), Mapping):
        choice["delta"] = {name: value for name, value in message.items() if value is not None}
    chunk = {**body, "object": "chat.completion.chunk", "choices": [choice]}
    text = f"data: {json.dumps(chunk)}\n\ndata: [DONE]\n\n"
    return httpx2.Response(200, headers=STREAM_HEADERS, text=text)
