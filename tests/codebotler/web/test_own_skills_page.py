"""The page of a robot with custom skills lists, checks and runs them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pageserver import PageServer
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import load_suite

SETS = Path(__file__).parents[3] / "examples" / "skills"
QUADRUPED = SETS / "quadruped"
OPENS = """def task_program():
    say("Careful, a door opens.")
    try:
        open_door("steel door")
    except Exception as error:
        say(str(error))
    open_door("glass door")
"""


@pytest.mark.slow
def test_a_program_with_own_skills_is_checked_and_run(tmp_path: Path) -> None:
    world = (QUADRUPED / "world.yaml").read_text()
    more = (
        "--speed",
        "0",
        "--skills",
        str(QUADRUPED / "skills.py"),
        "--rules",
        str(QUADRUPED / "rules.yaml"),
    )
    with PageServer(tmp_path, *more, world=world) as server:
        listed = server.call("GET", "/api/robot").data["skills"]
        assert "open_door(door: str) -> bool" in listed
        found = server.call("POST", "/api/check", {"program": OPENS}).data
        assert [problem["kind"] for problem in found["problems"]] == ["DoorLocked"]
        started = server.call("POST", "/api/missions", {"program": OPENS}).data
        view = wait(server, lambda now: now["check"] is not None)
        approval = {"program": view["digest"], "despite_problems": True}
        assert server.call("POST", f"/api/missions/{started['id']}/approve", approval).status == 200
        over = wait(server, lambda now: now["is_over"])
        assert over["state"] == "done", over
        events = server.call("GET", f"/api/missions/{started['id']}").text
        assert "DoorLocked" in events
        refused = server.call("POST", "/api/check", {"program": OPENS.replace('"steel door"', "3")}).data
        assert "TypeError" in [problem["kind"] for problem in refused["problems"]]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", sorted({path.parent.name for path in SETS.glob("*/suite.yaml")} - {QUADRUPED.name})
)
def test_the_other_example_sets_are_served(tmp_path: Path, name: str) -> None:
    own = SETS / name
    more = ("--speed", "0", "--skills", str(own / "skills.py"), "--rules", str(own / "rules.yaml"))
    (completion, *_) = recorded_completions("recorded:careful", load_suite(own))
    with PageServer(tmp_path, *more, world=(own / "world.yaml").read_text()) as server:
        found = server.call("POST", "/api/check", {"program": completion.program}).data
        assert found["problems"] == []
        started = server.call("POST", "/api/missions", {"program": completion.program}).data
        view = wait(server, lambda now: now["check"] is not None)
        server.call("POST", f"/api/missions/{started['id']}/approve", {"program": view["digest"]})
        over = wait(server, lambda now: now["is_over"])
        assert over["state"] == "done", over


def wait(server: PageServer, holds: Callable[[Any], bool], seconds: float = 60.0) -> Any:  # noqa: ANN401 - JSON
    ends = time.monotonic() + seconds
    while not holds(now := server.call("GET", "/api/missions/current").data):
        if time.monotonic() > ends:
            pytest.fail(str(now))
        time.sleep(0.05)
    return now
