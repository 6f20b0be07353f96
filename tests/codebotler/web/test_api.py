"""A client with the token can do through the API all that the page does."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.world import Room, World
from codebotler.missions.storage.store import read_missions
from codebotler.robots.simulated import OFFICE
from ended import cut, failed_mission, line_of
from forked import PAGE, Forked
from pageserver import SERVE, WORLD, PageServer
from server import Server

HELLO = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"
FAILS_LATE = "def task_program():\n    say('hello')\n    go_to('cellar')\n"
SMALL = World((Room("hall"), Room("kitchen")), "hall")
BAD = "def task_program():\n    go_to('cellar')\n"
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("api"), "--speed", "4") as server:
        yield server


def wait_until(server: PageServer, holds: Callable[[dict[str, Any]], bool], seconds: float = 60.0) -> Any:  # noqa: ANN401 - JSON
    ends = time.monotonic() + seconds
    while not holds(now := server.call("GET", "/api/missions/current").data):
        assert time.monotonic() < ends, now
        time.sleep(0.02)
    return now


def begin(server: PageServer, program: str) -> Any:  # noqa: ANN401 - JSON
    answer = server.call("POST", "/api/missions", {"program": program})
    assert answer.status == 201, answer.text
    return wait_until(server, lambda now: now["check"] is not None)


def read_events(server: PageServer, mission: str, last: int = 0) -> list[tuple[int, dict[str, Any]]]:
    """Read all events of a mission with their numbers, like a browser's EventSource."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    headers = {"Authorization": f"Bearer {server.token}", "Last-Event-ID": str(last)}
    connection.request("GET", f"/api/missions/{mission}/events", headers=headers)
    answer = connection.getresponse()
    assert answer.headers["content-type"].startswith("text/event-stream")
    found, number = [], 0
    for line in answer:
        name, _, value = line.decode().rstrip("\n").partition(": ")
        if name == "id":
            number = int(value)
        elif name == "data":
            found.append((number, json.loads(value)))
    connection.close()
    return found


@pytest.mark.slow
def test_view_names_the_line_where_a_program_failed(server: PageServer) -> None:
    fails = "def task_program():\n    go_to('kitchen')\n    raise ValueError('odd')\n"
    view = begin(server, fails)
    approval = {"program": view["digest"], "despite_problems": True}
    assert server.call("POST", f"/api/missions/{view['id']}/approve", approval).status == 200
    over = wait_until(server, lambda now: now["is_over"])
    assert (over["state"], over["line"]) == ("failed", 3)
    assert "odd" in over["reason"]


@pytest.mark.slow
def test_a_mission_runs_from_its_program_to_its_files(server: PageServer) -> None:
    view = begin(server, HELLO)
    approval = {"program": view["digest"]}
    assert server.call("POST", f"/api/missions/{view['id']}/approve", approval).status == 200
    events = read_events(server, view["id"])
    assert [number for number, _ in events] == list(range(1, len(events) + 1))
    assert events[-1][1]["state"] == "done"
    assert read_events(server, "current", last=len(events) - 1) == events[-1:]
    jsonl = server.call("GET", f"/api/missions/{view['id']}/events.jsonl")
    assert [json.loads(line) for line in jsonl.text.splitlines()] == [event for _, event in events]
    assert f'filename="{view["id"]}.jsonl"' in jsonl.headers["content-disposition"]
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    token = {"Authorization": f"Bearer {server.token}"}
    connection.request("GET", f"/api/missions/{view['id']}/events.mcap", headers=token)
    assert connection.getresponse().read(5) == b"\x89MCAP"
    connection.close()
    assert server.call("GET", "/api/missions").data[-1]["state"] == "done"
    assert server.call("GET", f"/api/missions/{view['id']}").data["state"] == "done"


def test_approval_names_the_program_and_accepts_its_problems(server: PageServer) -> None:
    view = begin(server, BAD)
    path = f"/api/missions/{view['id']}/approve"
    refused = server.call("POST", path, {"program": view["digest"]})
    assert (refused.status, "has problems" in refused.data["detail"]) == (409, True)
    other = server.call("POST", path, {"program": "0" * 16, "despite_problems": True})
    assert (other.status, "has changed" in other.data["detail"]) == (409, True)
    assert server.call("PUT", f"/api/missions/{view['id']}/program", {"program": HELLO}).status == 200
    mended = wait_until(server, lambda now: now["check"] is not None)
    assert (mended["problems"], mended["program"]) == ([], HELLO)


@pytest.mark.slow
def test_a_model_is_asked_again_with_or_without_the_problems(tmp_path: Path) -> None:
    with (
        Server(answer=lambda asked: HELLO if "cellar" in json.dumps(asked.body) else BAD) as model,
        PageServer(tmp_path, "--model", "completions:m", "--base-url", model.url) as server,
    ):
        server.call("POST", "/api/missions", {"instruction": "say hello"})
        for repair, problems in ((True, 1), (False, 0), (False, 1)):
            now = wait_until(server, lambda now: now["check"] is not None and not now["busy"])
            assert len(now["problems"]) == problems
            again = server.call("POST", f"/api/missions/{now['id']}/again", {"repair": repair})
            assert (again.status, again.data["busy"]) == (202, "asking completions:m")
    with PageServer(tmp_path) as server:
        begin(server, HELLO)
        assert server.call("POST", "/api/missions/current/again", {}).status == 409, "no model wrote it"


def test_without_a_world_the_robot_works_in_the_office_of_the_examples(tmp_path: Path) -> None:
    office = Path(__file__).parents[3] / "examples" / "office.yaml"
    assert OFFICE.read_bytes() == office.read_bytes()
    with PageServer(tmp_path, serve=("codebotler", "serve")) as server:
        assert server.output.startswith("the robot works in an example office; --world FILE ")
        view = begin(server, "def task_program():\n    go_to('printer room 3')\n")
        assert view["check"]["problems"] == []


@pytest.mark.slow
def test_clients_that_do_not_read_delay_nothing(tmp_path: Path) -> None:
    """Twenty clients follow a mission with more events than a connection buffers, and read none."""
    many = "def task_program():\n    for n in range(115):\n        say(str(n) + 'x' * 8000)\n"
    with PageServer(tmp_path, "--speed", "0") as server, ExitStack() as opened:
        view = begin(server, many)
        request = (
            f"GET /api/missions/{view['id']}/events HTTP/1.1\r\nHost: localhost\r\n"
            f"Authorization: Bearer {server.token}\r\n\r\n"
        )
        for _ in range(20):
            lazy = opened.enter_context(socket.socket())
            lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            lazy.connect(("127.0.0.1", server.port))
            lazy.sendall(request.encode())
        approval = {"program": view["digest"]}
        assert server.call("POST", "/api/missions/current/approve", approval).status == 200
        events = read_events(server, view["id"])
        assert sum(len(json.dumps(event)) for _, event in events) > 900_000
        assert events[-1][1]["state"] == "done"
        assert begin(server, HELLO)["state"] == "checked"
        began = time.monotonic()
        server.end()
        assert time.monotonic() - began < 8


def test_a_stop_ends_the_current_mission(server: PageServer) -> None:
    view = begin(server, FAR)
    server.call("POST", "/api/missions/current/approve", {"program": view["digest"]})
    wait_until(server, lambda now: now["doing"] != "")
    assert server.call("POST", "/api/missions", {"program": HELLO}).status == 409
    began = time.monotonic()
    assert server.call("POST", "/api/stop").status == 202
    robot = server.call("GET", "/api/robot?once=over").data
    assert (robot["is_over"], robot["state"]) == (True, "stopped")
    assert time.monotonic() - began < 2
    assert server.call("POST", "/api/stop").data == {"stopping": False, "warning": ""}


def test_a_key_stops_only_a_robot_that_runs(server: PageServer) -> None:
    begin(server, HELLO)
    assert server.call("POST", "/api/stop?only_moving=true").data == {"stopping": False, "warning": ""}
    assert server.call("GET", "/api/robot").data["state"] == "checked"
    assert server.call("POST", "/api/stop").data == {"stopping": True, "warning": ""}


@pytest.mark.slow
def test_the_rest_of_a_mission_is_a_mission_of_its_own(server: PageServer) -> None:
    fails = "def task_program():\n    say('hello')\n    raise ValueError('odd')\n"
    server.run(fails, despite_problems=True)
    failed = wait_until(server, lambda now: now["is_over"])
    begun = server.call("POST", "/api/missions/current/continue", {})
    assert begun.status == 201
    assert begun.data["id"] != failed["id"]
    assert begun.data["past"]["mission"] == failed["id"]
    assert len(begun.data["past"]["steps"]) == 1
    assert begun.data["program"] == fails
    server.rest()
    assert server.call("POST", "/api/missions/unknown/continue", {}).status == 404
    server.run(HELLO)
    done = wait_until(server, lambda now: now["is_over"])
    assert (done["state"], done["past"]) == ("done", None)
    assert server.call("POST", "/api/missions/current/continue", {}).status == 422


@pytest.mark.slow
def test_the_server_recovers_from_a_failed_skill(tmp_path: Path) -> None:
    fetch = "def task_program():\n    go_to('kitchen')\n    pick('cup')\n    go_to('hall')\n"
    go_back = "def task_program():\n    go_to('hall')\n"
    with (
        Server(answer=lambda asked: go_back if "pick('cup')" in json.dumps(asked.body) else fetch) as model,
        PageServer(
            tmp_path,
            *("--model", "completions:m", "--base-url", model.url),
            *("--speed", "0", "--recover", "1"),
        ) as server,
    ):
        first = server.call("POST", "/api/missions", {"instruction": "Fetch a cup."}).data["id"]
        checked = wait_until(server, lambda now: now["check"] is not None)
        server.call("POST", "/api/missions/current/approve", {"program": checked["digest"]})
        done = wait_until(server, lambda now: now["id"] not in {"", first} and now["is_over"])
        assert (done["state"], done["past"]["mission"]) == ("done", first)


@pytest.mark.slow
def test_only_a_person_says_whether_an_unsure_step_happened(tmp_path: Path) -> None:
    folder = failed_mission(tmp_path / "home", FAILS_LATE, SMALL, "")
    cut(folder, line_of(folder, "say", "skill"))
    with PageServer(tmp_path) as server:
        path = f"/api/missions/{folder.name}/continue"
        unsure = server.call("POST", path, {})
        assert (unsure.status, "hello" in unsure.data["detail"]) == (422, True)
        assert server.call("GET", "/api/robot").data["mission"] == ""
        for happened in (True, False):
            begun = server.call("POST", path, {"happened": happened}).data
            assert len(begun["past"]["steps"]) == int(happened)


def test_a_check_begins_no_mission(server: PageServer) -> None:
    before = len(read_missions(server.home))
    found = server.call("POST", "/api/check", {"program": "def task_program():\n    fly()\n"}).data
    assert (found["accepted"], found["problems"][0]["line"]) == (False, 2)
    assert len(read_missions(server.home)) == before


def test_lone_surrogates_are_escaped_or_refused(server: PageServer) -> None:
    view = begin(server, "def task_program():\n    say('\\ud800')\n    go_to('\\udfff')\n")
    assert "\\udfff" in json.dumps(view["problems"])
    raw = server.call("POST", "/api/missions", {"program": "def task_program():\n    say('\ud800')\n"})
    assert (raw.status, raw.data["detail"][0]["loc"]) == (422, ["body", "program"])
    assert len(server.call("POST", "/api/check", {"program": "x" * 300_000}).text) < 1_000


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("GET", "/api/nothing", None, 404),
        ("GET", "/api/missions/20200101-000000", None, 404),
        ("GET", "/api/missions/..%2f..%2fetc/events.jsonl", None, 404),
        ("GET", "/api/missions/nosuch/events", None, 404),
        ("GET", "/api/missions/nosuch/events.jsonl", None, 404),
        ("POST", "/api/missions", {}, 422),
        ("POST", "/api/missions", {"program": HELLO, "more": 1}, 422),
        ("POST", "/api/missions", b"{", 422),
        ("POST", "/api/missions", {"instruction": "fly", "model": "recorded:nobody"}, 201),
    ],
)
def test_faulty_requests_get_their_status(
    server: PageServer, method: str, path: str, body: object, status: int
) -> None:
    answer = server.call(method, path, body)
    assert answer.status == status, answer.text
    if status == 201:
        assert "unknown recorded model" in wait_until(server, lambda now: now["is_over"])["trouble"]


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("DELETE", "/api/missions", "GET, POST"),
        ("DELETE", "/api/missions/current", "GET"),
        ("POST", "/api/missions/current/program", "PUT"),
        ("GET", "/api/check", "POST"),
    ],
)
def test_answer_to_another_method_names_the_allowed_ones(
    server: PageServer, method: str, path: str, allowed: str
) -> None:
    answer = server.call(method, path)
    assert (answer.status, answer.headers.get("allow")) == (405, allowed)
    assert answer.data["detail"] == f"this address accepts only {allowed.replace(', ', ' and ')}"


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    """A page without any mission."""
    with PageServer(tmp_path_factory.mktemp("fresh")) as server:
        yield server


def test_error_without_a_mission_says_how_to_begin_one(fresh: PageServer) -> None:
    for method, path in (
        ("GET", "/events"),
        ("GET", "/events.jsonl"),
        ("GET", "/events.mcap"),
        ("POST", "/again"),
    ):
        answer = fresh.call(method, f"/api/missions/current{path}", {} if path == "/again" else None)
        assert answer.status == 404, path
        assert "POST /api/missions" in answer.data["detail"]


@pytest.mark.slow
def test_unwritable_home_is_refused_before_the_page_starts(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(WORLD)
    environment = {**os.environ, "CODEBOTLER_HOME": "/sys/home"}
    process = Forked(*SERVE, "--port", "0", cwd=tmp_path, environment=environment, preload=PAGE)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("codebotler: /sys/home/missions: ")
    assert "CODEBOTLER_HOME" in err


def test_home_that_becomes_unwritable_raises_one_sentence(fresh: PageServer) -> None:
    missions = fresh.home / "missions"
    missions.rmdir()
    missions.touch()
    answer = fresh.call("POST", "/api/missions", {"program": HELLO})
    missions.unlink()
    missions.mkdir()
    assert (answer.status, answer.data["detail"]) == (409, f"{missions}: File exists")


def test_an_earlier_mission_can_be_read_but_not_followed(server: PageServer) -> None:
    before = begin(server, HELLO)["id"]
    begin(server, HELLO)
    for method, what, body in (("GET", "events", None), ("POST", "again", {})):
        answer = server.call(method, f"/api/missions/{before}/{what}", body)
        assert answer.status == 409
        assert before in answer.data["detail"]
        assert "only" in answer.data["detail"]
    assert server.call("GET", f"/api/missions/{before}/events.jsonl").status == 200


def test_the_api_is_described(server: PageServer) -> None:
    described = server.call("GET", "/api/openapi.json").data["paths"]
    assert {"/api/missions", "/api/stop", "/api/check"} <= described.keys()


@pytest.mark.slow
def test_the_robot_stops_when_the_tool_ends_and_is_reported_after_a_kill(tmp_path: Path) -> None:
    with PageServer(tmp_path) as server:
        view = begin(server, FAR)
        server.call("POST", "/api/missions/current/approve", {"program": view["digest"]})
        wait_until(server, lambda now: now["doing"] != "")
        server.end(signal.SIGINT)
    (stopped,) = read_missions(tmp_path / "home")
    assert stopped.state == "stopped"
    assert "shutting down" in stopped.reason
    with PageServer(tmp_path) as server:
        view = begin(server, FAR)
        server.call("POST", "/api/missions/current/approve", {"program": view["digest"]})
        wait_until(server, lambda now: now["doing"] != "")
        server.end(signal.SIGKILL)
    with PageServer(tmp_path) as server:
        assert re.search("interrupted.* go_to", server.output)
        (interrupted,) = server.call("GET", "/api/robot").data["interrupted"]
        assert "go_to" in interrupted["reason"]
        assert read_missions(tmp_path / "home")[-1].state == "interrupted"


@pytest.mark.slow
def test_nothing_of_the_page_is_loaded_for_other_commands() -> None:
    loaded = "print('nicegui' in sys.modules, 'fastapi' in sys.modules)"
    code = f"import sys, codebotler.cli.app, codebotler.cli.operating.run, codebotler.web.console; {loaded}"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["False", "False"]
