"""Servers may speak OpenAI's protocol in their own way, and may reply without a program."""

import asyncio
import json
from collections.abc import Iterator
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.models.base import ModelError, Reply, Usage
from codebotler.models.no_program import is_cut_off
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import prompt_for
from server import TASK, Server

PROMPT = prompt_for("Go to the lobby.")
BODY = '    go_to("lobby")\n'
CHAT, BASE = "openai-chat:some/model", "completions:some/model"
both = pytest.mark.parametrize("name", [CHAT, BASE])
JSON = {"Content-Type": "application/json"}


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    with Server() as served:
        yield served


def ask(name: str, server: Server, **settings: Any) -> Reply:  # noqa: ANN401 - of several types
    async def request() -> Reply:
        model = open_model(name, SamplingSettings(base_url=server.url, **settings))
        try:
            return await model.reply(PROMPT, number=0)
        finally:
            await model.close()

    return asyncio.run(request())


def chunk(name: str, text: str | None = None, end: str | None = None, **more: object) -> dict[str, Any]:
    """Make a chunk of a stream; `more` goes into its delta for chat, into its choice for completions."""
    if name == CHAT:
        delta = more | ({} if text is None else {"role": "assistant", "content": text})
        choice: dict[str, Any] = {"index": 0, "delta": delta, "finish_reason": end}
    else:
        choice = {"index": 0, "text": text or "", "finish_reason": end, **more}
    kind = "chat.completion.chunk" if name == CHAT else "text_completion"
    return {"id": "1", "object": kind, "created": 1, "model": "m", "choices": [choice]}


def whole(name: str) -> dict[str, Any]:
    """Make a chunk with a whole program."""
    return chunk(name, (TASK if name == CHAT else "") + BODY)


def stream(server: Server, *events: object) -> None:
    """Let the server send events: objects as data, text unchanged."""
    sent = [one if isinstance(one, str) else f"data: {json.dumps(one)}\n\n" for one in events]
    body = "".join(sent).encode()
    server.sends = lambda _request: (200, {}, body)


DONE = "data: [DONE]\n\n"


@both
@pytest.mark.parametrize("end", ["eos", "eos_token", "end_turn", "", "stop_sequence"])
def test_unknown_finish_reason_ends_the_reply(name: str, server: Server, end: str) -> None:
    stream(server, whole(name), chunk(name, None, end), DONE)
    reply = ask(name, server)
    assert (reply.program, reply.no_program) == (TASK + BODY, None)
    assert reply.finish_reason in {end, None}
    assert len(server.requests) == 1


@both
def test_done_event_alone_ends_the_reply(name: str, server: Server) -> None:
    stream(server, whole(name), DONE)
    assert ask(name, server).program == TASK + BODY


@both
@pytest.mark.parametrize(
    "last",
    [
        {"index": 0, "finish_reason": "stop"},
        {"index": 0, "delta": None, "text": None, "finish_reason": "stop"},
        None,
    ],
)
def test_last_chunk_may_lack_text_or_choices(name: str, server: Server, last: dict[str, Any] | None) -> None:
    end = chunk(name) | {"choices": None if last is None else [last]}
    stream(server, whole(name), end, DONE)
    reply = ask(name, server)
    assert (reply.program, reply.finish_reason) == (TASK + BODY, None if last is None else "stop")


@both
def test_events_without_data_and_retry_lines_are_skipped(name: str, server: Server) -> None:
    stream(server, ": hello\n\n", "retry: 3000\n\n", "event: ping\n\n", whole(name), "id: 7\n\n")
    with pytest.raises(ModelError, match="cut off"):  # No event ends it.
        ask(name, server)
    stream(server, ": hello\n\n", "retry: 3000\n\n", whole(name), "event: ping\n\n", chunk(name, "", "stop"))
    assert ask(name, server).program == TASK + BODY


@both
def test_cumulative_token_counts_are_not_added_up(name: str, server: Server) -> None:
    counts = [
        {"usage": {"prompt_tokens": 9, "completion_tokens": n, "total_tokens": 9 + n}} for n in (3, 5, 8)
    ]
    events = [whole(name), chunk(name, ""), chunk(name, "", "stop")]
    stream(server, *(event | count for event, count in zip(events, counts, strict=True)), DONE)
    assert ask(name, server).usage == Usage(9, 8)


# --- errors


ERROR = {"error": {"message": "The model is not loaded.", "type": "invalid_request_error"}}


@both
@pytest.mark.parametrize("headers", [JSON, {}])
def test_error_with_status_200_is_raised_in_the_servers_words(
    name: str, server: Server, headers: dict[str, str]
) -> None:
    body = json.dumps(ERROR).encode() if headers else f"data: {json.dumps(ERROR)}\n\n".encode()
    server.sends = lambda _request: (200, dict(headers), body)
    with pytest.raises(ModelError, match="The model is not loaded") as caught:
        ask(name, server)
    assert not caught.value.is_temporary


@both
@pytest.mark.parametrize("body", [{"choices": None}, {"object": "error", "message": "no such model"}])
def test_reply_without_choices_raises_one_sentence(name: str, server: Server, body: dict[str, Any]) -> None:
    server.sends = lambda _request: (200, dict(JSON), json.dumps(body).encode())
    with pytest.raises(ModelError) as caught:
        ask(name, server)
    assert caught.value.sentence.startswith(f"{name}: the server sent ")


@both
def test_error_names_the_address_of_a_redirect(name: str, server: Server) -> None:
    address = "https://me:secret@new.example/v1/completions?key=secret"
    server.sends = lambda _request: (308, {"Location": address}, b"")
    with pytest.raises(ModelError, match=r"redirects to https://new\.example/v1/completions;") as caught:
        ask(name, server)
    assert not caught.value.is_temporary
    assert len(server.requests) == 1


# --- proxies and certificates


@pytest.fixture
def proxy_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    with Server() as proxy:
        address = proxy.url.removesuffix("/v1")
        for variable in ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"):
            monkeypatch.setenv(variable, address)
            monkeypatch.setenv(variable.lower(), address)
        yield proxy


@both
def test_server_on_this_machine_is_never_asked_through_a_proxy(
    name: str, server: Server, proxy_server: Server
) -> None:
    assert ask(name, server).program.startswith(TASK)
    assert (len(server.requests), len(proxy_server.requests)) == (1, 0)


@both
def test_error_that_came_through_a_proxy_names_it(name: str, server: Server, proxy_server: Server) -> None:
    server.url = "http://model.invalid/v1"
    proxy_server.sends = lambda _request: (502, {"Content-Type": "text/html"}, b"<html>no route</html>")
    with pytest.raises(ModelError) as caught:
        ask(name, server)
    assert f"(through the proxy {proxy_server.url.removesuffix('/v1')})" in caught.value.sentence


@both
@pytest.mark.parametrize(
    ("variable", "value"), [("ALL_PROXY", "socks5://127.0.0.1:9"), ("SSL_CERT_FILE", "/no/such.pem")]
)
def test_wrong_environment_raises_one_sentence(
    name: str, server: Server, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    server.url = "https://model.invalid/v1"
    with pytest.raises((UserError, ModelError)) as caught:
        ask(name, server)
    sentence = str(caught.value)
    assert name in sentence
    assert ("SSL_CERT_FILE" if variable == "SSL_CERT_FILE" else "SOCKS") in sentence.replace("socks", "SOCKS")


# --- replies without a program


CALL = {"index": 0, "id": "c", "type": "function", "function": {"name": "go_to", "arguments": "{}"}}
NO = "I cannot do that."


@pytest.mark.parametrize(
    ("events", "kind", "text"),
    [
        ([chunk(CHAT, TASK + '    say("'), chunk(CHAT, None, "length")], "cut-off", TASK + '    say("'),
        (
            [chunk(CHAT, None, tool_calls=[CALL]), chunk(CHAT, None, "tool_calls")],
            "tool-call",
            "[tool call] go_to({})",
        ),
        (
            [chunk(CHAT, None, refusal=NO), chunk(CHAT, "", "stop")],
            "refusal",
            NO,
        ),
        ([chunk(CHAT, ""), chunk(CHAT, "", "content_filter")], "filtered", ""),
        ([chunk(CHAT, ""), chunk(CHAT, "", "stop")], "empty", ""),
        ([chunk(CHAT, "Sorry, no."), chunk(CHAT, "", "stop")], "no-code", "Sorry, no."),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_reply_without_a_program_says_why(
    server: Server, events: list[dict[str, Any]], kind: str, text: str
) -> None:
    stream(server, *events, DONE)
    reply = ask(CHAT, server)
    assert (reply.no_program, reply.text) == (kind, text)


def test_reply_cut_off_while_thinking_is_cut_off(server: Server) -> None:
    stream(server, chunk(CHAT, "<think>I should"), chunk(CHAT, None, "length"), DONE)
    reply = ask(CHAT, server)
    assert (reply.no_program, reply.reasoning, reply.text) == ("cut-off", "I should", "<think>I should")


@pytest.mark.parametrize(
    ("after", "why"),
    [("```\nIt goes to", None), ("", "cut-off"), (f"```\nBetter:\n```python\n{TASK}    say('", "cut-off")],
)
def test_cut_off_reply_has_a_program_if_text_follows_it(server: Server, after: str, why: str | None) -> None:
    stream(server, chunk(CHAT, f"```python\n{TASK}{BODY}{after}"), chunk(CHAT, None, "length"), DONE)
    reply = ask(CHAT, server)
    assert (reply.program, reply.no_program, is_cut_off(reply.finish_reason)) == (TASK + BODY, why, True)


@both
def test_filtered_request_becomes_a_reply(name: str, server: Server) -> None:
    said = {"message": "The prompt triggered our content management policy.", "code": "content_filter"}
    server.sends = lambda _request: (400, dict(JSON), json.dumps({"error": said}).encode())
    reply = ask(name, server)
    assert (reply.no_program, reply.program) == ("filtered", "")
    assert "content management policy" in reply.text


@both
def test_refused_prompt_differs_from_other_failures(name: str, server: Server) -> None:
    found = []
    for status, said in (
        (400, "This prompt is too long."),
        (400, "Your credit balance is too low."),
        (401, "No"),
    ):
        body = json.dumps({"error": {"message": said}}).encode()
        server.sends = lambda _request, status=status, body=body: (status, dict(JSON), body)  # type: ignore[misc] # defaults
        with pytest.raises(ModelError) as caught:
            ask(name, server)
        found.append(caught.value.is_refusal)
    assert found == [True, False, False]


@pytest.mark.parametrize("field", ["reasoning_content", "reasoning"])
def test_reasoning_is_kept_apart(server: Server, field: str) -> None:
    thought = "I might write def task_program(): pass"
    usage = {"prompt_tokens": 9, "completion_tokens": 30, "total_tokens": 39}
    usage |= {"completion_tokens_details": {"reasoning_tokens": 20}}  # type: ignore[dict-item] # a nested object
    end = chunk(CHAT, None, "stop") | {"usage": usage}
    stream(server, chunk(CHAT, None, **{field: thought}), whole(CHAT), end, DONE)
    reply = ask(CHAT, server)
    assert (reply.program, reply.reasoning, reply.text) == (TASK + BODY, thought, TASK + BODY)
    assert reply.usage == Usage(9, 30, 20)


def test_reasoning_is_heard_between_marks(server: Server) -> None:
    stream(server, chunk(CHAT, None, reasoning_content="Hm."), whole(CHAT), chunk(CHAT, None, "stop"), DONE)
    heard: list[str] = []

    async def request() -> None:
        model = open_model(CHAT, SamplingSettings(base_url=server.url))
        await model.reply(PROMPT, number=0, on_text=heard.append)
        await model.close()

    asyncio.run(request())
    assert "".join(heard) == f"<think>\nHm.\n</think>\n{TASK}{BODY}"


def test_reasoning_in_tags_is_kept_apart(server: Server) -> None:
    stream(server, chunk(CHAT, "<think>Hm.</think>\n"), whole(CHAT), chunk(CHAT, None, "stop"), DONE)
    reply = ask(CHAT, server)
    assert (reply.program, reply.reasoning.strip()) == (TASK + BODY, "Hm.")


# --- settings


def test_own_servers_get_the_limit_by_the_name_that_they_know(server: Server) -> None:
    ask(CHAT, server, max_tokens=99)
    body = server.requests[0].body
    assert (body["max_tokens"], body.get("max_completion_tokens")) == (99, None)


def test_chat_models_get_no_limit_and_base_models_that_of_the_paper(server: Server) -> None:
    ask(CHAT, server)
    ask(BASE, server)
    chat, base = (request.body for request in server.requests)
    assert not {"max_tokens", "max_completion_tokens"} & chat.keys()
    assert base["max_tokens"] == 512


@both
def test_extra_body_is_sent(name: str, server: Server) -> None:
    ask(name, server, extra_body={"top_k": 20, "chat_template_kwargs": {"enable_thinking": False}})
    body = server.requests[0].body
    assert (body["top_k"], body["chat_template_kwargs"]) == (20, {"enable_thinking": False})


def test_effort_is_sent_to_own_servers(server: Server) -> None:
    ask(CHAT, server, reasoning_effort="low")
    assert server.requests[0].body["reasoning_effort"] == "low"


def test_base_models_take_no_effort(server: Server) -> None:
    with pytest.raises(UserError, match="effort"):
        ask(BASE, server, reasoning_effort="low")


@pytest.mark.parametrize(
    ("name", "sent"),
    [
        ("openai-chat:o3-mini", (None, None, None)),
        ("openai-chat:gpt-4o", (0.2, 0.95, None)),
        ("anthropic:claude-sonnet-4-5", (0.2, None, 16_384)),
    ],
)
def test_settings_show_the_values_that_are_sent(
    name: str, sent: tuple[float | None, float | None, int | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    for key in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.setenv(key, "a key of nobody")
    settings = open_model(name, SamplingSettings()).settings
    assert (settings.temperature, settings.top_p, settings.max_tokens) == sent


# --- habits of current servers and accounts


def test_thoughts_are_found_wherever_a_stream_cuts_their_tags(server: Server) -> None:
    pieces = ["<think>", "\nOkay.", "</think>\n\n", f"```python\n{TASK}{BODY}```"]
    stream(server, *(chunk(CHAT, piece) for piece in pieces), chunk(CHAT, None, "stop"), DONE)
    reply = ask(CHAT, server)
    assert (reply.program, reply.no_program, reply.reasoning) == (TASK + BODY, None, "Okay.")
    assert reply.text == "".join(pieces)


@both
@pytest.mark.parametrize(
    "event",
    [
        'error: {"code": 500, "message": "context shift is disabled"}\n\n',
        'data: {"error_code": 50001, "message": "context shift is disabled"}\n\n',
        'data: {"detail": "context shift is disabled"}\n\n',
    ],
)
def test_error_instead_of_a_chunk_is_raised_in_the_servers_words(
    name: str, server: Server, event: str
) -> None:
    stream(server, event, DONE)
    with pytest.raises(ModelError, match="context shift is disabled"):
        ask(name, server)


@both
def test_aborted_reply_is_an_error_that_may_pass(name: str, server: Server) -> None:
    stream(server, whole(name), chunk(name, "", "abort"), DONE)
    with pytest.raises(ModelError, match="cut off") as caught:
        ask(name, server)
    assert caught.value.is_temporary


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (403, "openai/gpt-4o requires moderation on this provider. Your input was flagged."),
        (400, "Content Exists Risk"),
        (400, "Invalid prompt: flagged as potentially violating our usage policy."),
    ],
)
def test_messages_of_providers_filters_are_recognised(server: Server, status: int, said: str) -> None:
    server.sends = lambda _request: (status, dict(JSON), json.dumps({"error": {"message": said}}).encode())
    assert ask(CHAT, server).no_program == "filtered"


@pytest.mark.parametrize("said", ["Budget has been exceeded!", "API key expired. Please renew it."])
def test_exhausted_account_is_not_a_refusal(server: Server, said: str) -> None:
    server.sends = lambda _request: (400, dict(JSON), json.dumps({"error": {"message": said}}).encode())
    with pytest.raises(ModelError) as caught:
        ask(CHAT, server)
    assert not caught.value.is_refusal


def test_gateways_to_reasoning_models_get_the_newer_name_of_the_limit(server: Server) -> None:
    ask("openai-chat:gpt-5", server, max_tokens=99)
    body = server.requests[0].body
    assert (body.get("max_tokens"), body["max_completion_tokens"]) == (None, 99)


def test_server_of_the_environment_is_an_own_server(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_BASE_URL", server.url)
    monkeypatch.setenv("ALL_PROXY", "socks5://127.0.0.1:9")

    async def request() -> None:
        model = open_model("openai-chat:some", SamplingSettings(max_tokens=99))
        await model.reply(PROMPT, number=0)
        await model.close()

    asyncio.run(request())
    assert server.requests[0].body["max_tokens"] == 99


@both
def test_socks_proxy_is_ignored_for_a_server_on_this_machine(
    name: str, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ALL_PROXY", "socks5://127.0.0.1:9")
    assert ask(name, server).program.startswith(TASK)


@pytest.mark.parametrize("field", ["temperature", "max_tokens", "stream"])
def test_extra_body_must_not_repeat_a_setting(field: str) -> None:
    with pytest.raises(UserError, match=field):
        SamplingSettings(extra_body={field: 1})


@pytest.mark.parametrize(
    ("name", "asked", "sent"),
    [
        ("anthropic:claude-sonnet-4-5", {"reasoning_effort": "low"}, (None, None, 32_768, None)),
        ("anthropic:claude-sonnet-4-5", {"seed": 5}, (0.2, None, 16_384, None)),
        ("google:gemini-2.5-flash", {"seed": 5}, (0.2, 0.95, None, 5)),
    ],
)
def test_settings_of_providers_with_effort_and_seed(
    name: str, asked: dict[str, Any], sent: tuple[object, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    for key in ("GOOGLE_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.setenv(key, "a key of nobody")
    found = open_model(name, SamplingSettings(**asked)).settings
    assert (found.temperature, found.top_p, found.max_tokens, found.seed) == sent


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("google:gemini-2.5-flash", {"extra_body": {"labels": 1}}),
        ("google:gemini-2.5-pro", {"reasoning_effort": "most"}),
    ],
)
def test_setting_that_a_provider_does_not_take_is_refused(
    name: str, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GOOGLE_API_KEY", "a key of nobody")
    with pytest.raises(UserError, match=name):
        open_model(name, SamplingSettings(**asked))
