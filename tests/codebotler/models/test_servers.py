"""Chat and text completions work with a real server, and survive its faults."""

import asyncio
import os
import re
import socket
from collections.abc import Coroutine, Iterator
from typing import Any, TypeVar

import openai
import pytest

from codebotler.models.base import Model, ModelError, Reply, Usage
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from codebotler.models.servers import http_client
from codebotler.prompts import Prompt, PromptMessage, prompt_for
from server import CHUNK, HUGE, TASK, Fault, Server

T = TypeVar("T")
PROMPT = prompt_for("Go to the lobby.")
PROGRAM = '    go_to("lobby")\n    say("reply 7")\n'
CHAT, BASE = "openai-chat:some/model", "completions:some/model"
both = pytest.mark.parametrize("name", [CHAT, BASE])


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    with Server() as served:
        yield served


def ask(name: str, server: Server, prompt: Prompt = PROMPT, **settings: Any) -> tuple[Reply, list[str]]:  # noqa: ANN401 - of several types
    """Ask an own server once; return its reply and the pieces that were heard."""
    heard: list[str] = []

    async def request(model: Model) -> Reply:
        try:
            return await model.reply(prompt, number=4, on_text=heard.append)
        finally:
            await model.close()

    return asyncio.run(
        request(open_model(name, SamplingSettings(base_url=server.url, seed=3, **settings)))
    ), heard


@both
def test_reply_is_streamed_and_holds_the_program(name: str, server: Server) -> None:
    reply, heard = ask(name, server)
    assert len(heard) > 1
    assert "".join(heard) == reply.text
    assert reply.program == TASK + PROGRAM
    (request,) = server.requests
    if name == CHAT:
        assert reply.text == f"Here it is.\n\n```python\n{TASK}{PROGRAM}```\n"
        assert request.path == "/chat/completions"
    else:
        assert reply.text == PROGRAM
        assert request.path == "/completions"
    assert reply.finish_reason == "stop"
    assert reply.usage.output_tokens == len(reply.text) // 4
    assert (reply.usage.input_tokens or 0) > 500
    assert reply.usage.total == (reply.usage.input_tokens or 0) + len(reply.text) // 4
    assert 0 < (reply.latency_s or 0) < 30


@both
def test_settings_are_sent(name: str, server: Server) -> None:
    ask(name, server, temperature=0.7, top_p=0.9, max_tokens=99)
    body = server.requests[0].body
    limit = body.get("max_tokens") or body.get("max_completion_tokens")
    assert (body["model"], body["stream"], limit) == ("some/model", True, 99)
    assert (body["temperature"], body["top_p"], body["seed"]) == (0.7, 0.9, 7)


@both
def test_settings_that_are_none_are_left_to_the_server(name: str, server: Server) -> None:
    async def request() -> Reply:
        settings = SamplingSettings(base_url=server.url, temperature=None, top_p=None)
        model = open_model(name, settings)
        reply = await model.reply(PROMPT, number=4)
        await model.close()
        return reply

    asyncio.run(request())
    assert not {"temperature", "top_p", "seed"} & set(server.requests[0].body)


def test_chat_is_sent_as_messages(server: Server) -> None:
    prompt = PROMPT.after("def task_program():\n    pass\n", ["it does nothing"])
    ask(CHAT, server, prompt)
    sent = [PromptMessage(m["role"], m["content"]) for m in server.requests[0].body["messages"]]
    assert tuple(sent) == prompt.messages


def test_text_is_sent_with_its_stop_sequences(server: Server) -> None:
    ask(BASE, server)
    body = server.requests[0].body
    assert body["prompt"] == PROMPT.text
    assert tuple(body["stop"]) == PROMPT.stop


def test_server_that_does_not_stop_is_cut_at_the_functions_end(server: Server) -> None:
    server.answer = lambda _request: PROGRAM + "\n\n# Instruction: Go home.\n" + TASK + "    pass\n"
    reply, _ = ask(BASE, server)
    assert reply.program == TASK + PROGRAM


def test_openai_means_chat_completions_if_a_base_url_is_given(server: Server) -> None:
    model = open_model("openai:m", SamplingSettings(base_url=server.url))
    assert model.name == "openai-chat:m"
    reply, _ = ask("openai:m", server)
    assert reply.program == TASK + PROGRAM
    assert server.requests[0].path == "/chat/completions"
    asyncio.run(model.close())


PASSING = {
    Fault.TOO_MANY: "status 429 (Too many requests)",
    Fault.SERVER_ERROR: "status 500 (Something went wrong)",
    Fault.HUNG_UP: "(Server disconnected without sending a response)",
    Fault.CUT: "(peer closed connection without sending complete message body",
    Fault.CUT_IN_ORDER: "cut off",
    Fault.ERROR_IN_STREAM: "The engine died",
    Fault.INVALID_JSON: "Unterminated string starting at",
    Fault.NOTHING: "base URL",
    Fault.WRONG_TYPE: "base URL",
}
LASTING = {
    Fault.UNAUTHORIZED: "status 401 (Incorrect API key provided",
    Fault.NOT_FOUND: "status 404 (The model does not exist)",
    Fault.TOO_LONG: "status 400 (The maximum context length is 2048 tokens)",
    Fault.NO_MONEY: "status 429 (You exceeded your current quota)",
}


@both
@pytest.mark.parametrize("fault", [*PASSING, *LASTING], ids=lambda fault: fault.name)
def test_failure_is_one_sentence_and_says_whether_it_may_pass(
    name: str, server: Server, fault: Fault
) -> None:
    server.faults.append(fault)
    with pytest.raises(ModelError) as caught:
        ask(name, server)
    error = caught.value
    assert error.sentence.startswith(f"{name}: ")
    assert (PASSING | LASTING)[fault] in error.sentence
    assert "\n" not in error.sentence
    assert error.is_temporary == (fault in PASSING)
    assert error.retry_after is None
    assert len(server.requests) == 1  # The client itself does not retry.


@both
@pytest.mark.parametrize(
    ("said", "seconds"),
    [("7", 7), ("soon", None), ("Wed, 21 Oct 2015 07:28:00 GMT", 0), ("nan", None)],
)
def test_retry_after_is_read(name: str, server: Server, said: str, seconds: float | None) -> None:
    server.faults.append(Fault.TOO_MANY_FOR_A_WHILE)
    server.retry_after = said
    with pytest.raises(ModelError) as caught:
        ask(name, server)
    assert caught.value.is_temporary
    assert caught.value.retry_after == seconds


@both
@pytest.mark.parametrize("fault", [Fault.SLOW, Fault.STALLED], ids=lambda fault: fault.name)
def test_slow_reply_times_out(name: str, server: Server, fault: Fault) -> None:
    server.faults.append(fault)
    with pytest.raises(ModelError) as caught:
        ask(name, server, timeout=0.3)
    assert re.match(rf"{name}: .* 0\.3 s", caught.value.sentence)
    assert caught.value.is_temporary


@both
def test_endless_reply_times_out_though_its_pieces_arrive_in_time(name: str, server: Server) -> None:
    async def request() -> None:
        model = open_model(name, SamplingSettings(base_url=server.url, timeout=1.0))
        try:
            await asyncio.wait_for(model.reply(PROMPT, number=0, on_text=heard.append), 10)
        finally:
            await model.close()

    heard: list[str] = []
    server.faults.append(Fault.DRIP)
    with pytest.raises(ModelError) as caught:
        asyncio.run(request())
    assert re.match(rf"{name}: .* 1 s", caught.value.sentence)
    assert caught.value.is_temporary
    assert len(heard) > 2


@both
@pytest.mark.parametrize("word", ["pk_location_name", "hf_rooms_to_visit"])
def test_program_with_a_name_that_looks_like_a_key_is_unchanged(name: str, server: Server, word: str) -> None:
    server.answer = lambda request: f"{TASK * request.is_chat}    {word} = 1\n"
    reply, _ = ask(name, server)
    assert reply.program == f"{TASK}    {word} = 1\n"


@both
def test_short_key_that_a_server_sends_back_is_not_shown(
    name: str, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sesame")
    server.faults.append(Fault.UNAUTHORIZED)
    with pytest.raises(ModelError) as caught:
        ask(name, server)
    assert server.requests[0].headers["authorization"] == "Bearer sesame"
    assert "sesame" not in caught.value.sentence


@both
@pytest.mark.parametrize("key", ["", " "])
def test_blank_key_counts_as_missing(
    name: str, server: Server, monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", key)
    reply, _ = ask(name, server)
    assert reply.program == TASK + PROGRAM
    assert server.requests[0].headers["authorization"] in {"Bearer none", "Bearer api-key-not-set"}
    assert os.environ["OPENAI_API_KEY"] == key


@both
def test_unreachable_server_raises_one_sentence(name: str, server: Server) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        server.url = f"http://127.0.0.1:{taken.getsockname()[1]}/v1"
        sentence = rf"{server.url} \(.*(attempts failed|refused).*\)"
        with pytest.raises(ModelError, match=sentence) as caught:
            ask(name, server)
    assert caught.value.is_temporary


@both
def test_reply_without_text_or_code_is_a_reply(name: str, server: Server) -> None:
    server.faults.extend([Fault.EMPTY, Fault.WITHOUT_CODE])
    reply, heard = ask(name, server)
    assert (reply.text, heard, reply.finish_reason) == ("", [], "stop")
    assert reply.usage == Usage(reply.usage.input_tokens, 0)
    reply, _ = ask(name, server)
    assert reply.text == "I am afraid that I cannot help with that."


@pytest.mark.slow
@both
def test_huge_reply_is_a_reply(name: str, server: Server) -> None:
    server.faults.append(Fault.HUGE)
    reply, heard = ask(name, server)
    assert len(reply.text) == HUGE
    assert "".join(heard) == reply.text
    assert len(heard) > HUGE // (CHUNK * 1000)


@pytest.mark.parametrize("name", [CHAT, BASE, "anthropic:some", "google:some", "openai-responses:some"])
@pytest.mark.parametrize("fault", [Fault.COMPRESSED, Fault.COMPRESSED_ERROR, Fault.ENDLESS])
def test_oversized_reply_is_not_read(
    name: str, fault: Fault, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key in ("ANTHROPIC_API_KEY", "GOOGLE_API_KEY", "OPENAI_API_KEY"):
        monkeypatch.setenv(key, "a key of nobody")
    monkeypatch.setattr(http_client, "MIN_REPLY_BYTES", 200_000)
    server.faults.append(fault)
    with pytest.raises(
        ModelError, match="200,000 bytes" if fault is Fault.ENDLESS else "compressed"
    ) as caught:
        ask(name, server, max_tokens=10)
    assert not caught.value.is_temporary
    assert caught.value.sentence.startswith(name.partition(":")[0])
    assert len(server.requests) == 1
    assert server.requests[0].headers["accept-encoding"] == "identity"


def test_a_limit_follows_the_tokens() -> None:
    assert http_client.byte_limit(1) == http_client.MIN_REPLY_BYTES
    assert (
        http_client.byte_limit(100_000) == 100_000 * http_client.BYTES_PER_TOKEN > http_client.MIN_REPLY_BYTES
    )


@both
def test_server_that_does_not_count_tokens_leaves_them_unknown(name: str, server: Server) -> None:
    server.counts = False
    reply, _ = ask(name, server)
    assert reply.usage == Usage(None, None)


@both
def test_cancelled_request_ends_at_once_and_the_next_one_is_answered(name: str, server: Server) -> None:
    async def request() -> Reply:
        model = open_model(name, SamplingSettings(base_url=server.url, seed=7))
        begun = asyncio.Event()
        server.faults.append(Fault.STALLED)
        task = asyncio.create_task(model.reply(PROMPT, number=0, on_text=lambda _piece: begun.set()))
        await begun.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await asyncio.wait_for(task, 5)
        reply = await model.reply(PROMPT, number=0)
        await model.close()
        return reply

    assert asyncio.run(request()).program == TASK + PROGRAM


def run(work: Coroutine[Any, Any, T]) -> T:
    return asyncio.run(work)


def test_server_speaks_both_protocols_without_streaming_too(server: Server) -> None:
    async def request() -> tuple[str | None, str]:
        async with openai.AsyncOpenAI(api_key="a", base_url=server.url, max_retries=0) as client:
            chat = await client.chat.completions.create(model="m", messages=[], seed=7)
            text = await client.completions.create(model="m", prompt="", seed=7)
            server.faults.append(Fault.INVALID_JSON)
            with pytest.raises(ValueError, match=r"Unterminated|Expecting"):
                await client.completions.create(model="m", prompt="")
        return chat.choices[0].message.content, text.choices[0].text

    said, text = run(request())
    assert PROGRAM in (said or "")
    assert text == PROGRAM
