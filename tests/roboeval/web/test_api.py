"""Runs over HTTP: the numbers of `roboeval show`, and refusals in words."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from starlette.types import Message, Receive, Scope, Send

from codebotler.core.files import read_rows, to_line
from codebotler.web.security.access import Access, PageAddress
from codebotler.web.security.guard import Guard
from command_line import refused, roboeval
from made_up_runs import new_run
from pageserver import PageServer
from roboeval.evaluation.runs.completions import KEY, Completion
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.report.sections.scores import results_section
from roboeval.report.sheets import Section, Sheet
from roboeval.report.writing import write_report
from runs_server import serve_runs
from seals import unseal

HOSTILE = "<script>window.owned=1</script>[x](javascript:owned)\u202e\ud800\x00'\"&"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, hasty: Path) -> Path:
    folder = tmp_path_factory.mktemp("served") / "runs"
    shutil.copytree(hasty, folder / "hasty")
    odd = folder / "a <b>&? #%2F ü"
    shutil.copytree(hasty, odd)
    return folder


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[PageServer]:
    with serve_runs(folder) as server:
        yield server


def read_json(server: PageServer, path: str) -> Any:  # noqa: ANN401 - JSON has no types
    answer = server.call("GET", path)
    assert answer.status == 200, answer.text
    return answer.data


def test_all_runs_are_listed(server: PageServer) -> None:
    runs = read_json(server, "/api/runs")
    assert [run["run"] for run in runs] == ["a <b>&? #%2F ü", "hasty"]
    hasty = runs[1]
    assert hasty["state"] == "judged"
    assert {hasty[name] for name in ("completions", "requested", "to_judge", "judged")} == {45}
    assert (hasty["tasks_there"], hasty["tasks_of_suite"], hasty["cut_off"]) == (3, 16, 0)
    assert datetime.fromisoformat(hasty["date"]).year >= 2026
    assert hasty["settings"] == ""
    assert hasty["pass@1"]["over"] == "tasks"
    assert (hasty["models"], hasty["by_hand"]) == (["recorded:hasty"], True)
    assert (hasty["suite"], hasty["evaluations"], hasty["notes"]) == ("paper", ["paper"], [])


def test_one_run_has_the_numbers_of_show(server: PageServer, folder: Path) -> None:
    shown = json.loads(roboeval("show", folder / "hasty", "--json").out)
    run = read_json(server, "/api/runs/hasty")
    assert run["pass@1"] == pytest.approx(shown["pass@1"])
    assert (run["judged"], run["passed"]) == (shown["completions"], shown["passed"])
    assert [task["task"] for task in run["tasks"]] == [task["task"] for task in shown["tasks"]]
    for ours, theirs in zip(run["tasks"], shown["tasks"], strict=True):
        assert ours["pass@1"] == pytest.approx(theirs["pass@1"]["mean"])
        assert [p["passed"] for p in ours["prompts"]] == [p["passed"] for p in theirs["prompts"]]
    failed = {
        (each["class"], kind["kind"]): kind["count"]
        for each in shown["failures"]
        for kind in each["kinds"]
        if kind["count"]
    }
    assert {(each["class"], each["kind"]): each["count"] for each in run["failures"]} == failed


def test_the_report_of_a_run_opens(server: PageServer, folder: Path) -> None:
    report = folder / "hasty" / "report"
    tables = [
        part for part in results_section([new_run("hasty", {"Visit": (3,)})]).parts if isinstance(part, Sheet)
    ]
    list(write_report("a report", [], [Section("results", tables)], report))  # Figures take long.
    assert server.call("GET", "/api/runs/hasty/report").status == 200
    table = server.call("GET", "/api/runs/hasty/tables/overall.csv")
    assert (table.status, table.text.startswith("model,")) == (200, True)
    assert server.call("GET", "/api/runs/hasty/tables/no.csv").status == 404
    assert server.call("GET", "/api/runs/hasty/tables/..%2F..%2Frun.csv").status == 404
    shutil.rmtree(report)
    assert server.call("GET", "/api/runs/hasty/report").status == 404
    report.mkdir()
    (report / "index.html").write_text("<p>all is well</p><script>window.owned=1</script>")
    answer = server.call("GET", "/api/runs/hasty/report")
    assert (answer.status, "all is well" in answer.text) == (200, True)
    assert "<script>" in answer.text, "a page without our mark is served unchanged"
    assert server.ask("GET", "/api/runs/hasty/report").status == 401
    (report / "index.html").unlink()
    (report / "index.html").symlink_to("/etc/hostname")
    refused = server.call("GET", "/api/runs/hasty/report")
    assert (refused.status, "outside" in refused.text) == (422, True)


def test_completions_can_be_read_in_parts(server: PageServer) -> None:
    path = "/api/runs/hasty/completions"
    whole = read_json(server, f"{path}?limit=1000")
    assert whole["total"] == len(whole["completions"]) == 45
    parts = [read_json(server, f"{path}?offset={n}&limit=7")["completions"] for n in range(0, 45, 7)]
    assert [one for part in parts for one in part] == whole["completions"]
    assert read_json(server, f"{path}?offset=45")["completions"] == []
    for wrong in ("limit=0", "limit=1001", "offset=-1", "prompt=x", "passed=maybe"):
        assert server.call("GET", f"{path}?{wrong}").status == 422, wrong


def test_completions_can_be_filtered(server: PageServer) -> None:
    path = "/api/runs/hasty/completions"
    whole = read_json(server, f"{path}?limit=1000")["completions"]
    for query, holds in (
        ("task=LunchBreak", lambda one: one["task"] == "LunchBreak"),
        ("task=LunchBreak&prompt=2", lambda one: (one["task"], one["prompt"]) == ("LunchBreak", 2)),
        ("passed=true", lambda one: one["passed"]),
        ("passed=false", lambda one: not one["passed"]),
        (
            "failure_class=PythonError",
            lambda one: one["failure"] and one["failure"]["class"] == "PythonError",
        ),
        (
            "failure_class=RobotExecutionError&failure_kind=GoToInvalidLocation",
            lambda one: one["failure"] and one["failure"]["kind"] == "GoToInvalidLocation",
        ),
        ("task=%3Cscript%3E", lambda _: False),
    ):
        found = read_json(server, f"{path}?limit=1000&{query}")
        assert found["completions"] == [one for one in whole if holds(one)], query
        assert found["total"] == len(found["completions"])


def test_one_completion_has_the_fields_of_show(server: PageServer, folder: Path) -> None:
    for place in ("LunchBreak/0/0", "SayGoodDay/2/1", "StaplerSupply/1/2"):
        shown = json.loads(roboeval("show", folder / "hasty", place, "--json").out)
        found = read_json(server, f"/api/runs/hasty/completions/{place}")
        assert shown.pop("ablation") is False
        assert {name: found[name] for name in shown} == shown
        assert found["evaluation"] == "paper"
        assert any(check["explanation"] for world in found["worlds"] for check in world["failed_checks"]) or (
            found["failure"] is None or found["failure"]["check"] is None
        )


def test_a_name_with_special_characters_is_found(server: PageServer) -> None:
    name = quote("a <b>&? #%2F ü", safe="")
    assert read_json(server, f"/api/runs/{name}")["judged"] == 45
    assert server.call("GET", f"/runs/{name}").status == 200


@pytest.mark.parametrize(
    "name", ["..", "%2e%2e", "..%2fserved", "%2e%2e%2fruns%2fhasty", "%2fetc", "none", "hasty%00", "hasty%2f"]
)
def test_names_that_lead_elsewhere_are_not_found(server: PageServer, name: str) -> None:
    for path in (f"/api/runs/{name}", f"/api/runs/{name}/completions"):
        answer = server.call("GET", path)
        assert answer.status == 404, answer.text
    page = server.call("GET", f"/runs/{name}")
    assert "recorded:hasty" not in page.text


def test_missing_runs_evaluations_and_completions_are_named(server: PageServer) -> None:
    for path, sentence in (
        ("/api/runs/none", 'this folder has no run "none"; it may have been deleted'),
        ("/api/runs/hasty?evaluation=none", 'the run "hasty" has no evaluation "none"'),
        ("/api/runs/hasty/completions/LunchBreak/0/99", 'this run has no completion "LunchBreak/0/99"'),
    ):
        answer = server.call("GET", path)
        assert answer.status in {404, 422}
        assert answer.data["detail"] == sentence


@pytest.mark.parametrize(
    ("path", "status"),
    [("/runs/none", 404), ("/runs/hasty/LunchBreak/0/99", 404), ("/runs/hasty", 200), ("/none/at/all", 404)],
)
def test_pages_of_missing_runs_are_not_found(server: PageServer, path: str, status: int) -> None:
    authorization = f"Bearer {server.token}"
    page = server.ask("GET", path, accept="text/html", authorization=authorization)
    assert page.status == status
    assert "RoboEval" in page.text
    assert "CodeBotler" not in page.text


def test_a_deleted_run_is_no_longer_found(runs: Path) -> None:
    with serve_runs(runs) as server:
        assert read_json(server, "/api/runs/hasty")["judged"] == 45
        shutil.rmtree(runs / "hasty")
        assert server.call("GET", "/api/runs/hasty").status == 404
        assert read_json(server, "/api/runs") == []


@pytest.mark.slow
def test_an_unjudged_completion_has_the_fields_of_a_judged_one(runs: Path) -> None:
    run = RunFolder(runs / "hasty")
    places = ["/".join(str(row[part]) for part in KEY) for _, row in read_rows(run.completions)]
    rows = run.rows("paper")
    unseal(run.path)
    rows.write_bytes(b"".join(rows.read_bytes().splitlines(keepends=True)[:9]))
    with serve_runs(runs) as server:
        judged, waits = (read_json(server, f"/api/runs/hasty/completions/{places[at]}") for at in (0, -1))
        assert (waits["passed"], waits["worlds"], waits.keys()) == (None, [], judged.keys())
        assert server.call("GET", f"/runs/hasty/{places[-1]}").status == 200


@pytest.mark.slow
def test_a_damaged_row_is_named(runs: Path) -> None:
    rows = RunFolder(runs / "hasty").rows("paper")
    lines = rows.read_bytes().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if json.loads(line)["failure"])
    row = json.loads(lines[at])
    forged = {**row, "verdicts": [{**verdict, "trace": [["goto", 3]]} for verdict in row["verdicts"]]}
    unseal(runs / "hasty")
    rows.write_bytes(b"".join([*lines, b"nonsense\n"]))
    with serve_runs(runs) as server:
        (run,) = read_json(server, "/api/runs")
        assert (run["state"], run["notes"][0].partition(": ")[0]) == ("not read", "paper.jsonl, line 46")
        assert "paper.jsonl, line 46" in server.call("GET", "/runs/hasty").text
        assert server.call("GET", "/api/runs/hasty").status == 422
        rows.write_bytes(b"".join([*lines[:at], to_line(forged), *lines[at + 1 :]]))
        place = f"{row['task']}/{row['prompt']}/{row['index']}"
        answer = server.call("GET", f"/api/runs/hasty/completions/{place}")
        assert answer.status == 422
        assert place in answer.data["detail"]
        assert "--redo" in answer.data["detail"]
        assert server.call("GET", f"/runs/hasty/{place}").status == 200


@pytest.mark.slow
def test_hostile_texts_are_unchanged_in_json_and_escaped_in_pages(runs: Path) -> None:
    run = RunFolder(runs / "hasty")
    lines = run.completions.read_bytes().splitlines(keepends=True)
    row = {**json.loads(lines[0]), "model": HOSTILE, "program": HOSTILE * 3_000}
    run.completions.write_bytes(to_line(row) + b"".join(lines[1:]))
    judged, *others = run.rows("paper").read_bytes().splitlines(keepends=True)
    of_it = {**json.loads(judged), "program_sha256": Completion.of(row).program_sha256}
    run.rows("paper").write_bytes(to_line(of_it) + b"".join(others))
    unseal(run.path)
    with serve_runs(runs) as server:
        place = f"{row['task']}/{row['prompt']}/{row['index']}"
        found = read_json(server, f"/api/runs/hasty/completions/{place}")
        assert (found["model"], found["program"]) == (HOSTILE, HOSTILE * 3_000)
        page = server.call("GET", f"/runs/hasty/{place}")
        assert page.status == 200
        assert "<script>window" not in page.text


@pytest.mark.slow
def test_a_users_own_suite_must_be_named(runs: Path, tmp_path: Path) -> None:
    head = RunFolder(runs / "hasty").manifest("paper")
    head.write_text(json.dumps({**json.loads(head.read_text()), "suite": "mine"}))
    with serve_runs(runs) as server:
        run = read_json(server, "/api/runs/hasty")
        assert "`roboeval serve --suite FOLDER`" in run["notes"][0]
        failed = read_json(server, "/api/runs/hasty/completions?failure_class=TaskCompletionError")[
            "completions"
        ][0]
        place = f"{failed['task']}/{failed['prompt']}/{failed['index']}"
        read = read_json(server, f"/api/runs/hasty/completions/{place}")
        checks = [check for world in read["worlds"] for check in world["failed_checks"]]
        assert checks
        assert all(check["explanation"] is None for check in checks)
    mine = tmp_path / "mine"
    shutil.copytree(Path(sys.modules["roboeval"].__path__[0]) / "suites" / "paper", mine)
    suite = mine / "suite.yaml"
    suite.write_text(suite.read_text().replace("name: paper", "name: mine"))
    shutil.rmtree(tmp_path / "runs-served")
    with serve_runs(runs, "--suite", mine) as server:
        read = read_json(server, f"/api/runs/hasty/completions/{place}")
        checks = [check for world in read["worlds"] for check in world["failed_checks"]]
        assert all(check["explanation"] for check in checks)


# --- access, and addresses of pages


def test_requests_without_the_token_are_refused(server: PageServer) -> None:
    for path in (
        "/runs",
        "/runs/hasty",
        "/side-by-side",
        "/api/runs",
        "/static/benchmark/benchmark.css",
        "/",
    ):
        assert server.ask("GET", path).status == 401, path


@pytest.mark.parametrize("path", ["/runs", "/runs/hasty", "/side-by-side", "/api/runs", "/api/runs/hasty"])
def test_a_face_cannot_see_runs(path: str) -> None:
    sent: list[Message] = []

    async def send_ok(scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG001 - the signature of ASGI
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        return {"type": "http.request", "body": b""}

    def status(token: str) -> int:
        sent.clear()
        headers = [(b"host", b"localhost"), (b"authorization", f"Bearer {token}".encode())]
        scope = {
            "type": "http",
            "method": "GET",
            "path": path,
            "query_string": b"",
            "scheme": "http",
            "headers": headers,
        }
        asyncio.run(
            Guard(send_ok, Access("an operator's", "a face's"), PageAddress(), 0, set().__contains__)(
                scope, receive, send
            )
        )
        return int(sent[0]["status"])

    assert (status("a face's"), status("an operator's")) == (403, 200)


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/", 303),
        ("/runs/hasty", 303),
        ("/side-by-side", 303),
        ("/%09/example.org", 400),
        ("/runs/%0d%0aX", 400),
        ("/a%00b", 400),
        ("/runs/hasty%00", 400),
        ("/%5C/example.org", 404),
        ("//example.org", 404),
    ],
)
def test_links_with_a_token_redirect_to_pages(server: PageServer, path: str, status: int) -> None:
    assert server.ask("GET", f"{path}?token={server.token}").status == status


def test_the_api_has_a_description(server: PageServer) -> None:
    paths = read_json(server, "/api/openapi.json")["paths"]
    assert set(paths) == {
        "/api/runs",
        "/api/runs/{run}",
        "/api/runs/{run}/completions",
        "/api/runs/{run}/report",
        "/api/runs/{run}/tables/{table}.csv",
        "/api/runs/{run}/completions/{task}/{prompt}/{index}",
    }
    listed = paths["/api/runs/{run}/completions"]["get"]["parameters"]
    assert all(one.get("description") for one in listed if one["in"] == "query")


def test_without_a_robot_there_is_nothing_to_stop(server: PageServer) -> None:
    assert server.call("GET", "/").headers["location"] == "/runs"
    for path in ("/api/robot", "/missions", "/api/missions"):
        assert server.call("GET", path).status == 404
    assert "stop.js" not in server.call("GET", "/runs").text
    assert "stops the robot" not in server.output


@pytest.mark.slow
def test_an_operators_server_also_shows_runs(tmp_path: Path, runs: Path) -> None:
    with PageServer(tmp_path, "--runs", str(runs)) as server:
        assert read_json(server, "/api/runs")[0]["run"] == "hasty"
        for path in ("/runs", "/runs/hasty"):
            page = server.call("GET", path)
            assert page.status == 200
            assert "stop.js" in page.text, "every page of a robot has STOP"


def test_the_token_of_a_face_opens_no_run(tmp_path: Path, runs: Path) -> None:
    token = "a face's token of some length"
    with PageServer(tmp_path, "--face", "--face-token", token, "--runs", str(runs)) as server:
        for path in ("/runs", "/runs/hasty", "/side-by-side?run=hasty", "/api/runs", "/api/runs/hasty"):
            assert server.ask("GET", path, authorization=f"Bearer {token}").status == 403, path
        assert server.ask("GET", "/face", authorization=f"Bearer {token}").status == 200


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    refusal = refused("serve", tmp_path / "none")
    assert refusal.at == (str(tmp_path / "none"), None)
    assert "does not exist" in refusal.sentence
    assert refusal.commands == ["roboeval run"]


def test_help_does_not_import_the_pages() -> None:
    """Avoid importing NiceGUI at start-up, because that takes long."""
    code = "import sys, roboeval.cli.app, codebotler.cli.app; print('nicegui' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "False\n"


def test_a_folder_without_runs_causes_a_warning(tmp_path: Path, server: PageServer) -> None:
    empty = tmp_path / "runs"
    empty.mkdir()
    with serve_runs(empty) as without:
        assert re.match(rf"{empty} .*\bno runs\b.*\n", without.output)
    assert "no runs yet" not in server.output
