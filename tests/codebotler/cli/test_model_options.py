"""Options set how a model is asked, in each command that asks one."""

import json
from pathlib import Path

import pytest

from codebotler.cli.model_options import model_settings
from codebotler.core.errors import UserError
from codebotler.models.sampling import SamplingSettings
from command_line import command, roboeval
from server import Server


def test_no_options_give_the_default_settings() -> None:
    assert model_settings() == SamplingSettings()


def test_settings_of_the_paper_have_its_limit() -> None:
    paper = model_settings(settings="paper", seed=3)
    assert paper == SamplingSettings(temperature=0.2, top_p=0.95, max_tokens=512, seed=3)
    assert model_settings(settings="paper", max_tokens=9).max_tokens == 9


def test_omitted_settings_are_none() -> None:
    settings = model_settings(no_temperature=True, top_p=0.5, extra_body='{"top_k": 20}')
    assert (settings.temperature, settings.top_p, settings.extra_body) == (None, 0.5, {"top_k": 20})


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"temperature": 0.5, "no_temperature": True}, "--no-temperature"),
        ({"top_p": 0.5, "no_top_p": True}, "--no-top-p"),
        ({"settings": "papers"}, '"papers"'),
        ({"extra_body": "[1]"}, "--extra-body"),
        ({"extra_body": "{"}, "--extra-body"),
    ],
)
def test_contradictions_are_refused(options: dict[str, object], named: str) -> None:
    with pytest.raises(UserError, match=named):
        model_settings(**options)  # type: ignore[arg-type] # of several types


@pytest.mark.parametrize("name", ["generate", "roboeval"])
def test_options_reach_the_server(name: str, tmp_path: Path) -> None:
    words = ["--max-tokens", "700", "--no-temperature", "--extra-body", '{"top_k": 20}']
    with Server() as server:
        words += ["--model", "openai:m", "--base-url", server.url]
        if name == "generate":
            ended = command("codebotler", "generate", "Go to the lobby.", *words, cwd=tmp_path)
        else:
            some = ["--tasks", "LunchTime", "--num-completions", "1", "--out", "run"]
            ended = roboeval("generate", *words, *some, cwd=tmp_path)
        body = server.requests[0].body
    assert ended.status == 0, ended
    assert (body["max_tokens"], body["top_k"], body["top_p"]) == (700, 20, 0.95)
    assert "temperature" not in body
    if name == "roboeval":
        [batch] = json.loads((tmp_path / "run" / "run.json").read_text())["batches"]
        assert (batch["settings"]["temperature"], batch["settings"]["extra_body"]) == (None, {"top_k": 20})


@pytest.mark.parametrize("name", ["generate", "run", "serve"])
def test_each_command_takes_a_limit(name: str) -> None:
    helped = command("codebotler", name, "--help")
    assert all(option in helped.out for option in ("--max-tokens", "--reasoning-effort", "--extra-body"))


@pytest.mark.slow
def test_settings_that_a_model_does_not_take_are_noted(tmp_path: Path) -> None:
    variables = {"OPENAI_API_KEY": "a key of nobody", "OPENAI_BASE_URL": "http://127.0.0.1:9/v1"}
    ended = roboeval("generate", "--model", "openai-chat:o3-mini", cwd=tmp_path, environment=variables)
    assert ended.status == 1
    assert "does not support temperature or top-p" in ended.err
    assert "Warning" not in ended.err
