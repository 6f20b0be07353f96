import asyncio
import subprocess
import sys

import pytest

from codebotler.core.errors import UserError
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings

COMMAND = 'pip install "pydantic-ai-slim[groq]"'
URL = "http://127.0.0.1:9/v1"


@pytest.fixture(autouse=True)
def _without_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (
        "OPENAI_API_KEY",
        "OPENAI_BASE_URL",
        "ANTHROPIC_API_KEY",
        "GOOGLE_API_KEY",
        "GEMINI_API_KEY",
    ):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("name", "url", "named"),
    [
        ("openai-chat:m", None, ["openai-chat:m", "OPENAI_API_KEY"]),
        ("openai:m", None, ["openai:m", "OPENAI_API_KEY"]),
        ("anthropic:m", None, ["anthropic:m", "ANTHROPIC_API_KEY"]),
        ("google:m", None, ["google:m", "GOOGLE_API_KEY"]),
        ("openay-chat:m", None, ['"openay-chat"', '"openai-chat"']),
        ("nobody:m", None, ['"nobody"', "openai-chat, anthropic or google"]),
        ("groq:m", None, ["groq:m", COMMAND]),
        ("deepseek:m", URL, ['"deepseek"', "base URL", "openai-chat:MODEL"]),
        ("completions:m", None, ["completions:m", "--base-url", "OPENAI_API_KEY"]),
    ],
)
def test_unusable_models_are_refused_in_one_sentence(name: str, url: str | None, named: list[str]) -> None:
    with pytest.raises(UserError) as caught:
        open_model(name, SamplingSettings(base_url=url))
    assert all(each in caught.value.sentence for each in named), caught.value


def test_error_for_a_missing_extra_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "codebotler.models.local", raising=False)
    with pytest.raises(UserError, match="torch") as caught:
        open_model("hf:some/model", SamplingSettings())
    assert "pip install 'codebotler[transformers]'" in caught.value.sentence


@pytest.mark.parametrize("name", ["openai-chat:m", "vllm:m", "ollama:m", "completions:m", "anthropic:m"])
def test_models_keep_the_name_they_were_opened_with(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-ant-0123456789")
    model = open_model(name, SamplingSettings(base_url=URL))
    assert model.name == name
    asyncio.run(model.close())


def test_nothing_heavy_is_imported_before_it_is_needed() -> None:
    source = (
        "import sys\n"
        "from codebotler.models.open import open_model\n"
        "from codebotler.models.base import SamplingSettings\n"
        "open_model('recorded', SamplingSettings())\n"
        "print(*sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True)
    assert not {"openai", "pydantic_ai", "torch", "transformers"} & {*done.stdout.split()}


@pytest.mark.parametrize(
    ("name", "variable"),
    [
        ("completions:m", "OPENAI_API_KEY"),
        ("openai-chat:m", "OPENAI_API_KEY"),
        ("openai:m", "OPENAI_API_KEY"),
        ("anthropic:m", "ANTHROPIC_API_KEY"),
        ("google:m", "GOOGLE_API_KEY"),
        ("vllm:m", "VLLM_API_KEY"),
        ("gateway/openai:m", "PYDANTIC_AI_GATEWAY_API_KEY"),
    ],
)
@pytest.mark.parametrize(
    "key", ["sk-one\nsk-two", "sk-schl\u00fcssel", "sk-\x1bred", "sk-one\r", " sk-one", "sk-\udcff"]
)
@pytest.mark.parametrize("url", [None, URL])
def test_key_that_cannot_be_sent_is_refused(
    monkeypatch: pytest.MonkeyPatch, name: str, variable: str, key: str, url: str | None
) -> None:
    monkeypatch.setenv(variable, key)
    with pytest.raises(UserError) as caught:
        open_model(name, SamplingSettings(base_url=url))
    sentence = caught.value.sentence
    assert f"key in {variable} " in sentence
    assert key.strip() not in sentence
    assert sentence.isprintable()


def test_invalid_key_of_another_provider_is_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-one\nsk-two")
    asyncio.run(open_model("openai-chat:m", SamplingSettings(base_url=URL)).close())


@pytest.mark.parametrize(
    ("name", "variable"),
    [
        ("openai-chat:m", "OPENAI_API_KEY"),
        ("openai:m", "OPENAI_API_KEY"),
        ("anthropic:m", "ANTHROPIC_API_KEY"),
        ("google:m", "GOOGLE_API_KEY"),
    ],
)
@pytest.mark.parametrize("key", ["", "  "])
def test_blank_key_counts_as_missing(
    monkeypatch: pytest.MonkeyPatch, name: str, variable: str, key: str
) -> None:
    monkeypatch.setenv(variable, key)
    with pytest.raises(UserError) as caught:
        open_model(name, SamplingSettings())
    assert name in caught.value.sentence
    assert variable in caught.value.sentence


@pytest.mark.parametrize(
    "url",
    [
        "user:topsecretpw@localhost:8000/v1",
        "http//user:topsecretpw@localhost/v1",
        "http:/user:topsecretpw@localhost/v1",
        "http://user:topsec/retpw@localhost/v1",
        "http://user:topsecretpw/v1",
        "http://user/topsecretpw@localhost/v1",
        "http://localhost:topsecretpw",
        "http://[topsecretpw/v1",
        "http://localhost\u2100topsecretpw/v1",
        "topsecretpw",
        "ftp://topsecretpw",
        "http://localhost/v1?key=topsecretpw",
        "http://localhost/v1#topsecretpw",
        "http://localhost/v1#",
    ],
)
def test_base_url_that_is_refused_is_not_quoted(url: str) -> None:
    with pytest.raises(UserError) as caught:
        SamplingSettings(base_url=url)
    sentence = str(caught.value)
    assert "base URL" in sentence
    assert not any(part in sentence for part in ("topsec", "retpw", "user:", "key="))
    assert caught.value.__cause__ is None
