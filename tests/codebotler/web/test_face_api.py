"""The face over HTTP shows what the robot says and asks, takes answers, and may do nothing else."""

from __future__ import annotations

import http.client
import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from codebotler.core.world import Room, World
from codebotler.missions.display.view import SessionView
from codebotler.missions.mission import UNCONFIRMED_STOP
from codebotler.missions.storage.log import MissionState, read_events
from codebotler.missions.storage.store import read_missions
from codebotler.robots.face import Face, FaceQuestion
from codebotler.robots.simulated import Simulated
from codebotler.web.console import Console
from codebotler.web.face import MAX_FACE_OPTIONS, MAX_FACE_TEXT, face_data, question_data, screen_text
from codebotler.web.security.access import MIN_TOKEN_LENGTH
from codebotler.web.security.guard import MAX_BODY_BYTES
from command_line import ENVIRONMENT
from forked import PAGE, Forked
from pageserver import PageServer

TEA = """def task_program():
    say("Good morning")
    answer = ask("ann", "Tea?", ["Yes", "No"])
    say("She says " + answer)
"""
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('study')\n"
SECRET = "def task_program():\n    secret = 'in the program'\n    go_to('kitchen')\n    undefined_name()\n"
LIVE = "/api/face/live"
NICEGUI = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    with PageServer(tmp_path_factory.mktemp("face"), "--face", "--speed", "2") as server:
        yield server


@pytest.fixture(autouse=True)
def stop_robot(server: PageServer) -> None:
    server.call("POST", "/api/stop")
    wait_until(server, lambda now: now["is_over"])


def wait_until(server: PageServer, holds: Callable[[dict[str, Any]], object], seconds: float = 60.0) -> Any:  # noqa: ANN401 - JSON
    """Wait until something holds of what the face shows."""
    ends = time.monotonic() + seconds
    while not holds(now := server.call("GET", "/api/face").data):
        assert time.monotonic() < ends, now
        time.sleep(0.01)
    return now


def open_socket(server: PageServer, path: str = LIVE, **headers: str) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{server.port}{path}", additional_headers=headers, proxy=None, open_timeout=30
    )


def open_face(server: PageServer) -> ClientConnection:
    """Open the websocket of a face like its page."""
    cookie = server.ask("GET", f"/face?token={server.face_token}").headers["set-cookie"].partition(";")[0]
    return open_socket(server, cookie=cookie, origin=f"http://127.0.0.1:{server.port}")


def receive(socket: ClientConnection, holds: Callable[[dict[str, Any]], object]) -> Any:  # noqa: ANN401 - JSON
    """Receive messages until something holds of one, and return it."""
    while True:
        now = json.loads(socket.recv(timeout=60))
        if holds(now):
            return now


def receive_end(socket: ClientConnection, number: int) -> Any:  # noqa: ANN401 - JSON
    """Receive the end of a question."""
    return receive(socket, lambda now: (now["ended"] or {}).get("number") == number)["ended"]


@pytest.mark.slow
def test_a_question_is_answered_from_the_face(server: PageServer) -> None:
    with open_face(server) as one, open_face(server) as other:
        receive(one, lambda now: now["screens"] == 2)
        server.run(TEA)
        asked, same = (receive(socket, lambda now: now["question"]) for socket in (one, other))
        assert asked["question"] == same["question"]
        assert (asked["doing"], asked["question"]["person"]) == ("asking", "ann")
        assert (asked["question"]["text"], asked["question"]["options"]) == ("Tea?", ["Yes", "No"])
        assert 0 < asked["seconds_left"] <= 60
        answer = {"question": asked["question"]["number"], "option": 1}
        taken = server.face("POST", "/api/face/answer", answer)
        assert (taken.status, taken.data["question"]) == (200, None)
        for socket in (one, other):
            ended = receive(socket, lambda now: (now["ended"] or {}).get("number") == answer["question"])[
                "ended"
            ]
            assert (ended["how"], ended["answer"]) == ("answered", "No")
        again = server.face("POST", "/api/face/answer", answer)
        assert (again.status, "closed" in again.data["detail"]) == (409, True)
        over = receive(one, lambda now: now["is_over"])
        assert [said["text"] for said in over["said"]] == ["Good morning", "She says No"]
    assert wait_until(server, lambda now: now["screens"] == 0)


@pytest.mark.slow
def test_a_stop_withdraws_the_question_on_every_face(server: PageServer) -> None:
    with open_face(server) as one, open_face(server) as other:
        server.run(TEA)
        number = wait_until(server, lambda now: now["question"])["question"]["number"]
        server.call("POST", "/api/stop")
        over = server.face("GET", "/api/face?once=over").data
        assert (over["is_over"], over["state"]) == (True, "stopped")
        for socket in (one, other):
            assert receive_end(socket, number)["how"] == "withdrawn"
        late = server.face("POST", "/api/face/answer", {"question": number, "option": 0})
        assert (late.status, "withdrawn" in late.data["detail"]) == (409, True)


@pytest.mark.slow
def test_a_question_without_an_answer_in_time_fails_the_mission(tmp_path: Path) -> None:
    with PageServer(tmp_path, "--face", "--speed", "0", "--face-timeout", "1") as server:
        server.run(TEA)
        assert wait_until(server, lambda now: now["is_over"])["ended"]["how"] == "unanswered"
        (mission,) = read_missions(server.home)
        assert mission.state == "failed"
        assert re.match(r'AskTimeout: .*"Tea\?" .*1 s', mission.reason)
        events = read_events(server.home / "missions" / mission.id)
        assert any("no face" in line.get("text", "") for line in events)


@pytest.mark.slow
def test_the_face_shows_what_the_robot_does_and_nothing_of_its_program(server: PageServer) -> None:
    assert server.face("GET", "/api/face").data["doing"] == "idle"
    server.run(SECRET, despite_problems=True)
    moving = wait_until(server, lambda now: now["doing"] == "moving")
    assert moving["to"] == "kitchen"
    over = wait_until(server, lambda now: now["is_over"])
    assert (over["state"], over["reason"]) == ("failed", "")
    assert "secret" not in server.face("GET", "/api/face").text


def test_the_face_shows_that_a_robot_does_not_confirm_its_stop(tmp_path: Path) -> None:
    """People next to the robot must know."""
    face = Face()
    console = Console(
        Simulated(World((Room("a"),), "a")), tmp_path, lambda _: pytest.fail("no model"), face=face
    )
    view = SessionView(1, "m", MissionState.FAILED, reason=UNCONFIRMED_STOP)
    ended = type("Ended", (), {"view": view, "is_approved_by_person": True, "may_move": True})()
    console.session = ended
    console._change()
    assert face_data(console, face)["reason"] == UNCONFIRMED_STOP
    console.session = type("Next", (), {"view": SessionView(2, "n"), "is_approved_by_person": False})()
    assert face_data(console, face)["reason"] == UNCONFIRMED_STOP, "the next mission only waits"
    console.session.is_approved_by_person, console._began = True, time.time() + 60
    console._hold.finish()
    assert face_data(console, face)["reason"] == ""


def test_a_face_stops_a_robot_that_runs_and_nothing_else(server: PageServer) -> None:
    server.run(FAR)
    wait_until(server, lambda now: now["doing"] == "moving")
    assert server.face("POST", "/api/face/stop?only_moving=false").data == {
        "stopping": True,
        "warning": False,
    }
    assert wait_until(server, lambda now: now["is_over"])["state"] == "stopped"
    assert "at the face" in read_missions(server.home)[-1].reason
    server.call("POST", "/api/missions", {"program": FAR})
    while server.call("GET", "/api/robot").data["state"] != "checked":
        time.sleep(0.01)
    before = held_at(server)
    assert server.face("POST", "/api/face/stop?only_moving=false").data == {
        "stopping": False,
        "warning": False,
    }
    assert server.call("GET", "/api/robot").data["state"] == "checked"
    until = time.monotonic() + 10
    while held_at(server) == before:
        assert time.monotonic() < until, "agents do not wait for a person"
        time.sleep(0.01)


def held_at(server: PageServer) -> int:
    """Return the time of the last press that holds agents, in nanoseconds, or 0."""
    return max((file.stat().st_mtime_ns for file in (server.home / "robots").glob("*.held")), default=0)


@pytest.mark.parametrize(
    "answer", [{}, {"question": 1}, {"question": 1, "option": -1}, {"question": 1, "option": "x"}]
)
def test_an_invalid_answer_is_refused(server: PageServer, answer: object) -> None:
    assert server.face("POST", "/api/face/answer", answer).status == 422


@pytest.mark.slow
def test_a_face_that_reads_nothing_delays_nothing(tmp_path: Path) -> None:
    """Its messages would fill all buffers many times over."""
    talks = "def task_program():\n    for n in range(400):\n        say(str(n) + chr(8987) * 5000)\n"
    with PageServer(tmp_path, "--face", "--speed", "0") as server, open_face(server) as slow:
        receive(slow, lambda now: now["screens"] == 1)
        with open_face(server) as quick:
            server.run(talks, despite_problems=True)
            over = receive(quick, lambda now: now["state"] == "done")
            assert over["said"][-1]["text"].startswith("399")


def test_messages_of_a_face_have_a_size_limit(server: PageServer) -> None:
    with open_face(server) as socket:
        socket.send("x" * (MAX_BODY_BYTES + 1))
        with pytest.raises(ConnectionClosedError) as closed:
            receive(socket, lambda _: False)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009
        assert server.call("GET", "/api/face").status == 200


# --- permissions of a face


def test_a_face_may_use_only_its_own_addresses(server: PageServer) -> None:
    described = server.call("GET", "/api/openapi.json").data["paths"]
    theirs = {"/api/face", "/api/face/answer", "/api/face/stop"}
    assert theirs < described.keys()
    for path, methods in described.items():
        if path not in theirs:
            for method in methods:
                asked = server.face(method.upper(), re.sub(r"\{\w+\}", "current", path), {})
                assert asked.status == 403, (method, path)
    for path in ("/", "/missions", "/api", "/api/openapi.json", "/_nicegui/x.js", "/face/../api/missions"):
        assert server.face("GET", path).status in {403, 404}, path
    assert server.face("GET", "/face").status == 200


def test_a_face_reaches_no_page_of_an_operator_over_the_websocket(server: PageServer) -> None:
    """NiceGUI takes messages for any page by its number, from any sender."""
    link = server.ask("GET", f"/face?token={server.face_token}")
    here = f"http://127.0.0.1:{server.port}"
    with pytest.raises(InvalidStatus) as refused:
        open_socket(server, NICEGUI, cookie=link.headers["set-cookie"].partition(";")[0], origin=here)
    assert refused.value.response.status_code == 403
    with open_socket(server, NICEGUI, cookie=server.cookie, origin=here):
        pass  # An operator's page may open it.
    polling = NICEGUI.replace("websocket", "polling")
    assert server.face("GET", polling).status == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", ""])
def test_no_other_page_listens_to_the_face(server: PageServer, origin: str) -> None:
    cookie = server.ask("GET", f"/face?token={server.face_token}").headers["set-cookie"].partition(";")[0]
    for headers in ({"cookie": cookie, "origin": origin}, {"cookie": cookie}, {"origin": origin}):
        with pytest.raises(InvalidStatus):
            open_socket(server, **headers)
    asked = server.ask("POST", "/api/face/answer", {"question": 1, "option": 0}, cookie=cookie, origin=origin)
    assert asked.status == 403


def test_nobody_sees_the_face_without_its_token(server: PageServer) -> None:
    for method, path in (("GET", "/face"), ("GET", "/api/face"), ("POST", "/api/face/answer")):
        assert server.ask(method, path, {}).status == 401
    with suppress(InvalidStatus), open_socket(server, origin=f"http://127.0.0.1:{server.port}"):
        pytest.fail("it was let in")


def test_the_page_of_the_face_has_a_stricter_policy(server: PageServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request("GET", "/face", headers={"Authorization": f"Bearer {server.face_token}"})
    answer = connection.getresponse()
    policies = answer.headers.get_all("content-security-policy") or []
    connection.close()
    assert len(policies) == 2, "the policy of all pages, and its own"
    (own,) = [policy for policy in policies if "require-trusted-types-for 'script'" in policy]
    assert "unsafe" not in own
    assert "script-src 'self';" in own


@pytest.mark.slow
def test_there_is_no_face_unless_one_is_asked_for(tmp_path: Path) -> None:
    with PageServer(tmp_path, "--speed", "0") as server:
        assert "face" not in server.output
        assert server.call("GET", "/face").status == 404
        assert server.call("GET", "/api/face").status == 404
        server.run("def task_program():\n    say('hello')\n")
        while not server.call("GET", "/api/robot").data["is_over"]:
            time.sleep(0.01)
        assert read_missions(server.home)[-1].state == "done"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--face-token", "short"], f"{MIN_TOKEN_LENGTH} characters"),
        (["--token", "x" * 20, "--face-token", "x" * 20], "two roles have the same token"),
        (["--no-token", "--face-token", "x" * 20], "--no-token cannot be combined"),
        (["--face-timeout", "0"], "'--face-timeout'"),
        (["--stop-when-alone", "0"], "'--stop-when-alone'"),
    ],
)
def test_careless_options_are_refused(tmp_path: Path, arguments: list[str], named: str) -> None:
    (tmp_path / "world.yaml").write_text("robot: a\nrooms: [a]\n")
    words = ("serve", "--world", "world.yaml", "--face", *arguments)
    with Forked("codebotler", *words, cwd=tmp_path, environment=ENVIRONMENT, preload=PAGE) as process:
        _, err = process.communicate(timeout=30)
    assert process.returncode == 2
    assert named in err


def test_the_token_of_the_face_can_be_chosen(tmp_path: Path) -> None:
    with PageServer(tmp_path, "--face", "--face-token", "the tablet's token") as server:
        assert server.face_token == "the+tablet%27s+token"
        found = server.ask("GET", "/api/face", authorization="Bearer the tablet's token")
        assert found.status == 200


# --- texts


def test_texts_are_cut_and_made_visible_but_keep_their_lines() -> None:
    assert screen_text("one\ntwo\r\n\u202ethree") == "one\ntwo\n\\u202ethree"
    assert screen_text("x" * (MAX_FACE_TEXT + 1_000)) == f"{'x' * MAX_FACE_TEXT}... 1,000 more characters"
    assert screen_text("\ud800") == "\\ud800"


def test_more_options_than_a_screen_holds_are_counted() -> None:
    data = question_data(FaceQuestion(1, "ann", "Which?", tuple(map(str, range(MAX_FACE_OPTIONS + 7)))))
    assert (len(data["options"]), data["more_options"]) == (MAX_FACE_OPTIONS, 7)
