"""Batch files of requests and answers: the same rows as from `generate`, and none lost."""

import json
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

import pytest

from command_line import Ended, refused, roboeval
from server import Fault, Server

TASKS = ("--tasks", "LunchTime", "--num-completions", "2")
MODEL = "openai-chat:some/model"
URL = "http://127.0.0.1:1/v1"  # Nothing listens there.
COUNT = 10

Row = dict[str, Any]


@pytest.fixture(autouse=True)
def remove_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)


def read_lines(path: Path) -> list[Row]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def write_lines(path: Path, rows: Sequence[Row]) -> Path:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return path


def begin(folder: Path, *more: str, model: str = MODEL, url: str | None = URL) -> list[Row]:
    """Begin a run by writing its requests, and return them."""
    own = () if url is None else ("--base-url", url)
    words = ("--model", model, *own, *TASKS, "--out", "run", "--requests", "requests.jsonl")
    ended = roboeval("generate", *words, *more, cwd=folder)
    assert ended.status == 0, ended
    return read_lines(folder / "requests.jsonl")


def answers(server: Server, requests: Sequence[Row]) -> Iterator[Row]:
    """Yield the answers of a batch endpoint, which a real server gives, in reverse order."""
    for number, request in enumerate(reversed(requests)):
        sent = urllib.request.Request(
            server.url.removesuffix("/v1") + request["url"],
            json.dumps(request["body"]).encode(),
            {"Content-Type": "application/json"},
        )
        try:
            with urllib.request.urlopen(sent) as response:
                status, body = response.status, json.load(response)
        except HTTPError as error:
            status, body = error.code, json.load(error)
        response = {"status_code": status, "request_id": f"r{number}", "body": body}
        yield {"id": f"b{number}", "custom_id": request["custom_id"], "response": response, "error": None}


def answer(request: Row, status: int = 200, **message: object) -> Row:
    """Return an answer in vLLM's format."""
    choice = {"index": 0, "message": {"role": "assistant", **message}, "finish_reason": "stop"}
    body = {"id": "c", "object": "chat.completion", "created": 1, "model": "m", "choices": [choice]}
    return {
        "id": "vllm-1",
        "custom_id": request["custom_id"],
        "response": {"status_code": status, "request_id": "vllm-batch-1", "body": body},
        "error": None,
    }


def without_fields(rows: Sequence[Row], *names: str) -> list[Row]:
    kept = [{name: value for name, value in row.items() if name not in names} for row in rows]
    return sorted(kept, key=lambda row: (row["task"], row["prompt"], row["index"]))


def import_answers(folder: Path, *names: str) -> Ended:
    ended = Ended(0, "", "")
    for name in names:
        ended = roboeval("import", name, "--out", "run", cwd=folder)
    return ended


# --- requests


@pytest.mark.slow
def test_requests_contain_the_settings_and_need_no_key(tmp_path: Path) -> None:
    rows = begin(tmp_path, "--seed", "3", "--max-tokens", "99", "--no-top-p", url=None)
    assert len(rows) == len({row["custom_id"] for row in rows}) == COUNT
    assert {(row["method"], row["url"]) for row in rows} == {("POST", "/v1/chat/completions")}
    body = rows[-1]["body"]
    assert [message["role"] for message in body["messages"]][:3] == ["system", "user", "assistant"]
    assert {name: value for name, value in body.items() if name != "messages"} == {
        "model": "some/model",
        "max_completion_tokens": 99,
        "temperature": 0.2,
        "seed": 4,
    }
    about = json.loads((tmp_path / "run" / "run.json").read_text())
    assert about["settings"]["seed"] == 3
    assert about["batches"][0]["settings"]["base_url"] is None


def test_requests_are_those_that_generate_sends(tmp_path: Path) -> None:
    with Server() as server:
        rows = begin(tmp_path, "--seed", "5", "--extra-body", '{"top_k": 20}', url=server.url)
        more = ("--seed", "5", "--extra-body", '{"top_k": 20}', "--out", "online")
        words = ("generate", "--model", MODEL, "--base-url", server.url, *TASKS, *more)
        assert roboeval(*words, cwd=tmp_path).status == 0
        sent = [request.body for request in server.requests]
    for body in sent:
        assert body.pop("stream")
        del body["stream_options"]
    assert sorted(map(json.dumps, sent)) == sorted(json.dumps(row["body"]) for row in rows)


def test_the_same_command_writes_the_same_bytes_and_no_other_file(tmp_path: Path) -> None:
    begin(tmp_path)
    file = tmp_path / "requests.jsonl"
    before, about = file.read_bytes(), (tmp_path / "run" / "run.json").read_bytes()
    begin(tmp_path)
    assert file.read_bytes() == before
    assert (tmp_path / "run" / "run.json").read_bytes() == about
    file.write_text("mine")
    words = ("generate", "--model", MODEL, "--base-url", URL, *TASKS, "--out", "run")
    assert refused(*words, "--requests", file, cwd=tmp_path).file == str(file)
    assert file.read_text() == "mine"


@pytest.mark.parametrize("model", ["recorded:careful", "anthropic:claude-x", "openai:gpt-5.1", "hf:x"])
def test_other_models_refuse_a_batch_file(tmp_path: Path, model: str) -> None:
    refusal = refused("generate", "--model", model, "--requests", "requests.jsonl", cwd=tmp_path)
    assert "openai-chat:NAME" in refusal.sentence
    assert list(tmp_path.iterdir()) == []


# --- answers


@pytest.mark.parametrize("model", [MODEL, "completions:some/model"])
def test_rows_are_those_of_generate(tmp_path: Path, model: str) -> None:
    with Server() as server:
        server.fault = lambda request: Fault.TOO_LONG if request.body["seed"] == 2 else None
        requests = begin(tmp_path, "--seed", "1", model=model, url=server.url)
        write_lines(tmp_path / "answers.jsonl", [*answers(server, requests)])
        words = ("generate", "--model", model, "--base-url", server.url, *TASKS, "--seed", "1")
        assert roboeval(*words, "--out", "online", cwd=tmp_path).status == 0
    assert import_answers(tmp_path, "answers.jsonl").status == 0
    found, expected = (read_lines(tmp_path / name / "completions.jsonl") for name in ("run", "online"))
    assert without_fields(found, "latency_s", "usage") == without_fields(expected, "latency_s", "usage")
    refusals = [row["index"] for row in found if row["no_program"] == "refusal"]
    assert (len(found), refusals) == (COUNT, [1] * 5)
    used = [row["usage"]["output_tokens"] for row in found if row["index"] == 0]
    assert all(used)
    again = roboeval(*words, "--out", "run", cwd=tmp_path)
    assert f"{COUNT} of {COUNT} completions already exist" in again.err


@pytest.mark.parametrize(
    ("message", "kept"),
    [
        (
            {"content": "def task_program():\n    pass", "reasoning_content": "thought"},
            {"reasoning": "thought", "no_program": None, "program": "def task_program():\n    pass\n"},
        ),
        (
            {
                "content": "```python\ndef task_program():\n    pass\n```",
                "reasoning": "thought",
                **dict.fromkeys(("refusal", "annotations", "audio", "function_call")),
                "tool_calls": [],
            },
            {"reasoning": "thought", "no_program": None, "program": "def task_program():\n    pass\n"},
        ),
        ({"content": None, "refusal": "I cannot."}, {"no_program": "refusal", "raw_reply": "I cannot."}),
        (
            {
                "content": None,
                "tool_calls": [
                    {"id": number, "type": "function", "function": {"name": name, "arguments": '{"a": 1}'}}
                    for number, name in enumerate(("say", "go_to"))
                ],
            },
            {"no_program": "tool-call", "raw_reply": '[tool call] say({"a":1})\n[tool call] go_to({"a":1})'},
        ),
        ({"content": ""}, {"no_program": "empty", "program": ""}),
    ],
)
def test_replies_of_each_kind(tmp_path: Path, message: Row, kept: Row) -> None:
    first, *_ = begin(tmp_path)
    write_lines(tmp_path / "answers.jsonl", [answer(first, **message)])
    assert import_answers(tmp_path, "answers.jsonl").status == 1
    (row,) = read_lines(tmp_path / "run" / "completions.jsonl")
    assert row.items() >= kept.items()
    assert row["latency_s"] is None


def test_importing_a_file_twice_changes_nothing_and_several_files_add_up(tmp_path: Path) -> None:
    requests = begin(tmp_path)
    whole = [answer(request, content="def task_program():\n    pass") for request in requests]
    write_lines(tmp_path / "a.jsonl", whole[:4])
    write_lines(tmp_path / "b.jsonl", whole[2:])
    run = tmp_path / "run"
    assert import_answers(tmp_path, "a.jsonl").status == 1
    before = {name: (run / name).read_bytes() for name in ("completions.jsonl", "run.json")}
    assert import_answers(tmp_path, "a.jsonl").status == 1
    assert {name: (run / name).read_bytes() for name in before} == before
    assert len(begin(tmp_path)) == COUNT - 4
    ended = import_answers(tmp_path, "b.jsonl")
    assert (ended.status, ended.err.count("\n")) == (0, 1)
    rows = read_lines(run / "completions.jsonl")
    assert len({(row["prompt"], row["index"]) for row in rows}) == len(rows) == COUNT
    after = {name: (run / name).stat().st_mtime_ns for name in before}
    assert import_answers(tmp_path, "a.jsonl", "b.jsonl").status == 0
    assert {name: (run / name).stat().st_mtime_ns for name in before} == after


def test_the_order_of_answers_makes_no_difference(tmp_path: Path) -> None:
    requests = begin(tmp_path)
    whole = [answer(request, content=str(number)) for number, request in enumerate(requests)]
    write_lines(tmp_path / "answers.jsonl", whole[::-1])
    assert import_answers(tmp_path, "answers.jsonl").status == 0
    assert [row["raw_reply"] for row in read_lines(tmp_path / "run" / "completions.jsonl")] == [
        str(number) for number in range(COUNT)
    ]


def test_failed_and_missing_answers_are_named_and_requested_again(tmp_path: Path) -> None:
    one, two, three, four, *others = begin(tmp_path)
    expired = {"code": "batch_expired", "message": "This request expired."}
    vllm = {"error": {"message": "The prompt is too long.", "type": "BadRequestError", "code": 400}}
    rows = [
        {"id": "1", "custom_id": one["custom_id"], "response": None, "error": expired},
        answer(two, 500) | {"response": {"status_code": 500, "body": {"error": {"message": "It died."}}}},
        answer(three) | {"response": {"status_code": 400, "body": None}, "error": vllm},
        *(answer(request, content="pass") for request in others),
    ]
    write_lines(tmp_path / "answers.jsonl", rows)
    ended = import_answers(tmp_path, "answers.jsonl")
    assert ended.status == 1
    assert "3 completions missing: " in ended.err
    assert "This request expired" in ended.err
    kept = {row["raw_reply"]: row["no_program"] for row in read_lines(tmp_path / "run" / "completions.jsonl")}
    assert len(kept) == 2
    assert [why for text, why in kept.items() if "The prompt is too long" in text] == ["refusal"]
    again = begin(tmp_path)
    assert {row["custom_id"] for row in again} == {row["custom_id"] for row in (one, two, four)}


def test_refusals_of_all_requests_are_failures(tmp_path: Path) -> None:
    requests = begin(tmp_path)
    refusal = {"status_code": 400, "body": {"error": {"message": "There is no such field."}}}
    write_lines(tmp_path / "answers.jsonl", [answer(one) | {"response": refusal} for one in requests])
    ended = import_answers(tmp_path, "answers.jsonl")
    assert ended.status == 1
    assert "10 completions missing: " in ended.err
    assert (tmp_path / "run" / "completions.jsonl").read_bytes() == b""


def change(row: Row, **values: object) -> Row:
    return {**row, **values}


@pytest.mark.parametrize(
    ("spoilt", "named"),
    [
        (lambda row: change(row, custom_id="LunchTime/0/0/00000000"), "another run"),
        (lambda row: change(row, custom_id="mine"), "'mine'"),
        (lambda row: {"custom_id": row["custom_id"], "method": "POST"}, "not an answer"),
        (lambda row: {"custom_id": row["custom_id"]}, "not an answer"),
    ],
)
def test_a_line_that_is_not_an_answer_of_the_run_adds_nothing(
    tmp_path: Path, spoilt: Callable[[Row], Row], named: str
) -> None:
    first, second, *_ = begin(tmp_path)
    write_lines(tmp_path / "answers.jsonl", [answer(first, content="a"), spoilt(answer(second, content="b"))])
    refusal = refused("import", "answers.jsonl", "--out", "run", cwd=tmp_path)
    assert refusal.at == ("answers.jsonl", 2)
    assert named in refusal.sentence
    assert (tmp_path / "run" / "completions.jsonl").read_bytes() == b""


def test_answers_to_other_settings_are_refused(tmp_path: Path) -> None:
    (tmp_path / "hotter").mkdir()
    request, *_ = begin(tmp_path / "hotter", "--temperature", "1")
    begin(tmp_path)
    write_lines(tmp_path / "answers.jsonl", [answer(request, content="a")])
    assert "other settings" in refused("import", "answers.jsonl", "--out", "run", cwd=tmp_path).sentence


def test_a_truncated_file_adds_nothing(tmp_path: Path) -> None:
    first, second, *_ = begin(tmp_path)
    file = write_lines(tmp_path / "answers.jsonl", [answer(first, content="a"), answer(second, content="b")])
    file.write_bytes(file.read_bytes()[:-40])
    assert refused("import", "answers.jsonl", "--out", "run", cwd=tmp_path).at == ("answers.jsonl", 2)
    assert (tmp_path / "run" / "completions.jsonl").read_bytes() == b""


@pytest.mark.slow
def test_answers_need_their_run_and_its_suite(tmp_path: Path) -> None:
    first, *_ = begin(tmp_path)
    write_lines(tmp_path / "answers.jsonl", [answer(first, content="a")])
    assert "--requests" in refused("import", "answers.jsonl", "--out", "other", cwd=tmp_path).sentence
    assert not (tmp_path / "other").exists()
    refusal = refused("import", "answers.jsonl", "--out", "run", "--suite", "plus", cwd=tmp_path)
    assert '"paper"' in refusal.sentence


def test_a_batch_can_have_fresh_tasks(tmp_path: Path) -> None:
    suite = ("--suite", "families-test-7-2")
    model = ("--model", MODEL, "--base-url", URL, "--num-completions", "1")
    ended = roboeval("generate", *suite, *model, "--requests", "requests.jsonl", cwd=tmp_path)
    assert ended.status == 0
    (run,) = (tmp_path / "runs").iterdir()
    requests = read_lines(tmp_path / "requests.jsonl")
    write_lines(tmp_path / "answers.jsonl", [answer(request, content="pass") for request in requests])
    assert roboeval("import", "answers.jsonl", "--out", run, *suite, cwd=tmp_path).status == 0
    assert len(read_lines(run / "completions.jsonl")) == len(requests) == 8
