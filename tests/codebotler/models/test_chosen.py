from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.models.open import ChosenModel, choose_model
from codebotler.models.sampling import SamplingSettings

URL = "http://localhost:11434/v1"


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CODEBOTLER_HOME", str(tmp_path))
    monkeypatch.delenv("CODEBOTLER_MODEL", raising=False)
    return tmp_path / "config.yaml"


def test_default_is_the_recorded_model() -> None:
    assert choose_model() == ChosenModel("recorded:careful")


def test_a_name_comes_before_the_environment_and_that_before_the_file(
    config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config.write_text(f"model: openai-chat:qwen3\nbase_url: {URL}\n")
    assert choose_model() == ChosenModel("openai-chat:qwen3", URL)
    assert choose_model(base_url="http://localhost:1/v1").base_url == "http://localhost:1/v1"
    monkeypatch.setenv("CODEBOTLER_MODEL", "anthropic:claude-sonnet-4-5")
    assert choose_model() == ChosenModel("anthropic:claude-sonnet-4-5")
    assert choose_model("recorded:hasty") == ChosenModel("recorded:hasty")
    assert choose_model("openai-chat:qwen3") == ChosenModel("openai-chat:qwen3", URL)
    monkeypatch.setenv("CODEBOTLER_MODEL", " ")
    assert choose_model().name == "openai-chat:qwen3"


def test_limit_of_the_file_is_for_its_model_unless_a_command_names_one(config: Path) -> None:
    config.write_text(f"model: openai-chat:qwen3\nbase_url: {URL}\nmax_tokens: 900\n")
    limited, other = choose_model(), choose_model("openai-chat:other")
    assert limited.add_server(SamplingSettings()) == SamplingSettings(max_tokens=900, base_url=URL)
    assert limited.add_server(SamplingSettings(max_tokens=5)).max_tokens == 5
    assert other.add_server(SamplingSettings()) == SamplingSettings()


def test_without_codebotler_home_the_file_is_in_the_config_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CODEBOTLER_HOME")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "codebotler").mkdir()
    (tmp_path / "codebotler" / "config.yaml").write_text("model: recorded:hasty\n")
    assert choose_model().name == "recorded:hasty"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "config.yaml"),
        ("modl: a\nmodel: b\n", "line 1.*modl"),
        ("model: [a]\n", "line 1"),
        ("model: ''\n", "line 1"),
        ("base_url: http://127.0.0.1:1/v1\n", "line 1.*need a model; add one"),
        ("model: a\nmax_tokens: 0\n", "line 2"),
    ],
)
def test_invalid_file_is_refused_with_its_line(text: str, named: str, config: Path) -> None:
    config.write_text(text)
    with pytest.raises(UserError, match=named):
        choose_model()
    assert choose_model("recorded:hasty").name == "recorded:hasty", "a named model needs no file"
