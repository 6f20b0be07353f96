import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from codebotler.models.usable import KEY_VARIABLES, UsableModel, find_usable_models, suggest_model

RECORDED = ["recorded:careful", "recorded:hasty"]


@pytest.fixture(autouse=True)
def no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for key in KEY_VARIABLES:
        monkeypatch.delenv(key, raising=False)


@contextmanager
def serve(body: bytes, status: int = 200) -> Iterator[int]:
    """Run a server that lists models, and yield its port."""

    class Listing(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            assert self.path == "/v1/models"
            self.send_response(status)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Listing) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()
        yield http.server_port
        http.shutdown()


def test_the_models_of_a_server_on_this_machine_come_first() -> None:
    body = json.dumps(
        {"object": "list", "data": [{"id": "qwen3:8b"}, {"id": "llama 3"}, {"id": "nomic-embed-text"}]}
    )
    with serve(body.encode()) as port:
        found = find_usable_models({"Ollama": port, "vLLM": 1})
    url = f"http://127.0.0.1:{port}/v1"
    assert found[0] == UsableModel("openai-chat:qwen3:8b", "Ollama answers on this machine", url)
    assert found[1].options == f"--model 'openai-chat:llama 3' --base-url {url}"
    assert [one.name for one in found[2:]] == RECORDED


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"<html>", 200),
        (b"[" * 100_000, 200),
        (b"[]", 200),
        (b'{"data": [1]}', 200),
        (b'{"data": {}}', 200),
        (b'{"error": "no"}', 401),
    ],
)
def test_other_servers_are_ignored(body: bytes, status: int) -> None:
    with serve(body, status) as port:
        assert [one.name for one in find_usable_models({"vLLM": port})] == RECORDED


def test_silent_server_is_not_waited_for() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
        began = time.monotonic()
        assert [one.name for one in find_usable_models({"vLLM": port})] == RECORDED
        assert time.monotonic() - began < 10


def test_key_in_the_environment_makes_a_model_usable(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "OPENAI_API_KEY" in suggest_model({})
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-secret-of-mine")
    monkeypatch.setenv("OPENAI_API_KEY", " ")
    (first, *rest) = find_usable_models({})
    assert (first.why, first.base_url) == ("ANTHROPIC_API_KEY is set", None)
    assert [one.name for one in rest] == RECORDED
    assert suggest_model({}) == f"add --model {KEY_VARIABLES['ANTHROPIC_API_KEY']}"
