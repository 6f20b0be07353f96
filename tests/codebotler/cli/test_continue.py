"""`codebotler continue` and `run --recover` do the rest of a mission, written by a model or a person."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from codebotler.cli.operating.run import Request, run
from codebotler.core.errors import UserError
from codebotler.core.world import Room, World
from codebotler.core.world_file import read_world
from codebotler.missions.display.view import MissionOrder
from codebotler.missions.storage.log import EVENTS_FILE, SUMMARY_FILE
from codebotler.missions.storage.past import MissionPast
from codebotler.missions.storage.store import read_missions
from codebotler.robots.simulated import Simulated
from codebotler.web.console import Console
from command_line import Ended, command
from doubles import FakeModel
from ended import cut, failed_mission, line_of
from server import Request as ModelRequest
from server import Server

WORLD = """
robot: hall
rooms: [hall, kitchen, lab]
objects: {kitchen: [mug]}
people: {lab: [{name: Anne, answers: ["no"]}]}
"""
PROGRAM = """def task_program():
    go_to("kitchen")
    pick("mug")
    go_to("lab")
    ask("Bob", "A mug?", ["yes", "no"])
    place("mug")
    say("done")
"""
REST = """def task_program():
    if ask("Anne", "A mug?", ["yes", "no"]) == "no":
        place("mug")
    say("done")
"""
AGAIN = """def task_program():
    go_to("kitchen")
    pick("mug")
"""
WIDER = REST.replace('"done"', '"All is well, and somebody else got it."')


def test_nothing_begins_after_a_stop_while_a_person_was_asked(tmp_path: Path) -> None:
    past = MissionPast("1", "Say it.", "", PROGRAM, "", ())
    console = Console(Simulated(World((Room("hall"),), "hall")), tmp_path, lambda _: pytest.fail("no model"))
    request = Request("Say it.", yes=True, past=past)
    assert request.order_on(console).past is past
    assert not console.stop("a person at the page", holds=True)
    with pytest.raises(UserError):
        request.order_on(console)


def test_a_run_with_yes_is_no_approval_by_a_person(tmp_path: Path) -> None:
    (tmp_path / "hello.py").write_text("def task_program():\n    say('hello')\n")
    robot = Simulated(World((Room("hall"),), "hall"))
    with Console(robot, tmp_path, lambda _: pytest.fail("no model")) as console:
        console.stop("a person at the page", holds=True)
        console.presses = 0  # in another process
        assert run(console, Request(str(tmp_path / "hello.py"), yes=True)) == 0
        console.begin(MissionOrder(program="def task_program():\n    say('hello')\n"))
        assert console.is_held


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("begun.py", PROGRAM), ("rest.py", REST), ("again.py", AGAIN), ("world.yaml", WORLD)):
        (tmp_path / name).write_text(text)
    return tmp_path


def call(folder: Path, name: str, *arguments: str | Path, given: str = "") -> Ended:
    environment = {
        **os.environ,
        "CODEBOTLER_HOME": str(folder / "home"),
        "COLUMNS": "100",
        "NO_COLOR": "1",
        "OPENAI_API_KEY": "key",
    }
    sim = () if name == "missions" else ("--world", "world.yaml", "--speed", "0")
    return command("codebotler", name, *arguments, *sim, cwd=folder, environment=environment, given=given)


def missions(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(call(folder, "missions", "--json").out)
    return found


def crash_during(folder: Path, skill: str) -> dict[str, Any]:
    """Change the only mission as if the tool had crashed during the first call of a skill."""
    (mission,) = missions(folder)
    home = folder / "home" / "missions" / mission["id"]
    log = (home / EVENTS_FILE).read_text().splitlines(keepends=True)
    calls = next(n for n, line in enumerate(log, 1) if f'"skill": "{skill}"' in line)
    (home / EVENTS_FILE).write_text("".join(log[:calls]))
    (home / SUMMARY_FILE).write_text(json.dumps({**mission, "state": "running", "ended": None}))
    return mission


def read_calls(folder: Path, mission: str) -> list[str]:
    """Read the skills that a mission called, each with its first argument."""
    log = (folder / "home" / "missions" / mission / EVENTS_FILE).read_text().splitlines()
    rows = [line for line in map(json.loads, log) if line["event"] == "skill"]
    return [f"{row['skill']} {next(iter(row['arguments'].values()), '')}".strip() for row in rows]


def server(*programs: str) -> Server:
    """Make a server that replies with one program after another."""
    one = Server()
    one.answer = lambda _: f"```python\n{programs[len(one.requests) - 1]}```\n"
    return one


def prompt_of(request: ModelRequest) -> str:
    return str(request.body["messages"][-1]["content"])


def flags(one: Server) -> tuple[str, ...]:
    return "--model", "openai-chat:tiny", "--base-url", one.url


def test_a_program_of_a_person_does_the_rest(folder: Path) -> None:
    assert call(folder, "run", "begun.py", "--yes").status == 1
    done = call(folder, "continue", "last", "rest.py", "--yes")
    assert (done.status, done.err) == (0, "")
    before, after = missions(folder)
    assert (before["state"], after["state"], after["continues"]) == ("failed", "done", before["id"])
    assert read_calls(folder, after["id"]) == ["ask Anne", "place mug", "say done"]


def test_a_mission_that_did_nothing_is_continued_with_its_own_program(folder: Path) -> None:
    world = read_world(folder / "world.yaml")
    mission = failed_mission(folder / "home", PROGRAM, world)
    cut(mission, line_of(mission, "go_to", "skill"))
    done = call(folder, "continue", "last", "--yes")  # No model has a program for it.
    before, after = missions(folder)
    assert (after["continues"], after["program"]) == (before["id"], before["program"]), done.err
    assert read_calls(folder, after["id"])[0] == "go_to kitchen"


def test_a_program_that_forgets_the_held_thing_is_not_run(folder: Path) -> None:
    call(folder, "run", "begun.py", "--yes")
    refused = call(folder, "continue", "last", "again.py", "--yes")
    assert refused.status == 1
    assert "PickWhileHolding" in refused.out
    assert missions(folder)[-1]["state"] == "failed"


@pytest.mark.slow
def test_a_model_gets_the_past_and_writes_the_rest(folder: Path) -> None:
    with server(PROGRAM, REST) as model:
        assert call(folder, "run", "Bring Anne a mug.", *flags(model), "--yes").status == 1
        assert call(folder, "continue", *flags(model), "--yes").status == 0
    request = prompt_of(model.requests[-1])
    for words in ("AskNoPerson", 'in "kitchen": picked up "mug"', 'in "lab" and holds "mug"'):
        assert words in request
    assert "Bring Anne a mug." in str(model.requests[-1].body["messages"])
    assert missions(folder)[-1]["state"] == "done"


def test_recover_continues_by_itself_within_the_approved_contract(folder: Path) -> None:
    begun = PROGRAM.replace('"Bob"', '"Anne" if is_in_room("mug") else "Bob"')
    with server(begun, REST) as model:
        done = call(folder, "run", "Bring Anne a mug.", *flags(model), "--recover", "1", given="y\n")
    assert done.status == 0, done.err
    assert [one["state"] for one in missions(folder)] == ["failed", "done"]
    assert len(model.requests) == 2


@pytest.mark.parametrize("times", [0, 1])
def test_recover_stops_after_the_given_number_of_attempts(folder: Path, times: int) -> None:
    fails = 'def task_program():\n    go_to("lab")\n    ask("Bob", "Tea?", ["yes"])\n'
    with server(*[fails] * (times + 1)) as model:
        gave_up = call(folder, "run", "Ask Bob.", *flags(model), "--yes", "--recover", str(times))
    assert gave_up.status == 1
    assert len(missions(folder)) == times + 1


class Interrupted(Simulated):
    """A robot whose user presses Ctrl-C as soon as the mission has failed."""

    def disconnect(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)
        super().disconnect()


def test_nothing_is_recovered_after_a_signal(tmp_path: Path) -> None:
    world = World((Room("hall"), Room("kitchen")), "hall")
    model = FakeModel(('def task_program():\n    go_to("kitchen")\n    pick("mug")\n', REST))
    console = Console(Interrupted(world, speed=None), tmp_path, lambda _: model, models=("m",), world=world)
    handlers = {one: signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        status = run(console, Request("Fetch the mug.", yes=True, recoveries=1))
    finally:
        for one, handler in handlers.items():
            signal.signal(one, handler)
    assert (status, len(read_missions(tmp_path))) == (128 + signal.SIGINT, 1)


def test_recover_asks_for_approval_beyond_the_contract(folder: Path) -> None:
    with server(PROGRAM, WIDER) as model:
        done = call(folder, "run", "Bring Anne a mug.", *flags(model), "--recover", "1", given="y\nn\n")
    assert done.status == 1
    assert done.err.count("[y/N]") == 2
    assert [one["state"] for one in missions(folder)] == ["failed", "stopped"]


def test_the_rest_of_a_typed_program_must_be_typed(folder: Path) -> None:
    call(folder, "run", "begun.py", "--yes")
    assert call(folder, "continue", "--yes").status == 2


def test_uncertain_step_needs_a_persons_answer(folder: Path) -> None:
    call(folder, "run", "begun.py", "--yes")
    mission = crash_during(folder, "pick")
    program = folder / "place.py"
    program.write_text('def task_program():\n    place("mug")\n')
    assert call(folder, "continue", "last", program, "--yes").status == 2
    nameless = call(folder, "continue", "last", "--yes", given="y\n")
    assert (nameless.status, "did this happen" in nameless.err) == (2, False), "no question without a program"
    asked = call(folder, "continue", "last", "-", "--yes", given="y\n" + program.read_text())
    assert asked.status == 2, "a program is not an answer"
    assert call(folder, "continue", "last", program, "--yes", given="n\n").status == 1
    assert call(folder, "continue", mission["id"], program, "--yes", given="what?\ny\n").status == 0
    assert [one["state"] for one in missions(folder)][-1] == "done"


def test_a_wrong_answer_is_asked_for_again(folder: Path) -> None:
    (folder / "begun.py").write_text("def task_program():\n    ask('', 'Tea?', ['yes', 'no'])\n")
    call(folder, "run", "begun.py", "--yes", "--despite-problems")
    crash_during(folder, "ask")
    program = folder / "say.py"
    program.write_text("def task_program():\n    say('thanks')\n")
    assert call(folder, "continue", "last", program, "--yes", given="y\nyea\nyes\n").status == 0


def test_recover_needs_an_instruction(folder: Path) -> None:
    assert call(folder, "run", "begun.py", "--yes", "--recover", "1").status == 2


def test_a_model_that_writes_no_rest_leaves_the_status_of_the_mission(folder: Path) -> None:
    with server(PROGRAM) as model:
        program = model.answer
        model.answer = lambda one: program(one) if len(model.requests) < 2 else ""
        failed = call(folder, "run", "Bring Anne a mug.", *flags(model), "--yes", "--recover", "1")
    assert failed.status == 1
    assert "Traceback" not in failed.err
