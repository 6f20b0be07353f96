"""Keys come from the environment, and go to the server and nowhere else."""

import io
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest

from codebotler.models.keys import KEY_REMOVED, MIN_SECRET_IN_ERRORS, guard_logs, redact, remove_keys
from server import Fault, Server

KEY = "sk-Fake0123456789abcdefGHIJ"
UNUSUAL = 'Fake/odd+key="0123456789"&x'  # No part of it has the usual shape of a key.
RUN = """
import asyncio, dataclasses, json, logging, sys, traceback
from pathlib import Path

logging.basicConfig(level=logging.DEBUG, stream=sys.stderr)
logging.getLogger().addHandler(logging.FileHandler("log.txt"))
from codebotler.models.base import ModelError
from codebotler.models.sampling import SamplingSettings
from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import prompt_for

async def main(url):
    with Path("completions.jsonl").open("w") as rows:
        for name in ("openai:m", "completions:m", "vllm:m"):
            settings = SamplingSettings(base_url=url)
            model = RateLimited(open_model(name, settings), first_wait=0.01)
            print(model, repr(model.model), settings)
            for number in range(4):
                try:
                    reply = await model.reply(prompt_for("Go to the lobby."), number=number)
                except ModelError as error:
                    print(repr(error), error, vars(error), file=sys.stderr)
                    traceback.print_exc()
                    logging.exception("no reply")
                    rows.write(json.dumps({"error": error.sentence}) + "\\n")
                else:
                    rows.write(json.dumps(dataclasses.asdict(reply)) + "\\n")
            await model.close()

asyncio.run(main(sys.argv[1]), debug=True)
"""


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as served:
        yield served


@pytest.mark.slow
@pytest.mark.parametrize("key", [KEY, UNUSUAL])
def test_key_is_never_printed_logged_or_written(tmp_path: Path, server: Server, key: str) -> None:
    server.faults.extend([Fault.UNAUTHORIZED, None, Fault.SERVER_ERROR, None, Fault.CUT, None] * 3)
    server.answer = lambda request: f"    say('{request.headers['authorization']}')\n"
    environment = {**os.environ, "OPENAI_API_KEY": key, "VLLM_API_KEY": key, "OPENAI_LOG": "debug"}
    done = subprocess.run(
        [sys.executable, "-c", RUN, server.url],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    sent = {request.headers["authorization"] for request in server.requests}
    assert sent == {f"Bearer {key}"}  # Every answer of the server repeats it.
    everything = {path.name: path.read_text() for path in tmp_path.rglob("*") if path.is_file()}
    rows = [json.loads(line) for line in everything["completions.jsonl"].splitlines()]
    everything |= {"output": done.stdout, "errors": done.stderr}
    assert len(rows) == 12
    for where, text in everything.items():
        assert key not in text, where
        assert json.dumps(key)[1:-1] not in text, where
        assert repr(key)[1:-1] not in text, where
        assert (KEY_REMOVED in text) == (where != "output"), where
    assert "status 401" in done.stderr
    assert "x-echo" in everything["log.txt"].lower()


def test_values_of_all_variables_that_hold_keys_are_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (
        "ANTHROPIC_API_KEY",
        "HF_TOKEN",
        "my_secret",
        "DB_PASSWORD",
        "GOOGLE_APPLICATION_CREDENTIALS",
    ):
        monkeypatch.setenv(name, f"value-of-{name}")
        assert redact(f"a value-of-{name} b") == f"a {KEY_REMOVED} b"
    monkeypatch.setenv("HARMLESS", "value-of-it")
    assert redact("a value-of-it b") == "a value-of-it b"


def test_key_within_another_one_leaves_no_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("A_KEY", "abcdefgh")
    monkeypatch.setenv("B_KEY", "abcdefgh-ijklmnop")
    assert redact("it is abcdefgh-ijklmnop.") == f"it is {KEY_REMOVED}."


@pytest.mark.parametrize(
    "spelling", [UNUSUAL, json.dumps(UNUSUAL)[1:-1], repr(f"'{UNUSUAL}")[3:-1], quote(UNUSUAL, safe="")]
)
def test_key_is_removed_however_it_is_spelt(monkeypatch: pytest.MonkeyPatch, spelling: str) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", UNUSUAL)
    assert redact(f"a {spelling} b") == f"a {KEY_REMOVED} b"


def test_text_shorter_than_any_key_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KEYBOARD", "decide"[: MIN_SECRET_IN_ERRORS - 1])
    monkeypatch.setenv("EMPTY_KEY", "")
    assert redact("decide") == "decide"


@pytest.mark.parametrize("key", ["secret", "abc", "key", "removed"])
def test_short_key_is_kept_out_of_errors_and_logs_but_not_of_programs(
    monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", key)
    monkeypatch.setenv("OTHER_API_KEY", "a-long-one")
    sentence = "Incorrect: {}, a-long-one, sk-0123456789."
    assert redact(sentence.format(key)) == f"Incorrect: {KEY_REMOVED}, {KEY_REMOVED}, {KEY_REMOVED}"
    program = f"say('{key}')"
    assert remove_keys(program) == program


@pytest.mark.parametrize(
    "program",
    [
        "pk_location_name = get_current_location()",
        "for hf_rooms_to_visit in get_all_rooms(): pass",
        "say('sk-abcdefghijkl')",
        "say('Bearer of good news')",
    ],
)
def test_program_keeps_names_that_look_like_keys(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    assert remove_keys(program) == program


@pytest.mark.parametrize(
    "spelling", [UNUSUAL, json.dumps(UNUSUAL)[1:-1], repr(f"'{UNUSUAL}")[3:-1], quote(UNUSUAL, safe="")]
)
def test_program_loses_the_key_itself(monkeypatch: pytest.MonkeyPatch, spelling: str) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", UNUSUAL)
    monkeypatch.setenv("OTHER_API_KEY", UNUSUAL[:-3])
    assert remove_keys(f"say('{spelling}')") == f"say('{KEY_REMOVED}')"


@pytest.mark.parametrize(
    "key",
    [
        "sk-abcdefghijkl",
        "sk-proj-ab_cd-efgh1234",
        "sk-ab*******wxyz",
        "hf_abcdefghijklm",
        "AIzaSyA" + "b" * 30,
    ],
)
def test_text_in_the_shape_of_a_key_is_removed(key: str) -> None:
    assert redact(f"Incorrect API key provided: {key}, sorry") == (
        f"Incorrect API key provided: {KEY_REMOVED}, sorry"
    )


@pytest.mark.parametrize(
    "text", ["say('sk-8')", "risk-averse people", "pick('hf_x')", "task-program", "a desk-lamp-with-shade"]
)
def test_words_of_programs_do_not_look_like_keys(text: str) -> None:
    assert redact(text) == text


def test_logs_of_clients_keep_all_but_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    logger = logging.getLogger("httpcore2.test")
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        guard_logs()
        logger.debug("headers %r of %s", [("Authorization", KEY)], "it")
        try:
            float(KEY)
        except ValueError:
            logger.exception("failed")
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)
    text = stream.getvalue()
    assert f"headers [('Authorization', '{KEY_REMOVED}')] of it\n" in text
    assert f"ValueError: could not convert string to float: '{KEY_REMOVED}'" in text
    assert KEY not in text


@pytest.mark.parametrize(
    ("name", "holds_a_key"),
    [
        ("OPENAI_API_KEY", True),
        ("MYAPIKEY", True),
        ("HF_TOKEN", True),
        ("AWS_SECRET_ACCESS_KEY", True),
        ("DB_PASSWORD_2", True),
        ("TOKENIZERS_PARALLELISM", False),
        ("KEYBOARD_LAYOUT", False),
    ],
)
def test_names_of_variables_that_hold_keys(
    monkeypatch: pytest.MonkeyPatch, name: str, *, holds_a_key: bool
) -> None:
    monkeypatch.setenv(name, "kitchen table")
    assert (redact("at the kitchen table") == "at the [key removed]") is holds_a_key
