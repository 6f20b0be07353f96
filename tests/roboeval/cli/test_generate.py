"""The commands generate, run and resample."""

import json
import re
import shutil
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

from codebotler.core.files import read_rows
from codebotler.models.recorded import RECORDED_NOTICE
from command_line import ENVIRONMENT, refused, roboeval
from forked import Forked
from seals import unseal
from server import Fault, Request, Server

KEY = "sk-verysecret0123456789abcdefghijkl"
WITH_KEY = {**ENVIRONMENT, "OPENAI_API_KEY": KEY}
TASKS = "LunchTime,SayGoodDay"


def keys(run: Path) -> list[tuple[str, int, int]]:
    rows = [json.loads(line) for line in (run / "completions.jsonl").read_text().splitlines()]
    return [(row["task"], row["prompt"], row["index"]) for row in rows]


def generate_words(url: str, *more: str, model: str = "completions:tiny", tasks: str = TASKS) -> list[str]:
    options = ["--model", model, "--base-url", url, "--tasks", tasks, "--out", "run", *more]
    return ["generate", *options]


# --- with a recorded model


@pytest.mark.slow
def test_run_makes_tables_and_a_report(tmp_path: Path) -> None:
    words = ["run", "--model", "recorded:hasty", "--num-completions", "3", "--tasks", TASKS]
    ended = roboeval(*words, cwd=tmp_path)
    assert ended.status == 0
    assert "runs/recorded-hasty (programs written by hand)" in ended.out
    assert re.search(r"pass@1 over all prompts: 0\.\d{3} \(95% interval over tasks .*\)\n", ended.out)
    assert "\n30 of 30 completions, 10 prompts of 2 tasks\n" in ended.out
    run = tmp_path / "runs" / "recorded-hasty"
    assert len(set(keys(run))) == 30
    assert (run / "evaluations" / "paper.jsonl").read_bytes().count(b"\n") == 30
    assert ended.err.endswith("the report is in runs/recorded-hasty/report/index.html\n")
    text = (run / "report" / "index.html").read_text()
    assert "roboeval report runs/recorded-hasty --out runs/recorded-hasty/report" in text
    shutil.rmtree(run / "report")
    again = roboeval(*words, "--no-report", cwd=tmp_path)
    assert (again.status, again.out) == (0, ended.out)
    assert "30 of 30 completions" in again.err
    assert not (run / "report").exists()


@pytest.mark.slow
def test_an_interrupted_report_keeps_its_checks(tmp_path: Path) -> None:
    words = ["run", "--model", "recorded:hasty", "--num-completions", "4", "--out", "run", "--workers", "1"]
    words += ["--tasks", "LunchBreak,LunchTime,SayGoodDay,StaplerSupply"]
    process = Forked("roboeval", *words, cwd=tmp_path, environment=ENVIRONMENT)
    checks = tmp_path / "run" / "checks" / "paper.jsonl"
    while process.poll() is None and not (checks.exists() and checks.stat().st_size):
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    last = err.splitlines()[-1]
    assert last.startswith("roboeval: stopped; the same command continues")
    assert not (tmp_path / "run" / "report").exists()
    kept = checks.read_bytes()
    assert roboeval("resample", "run", cwd=tmp_path).status == 0
    assert checks.read_bytes().startswith(kept[: kept.rfind(b"\n") + 1])
    assert roboeval("show", "run", cwd=tmp_path).status == 0


def test_further_tasks_are_added_to_a_run(tmp_path: Path) -> None:
    words = ["run", "--num-completions", "2", "--no-report", "--out", "run"]
    assert roboeval(*words, "--tasks", "LunchTime", cwd=tmp_path).status == 0
    rows, verdicts = tmp_path / "run" / "completions.jsonl", tmp_path / "run" / "evaluations" / "paper.jsonl"
    before = rows.read_bytes(), verdicts.read_bytes()
    ended = roboeval(*words, "--tasks", TASKS, cwd=tmp_path)
    assert ended.status == 0
    assert "10 of 20 completions" in ended.err
    assert rows.read_bytes().startswith(before[0])
    assert verdicts.read_bytes().startswith(before[1])
    assert verdicts.read_bytes().count(b"\n") == rows.read_bytes().count(b"\n") == 20
    kept = rows.read_bytes(), verdicts.read_bytes(), (tmp_path / "run" / "run.json").read_bytes()
    one = roboeval(*words, "--tasks", "SayGoodDay", "--num-completions", "1", cwd=tmp_path)
    assert one.status == 0
    assert "LunchTime" not in one.out
    assert kept == (rows.read_bytes(), verdicts.read_bytes(), (tmp_path / "run" / "run.json").read_bytes())


def test_tasks_of_an_interrupted_batch_are_missing(tmp_path: Path) -> None:
    words = ["run", "--num-completions", "2", "--no-report", "--out", "run"]
    assert roboeval(*words, "--tasks", "LunchTime", cwd=tmp_path).status == 0
    about = tmp_path / "run" / "run.json"
    data = json.loads(about.read_text())
    data["batches"].append({"tasks": ["LunchTime", "SayGoodDay"], "num_completions": 2})  # It was stopped.
    about.write_text(json.dumps(data))
    shown = json.loads(roboeval("show", "run", "--json", cwd=tmp_path).out)
    assert (shown["judged"], shown["to_judge"], shown["requested"]) == (10, 10, 20)


def test_a_run_that_cannot_be_judged_is_refused_before_any_request(tmp_path: Path) -> None:
    words = ["run", "--no-report", "--out", "run", "--tasks", "LunchTime", "--num-completions"]
    assert roboeval(*words, "1", cwd=tmp_path).status == 0
    head = tmp_path / "run" / "evaluations" / "paper.json"
    head.write_text(json.dumps(json.loads(head.read_text()) | {"digest": "0" * 64}))
    kept = {path: path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()}
    assert "--redo" in refused(*words, "2", cwd=tmp_path).sentence
    assert kept == {path: path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()}


# --- further rounds


LOST = "```python\ndef task_program():\n    go_to('the moon')\n```\n"
GREETS = "```python\ndef task_program():\n    say('good day')\n```\n"


def answer_repairs(request: Request) -> str:
    """Go to a wrong room first, and greet in a repair or a further round."""
    is_repair = any("the moon" in message["content"] for message in request.body["messages"])
    return GREETS if is_repair or request.body.get("seed", 0) > 1000 else LOST


@pytest.mark.parametrize("option", ["repair", "retries"])
def test_rejected_programs_are_requested_again_in_rounds(option: str, tmp_path: Path) -> None:
    with Server(answer=answer_repairs) as server:
        words = ["run", "--model", "openai:m", "--base-url", server.url, "--tasks", "SayGoodDay"]
        words += ["--seed", "0", "--num-completions", "1", "--out", "run", "--no-report", f"--{option}", "2"]
        ended = roboeval(*words, cwd=tmp_path)
        assert ended.status == 0, ended
        assert len(server.requests) == 10
        folder = tmp_path / "run" / ("repair-1" if option == "repair" else "retry-1")
        assert len([*read_rows(folder / "completions.jsonl")]) == 5
        assert ended.out.count("5 completions, 5 prompts of 1 task") == 2  # Both rounds have five.
        assert "round 1: the check rejects 5 completions of 5" in ended.err
        assert roboeval(*words, cwd=tmp_path).out == ended.out
        assert len(server.requests) == 10  # Nothing is paid for twice.


def test_generate_names_the_folder_and_the_next_command(tmp_path: Path) -> None:
    ended = roboeval("generate", "--tasks", "LunchTime", "--num-completions", "1", cwd=tmp_path)
    assert (ended.status, ended.out) == (0, "")
    assert ended.err.splitlines()[0] == RECORDED_NOTICE
    assert ended.err.count("\n") == 2
    assert " runs/recorded-careful; " in ended.err
    assert "`roboeval evaluate runs/recorded-careful`" in ended.err
    assert sorted(path.name for path in (tmp_path / "runs" / "recorded-careful").iterdir()) == [
        ".lock",
        "completions.jsonl",
        "run.json",
    ]


def test_another_model_is_refused(tmp_path: Path) -> None:
    assert roboeval("generate", "--num-completions", "1", cwd=tmp_path).status == 0
    about = tmp_path / "runs/recorded-careful/run.json"
    before = about.read_bytes()
    hasty = ("--model", "recorded:hasty", "--out", "runs/recorded-careful")
    refusal = refused("generate", "--num-completions", "2", *hasty, cwd=tmp_path)
    assert refusal.at == ("runs/recorded-careful/run.json", None)
    assert "(recorded:careful, now recorded:hasty)" in refusal.sentence
    assert about.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--model", "nonsense"), ['"nonsense"', "recorded, "]),
        (("--tasks", "Nonsense"), ['"paper"', '"Nonsense"', "CountSavory"]),
        (("--temperature", "-1"), ["temperature", "-1", "0 to 100"]),
        (("--num-completions", "0"), ["invalid value", "'--num-completions'"]),
        (("--concurrency", "0"), ["invalid value", "'--concurrency'"]),
        (("--out", ""), ["empty", "a run"]),
        (("--base-url", "http://me:secret@localhost/v1"), ["base URL", "password"]),
    ],
)
def test_wrong_options_are_refused_and_leave_no_files(
    tmp_path: Path, words: tuple[str, ...], named: list[str]
) -> None:
    refusal = refused("generate", *words, cwd=tmp_path)
    assert all(name in refusal.sentence for name in named), refusal
    assert "secret" not in refusal.sentence
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["generate", "run"])
def test_at_most_10000_completions_of_a_prompt(tmp_path: Path, command: str) -> None:
    words = (command, "--model", "recorded:nobody", "--num-completions")  # The model is not asked.
    refusal = refused(*words, "10001", cwd=tmp_path)
    assert "'--num-completions'" in refusal.sentence
    assert "10000" in refusal.sentence
    assert '"recorded:nobody"' in refused(*words, "10000", cwd=tmp_path).sentence
    assert list(tmp_path.iterdir()) == []


def test_a_suite_without_recorded_programs_is_refused(tmp_path: Path) -> None:
    roboeval("tasks", "--new", "MakeTea", "--suite", "mine", cwd=tmp_path)
    assert "recorded:careful" in refused("generate", "--suite", "mine", cwd=tmp_path, lines=5).sentence
    assert not (tmp_path / "runs").exists()


# --- with a model server


@pytest.mark.slow
def test_a_wrong_key_is_refused_and_shown_nowhere(tmp_path: Path) -> None:
    with Server(fault=lambda _: Fault.UNAUTHORIZED) as server:
        for model in ("completions:tiny", "openai:tiny"):
            ended = roboeval(*generate_words(server.url, model=model), cwd=tmp_path, environment=WITH_KEY)
            assert ended.status == 2
            assert ended.err.count("\n") == 1
            assert "401" in ended.err
            assert KEY not in ended.err
    assert any(KEY in request.headers["authorization"] for request in server.requests)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("model", ["completions:tiny", "openai:tiny", "vllm:tiny"])
@pytest.mark.parametrize("key", ["sk-one\nsk-two", "sk-schl\u00fcssel"])
def test_a_key_that_cannot_be_sent_is_refused(tmp_path: Path, model: str, key: str) -> None:
    variable = "VLLM_API_KEY" if model.startswith("vllm") else "OPENAI_API_KEY"
    with Server() as server:
        ended = roboeval(
            *generate_words(server.url, model=model), cwd=tmp_path, environment={**ENVIRONMENT, variable: key}
        )
    assert (ended.status, ended.out) == (2, "")
    assert ended.err.startswith(f"roboeval: the key in {variable} has ")
    assert ended.err.count("\n") == 1
    assert "sk-" not in ended.err
    assert server.requests == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("model", ["completions:tiny", "openai:tiny"])
def test_the_key_is_in_no_file_of_a_run(tmp_path: Path, model: str) -> None:
    replies = ["hello", f"Your key is {KEY}.\n\n```python\ndef task_program():\n    say('{KEY}')\n```\n"]
    faults = [Fault.UNAUTHORIZED, Fault.SERVER_ERROR, Fault.CUT, Fault.INVALID_JSON, Fault.WRONG_TYPE]
    with Server(answer=lambda request: replies[int(request.body.get("seed", 0)) % 2]) as server:
        server.faults.extend([None, *faults])
        ended = roboeval(
            *generate_words(server.url, "--num-completions", "2", "--seed", "0", model=model),
            cwd=tmp_path,
            environment=WITH_KEY,
        )
    assert ended.status == 1  # The unauthorised request is not repeated.
    assert "1 completion " in ended.err
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(keys(tmp_path / "run")) == 19
    assert len(files) >= 3
    for text in (ended.out, ended.err, *(path.read_text() for path in files)):
        assert KEY not in text
        assert KEY[3:] not in text


def test_a_run_continues_after_a_token_budget(tmp_path: Path) -> None:
    with Server() as server:
        words = generate_words(server.url, "--num-completions", "2", "--concurrency", "1")
        ended = roboeval(*words, "--token-budget", "5000", cwd=tmp_path)
        assert ended.status == 1
        assert ended.out == ""
        assert re.fullmatch(r"roboeval: \d+ completions .*\btoken budget of 5,000\b.*\n", ended.err)
        before = keys(tmp_path / "run")
        assert 0 < len(before) < 20
        ended = roboeval(*words, cwd=tmp_path)
        assert ended.status == 0
        assert f"{len(before)} of 20 completions" in ended.err
    assert len(server.requests) == len(set(keys(tmp_path / "run"))) == 20


@pytest.mark.slow
def test_kill_minus_nine_loses_only_pending_requests(tmp_path: Path) -> None:
    times, lost = 3, 0
    with Server(delay=0.1, fault=lambda _: Fault.SLOW) as server:
        words = generate_words(server.url, "--num-completions", "20", "--concurrency", "4", "--seed", "0")
        for kill in range(times):
            with Forked("roboeval", *words, cwd=tmp_path, environment=ENVIRONMENT) as process:
                while len(server.requests) < 15 * (kill + 1) + 4 * kill and process.poll() is None:
                    time.sleep(0.005)
                time.sleep(0.03 * kill)
                process.send_signal(signal.SIGKILL)
            rows = (tmp_path / "run" / "completions.jsonl").read_bytes().count(b"\n")
            under_way = len(server.requests) - lost - rows
            assert 0 <= under_way <= 4
            lost += under_way
        ended = roboeval(*words, cwd=tmp_path)
    assert ended.status == 0
    assert Counter(keys(tmp_path / "run")).most_common(1)[0][1] == 1
    assert len(keys(tmp_path / "run")) == 200
    assert re.search(r"^[1-4] pending requests? ", ended.err, re.MULTILINE)
    twice = json.loads((tmp_path / "run" / "run.json").read_text())["possibly_paid_twice"]
    assert len(server.requests) - 200 == lost
    assert lost <= twice <= lost + times  # A noted request need not have arrived.


@pytest.mark.slow
def test_ctrl_c_says_how_to_continue(tmp_path: Path) -> None:
    with Server(delay=0.1, fault=lambda _: Fault.SLOW) as server:
        words = generate_words(server.url, "--concurrency", "4")
        process = Forked("roboeval", *words, cwd=tmp_path, environment=ENVIRONMENT)
        while len(server.requests) < 10 and process.poll() is None:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert process.returncode == 130
    assert re.fullmatch(r"roboeval: stopped; the same command .*\n", err), err
    assert 0 < len(keys(tmp_path / "run")) < 500


@pytest.mark.slow
def test_a_run_completes_if_one_request_in_ten_fails(tmp_path: Path) -> None:
    faults = [
        Fault.SERVER_ERROR,
        Fault.TOO_MANY,
        Fault.CUT,
        Fault.INVALID_JSON,
        Fault.HUNG_UP,
        Fault.WRONG_TYPE,
    ]
    for model in ("completions:tiny", "openai:tiny"):
        with Server() as server:
            server.faults.extend(fault for bad in faults for fault in [*[None] * 9, bad])
            words = generate_words(server.url, "--num-completions", "8", model=model)
            words[words.index("run")] = model.partition(":")[0]
            ended = roboeval(*words, cwd=tmp_path)
        run = tmp_path / model.partition(":")[0]
        assert ended.status == 0, ended.err
        assert len(keys(run)) == len(set(keys(run))) == 80
        assert len(server.requests) == 80 + len(faults)
        assert json.loads((run / "run.json").read_text())["possibly_paid_twice"] == 0


# --- resampling


@pytest.mark.slow
def test_resampling_checks_once_and_prints_both_figures(tmp_path: Path) -> None:
    words = ["run", "--model", "recorded:hasty", "--num-completions", "3", "--tasks", TASKS, "--out", "run"]
    assert roboeval(*words, cwd=tmp_path).status == 0
    table = roboeval("resample", "run", cwd=tmp_path)
    assert table.status == 0
    lines = [line.split() for line in table.out.splitlines() if re.match(r" +\d+ ", line)]
    assert [line[0] for line in lines] == ["0", "2", "4", "8", "100"]
    data = json.loads(roboeval("resample", "run", "--json", cwd=tmp_path).out)
    assert [f"{limit['pass@1']['mean']:.3f}" for limit in data["limits"]] == [line[1] for line in lines]
    evaluated = json.loads(roboeval("show", "run", "--json", cwd=tmp_path).out)
    assert data["limits"][0]["pass@1"] == evaluated["pass@1"]
    assert data["limits"][-1]["accepted"] > data["limits"][0]["accepted"]
    checks = tmp_path / "run" / "checks" / "paper.jsonl"
    whole = checks.read_bytes()
    assert 1 < whole.count(b"\n") <= 30
    checks.write_bytes(whole[:-20])
    assert json.loads(roboeval("resample", "run", "--json", cwd=tmp_path).out) == data
    assert checks.read_bytes() == whole
    lies = [{**json.loads(line), "problems": []} for line in whole.splitlines()]
    checks.write_text("".join(json.dumps(line) + "\n" for line in lies))
    trusting = json.loads(roboeval("resample", "run", "--json", cwd=tmp_path).out)
    assert trusting["limits"][0]["accepted"] == 1  # Stored results are not checked again.
    manifest = checks.with_suffix(".json")
    manifest.write_text(json.dumps({**json.loads(manifest.read_text()), "codebotler": "0.0.1"}))
    assert json.loads(roboeval("resample", "run", "--json", cwd=tmp_path).out) == data  # It checks again.
    assert roboeval("resample", "run", "--retries", "1", cwd=tmp_path).out.count("%") == 6


def test_resampling_needs_a_judged_run(tmp_path: Path) -> None:
    roboeval("generate", "--num-completions", "1", "--tasks", "LunchTime", "--out", "run", cwd=tmp_path)
    refusal = refused("resample", "run", cwd=tmp_path)
    assert refusal.at == ("run", None)
    assert refusal.commands == ["roboeval evaluate run"]
    refusal = refused("resample", "nothing", cwd=tmp_path)
    assert refusal.at == ("nothing", None)
    assert "completions.jsonl" in refusal.sentence


@pytest.mark.slow
def test_resampling_counts_only_judged_and_unchanged_programs(tmp_path: Path) -> None:
    words = ["generate", "--model", "recorded:hasty", "--num-completions", "2", "--tasks", TASKS]
    assert roboeval(*words, "--out", "run", cwd=tmp_path).status == 0
    assert roboeval("evaluate", "run", "--tasks", "LunchTime", cwd=tmp_path).status == 0
    data = json.loads(roboeval("resample", "run", "--json", cwd=tmp_path).out)
    assert [prompt["task"] for prompt in data["prompts"]] == ["LunchTime"] * 5
    checked = (tmp_path / "run" / "checks" / "paper.jsonl").read_text()
    assert "SayGoodDay" not in checked
    rows = tmp_path / "run" / "evaluations" / "paper.jsonl"
    rows.write_bytes(b"".join(rows.read_bytes().splitlines(keepends=True)[:4]))
    unseal(tmp_path / "run")
    ended = roboeval("resample", "run", "--json", cwd=tmp_path)
    assert ended.err.startswith("only judged completions count: 4 of 20 completions ")
    assert "`roboeval evaluate run --tasks LunchTime,SayGoodDay`" in ended.err
    assert sum(prompt["completions"] for prompt in json.loads(ended.out)["prompts"]) == 4
    completions = tmp_path / "run" / "completions.jsonl"
    changed = [json.loads(line) for line in completions.read_text().splitlines()]
    changed = [row | {"program": row["program"] + "#"} for row in changed]
    completions.write_text("".join(json.dumps(row) + "\n" for row in changed))
    refusal = refused("resample", "run", cwd=tmp_path)
    assert refusal.at == ("run/evaluations/paper.jsonl", 1)
    assert "--redo" in refusal.sentence
