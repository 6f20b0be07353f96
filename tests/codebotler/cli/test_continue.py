"""`codebotler continue` and `run --recover`: the rest of a mission, by a model or by a person."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from codebotler.cli.operating.run import Request, run
from codebotler.core.world import Room, World
from codebotler.core.world_file import read_world
from codebotler.missions.storage.log import EVENTS_FILE, SUMMARY_FILE
from codebotler.missions.storage.store import read_missions
from codebotler.robots.simulated import Simulated
from codebotler.web.console import Console
from command_line import Ended, command
from doubles import Several
from ended import cut, failed_mission, line_of
from server import Request as ModelRequest
from server import Server

WORLD = """
robot: hall
rooms: [hall, kitchen, lab]
objects: {kitchen: [mug]}
people: {lab: [{name: Anne, answers: ["no"]}]}
"""
BEGUN = """def task_program():
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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("begun.py", BEGUN), ("rest.py", REST), ("again.py", AGAIN), ("world.yaml", WORLD)):
        (tmp_path / name).write_text(text)
    return tmp_path


def ended(folder: Path, name: str, *arguments: str | Path, given: str = "") -> Ended:
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
    found: list[dict[str, Any]] = json.loads(ended(folder, "missions", "--json").out)
    return found


def crashed(folder: Path, skill: str) -> dict[str, Any]:
    """The only mission, as if the tool had crashed during the first call of a skill."""
    (mission,) = missions(folder)
    home = folder / "home" / "missions" / mission["id"]
    log = (home / EVENTS_FILE).read_text().splitlines(keepends=True)
    calls = next(n for n, line in enumerate(log, 1) if f'"skill": "{skill}"' in line)
    (home / EVENTS_FILE).write_text("".join(log[:calls]))
    (home / SUMMARY_FILE).write_text(json.dumps({**mission, "state": "running", "ended": None}))
    return mission


def calls(folder: Path, mission: str) -> list[str]:
    """The skills that a mission called, with their first argument."""
    log = (folder / "home" / "missions" / mission / EVENTS_FILE).read_text().splitlines()
    rows = [line for line in map(json.loads, log) if line["event"] == "skill"]
    return [f"{row['skill']} {next(iter(row['arguments'].values()), '')}".strip() for row in rows]


def server(*programs: str) -> Server:
    """A server that replies with one program after another."""
    one = Server()
    one.answer = lambda _: f"```python\n{programs[len(one.requests) - 1]}```\n"
    return one


def asked(request: ModelRequest) -> str:
    return str(request.body["messages"][-1]["content"])


def at(one: Server) -> tuple[str, ...]:
    return "--model", "openai-chat:tiny", "--base-url", one.url


def test_a_program_of_a_person_does_the_rest(folder: Path) -> None:
    assert ended(folder, "run", "begun.py", "--yes").status == 1
    done = ended(folder, "continue", "last", "rest.py", "--yes")
    assert (done.status, done.err) == (0, "")
    before, after = missions(folder)
    assert (before["state"], after["state"], after["continues"]) == ("failed", "done", before["id"])
    assert calls(folder, after["id"]) == ["ask Anne", "place mug", "say done"]


def test_a_mission_that_did_nothing_is_continued_with_its_own_program(folder: Path) -> None:
    world = read_world(folder / "world.yaml")
    mission = failed_mission(folder / "home", BEGUN, world)
    cut(mission, line_of(mission, "go_to", "skill"))
    done = ended(folder, "continue", "last", "--yes")  # no model has a program for this instruction
    before, after = missions(folder)
    assert (after["continues"], after["program"]) == (before["id"], before["program"]), done.err
    assert calls(folder, after["id"])[0] == "go_to kitchen"


def test_a_program_that_forgets_what_is_held_is_not_run(folder: Path) -> None:
    ended(folder, "run", "begun.py", "--yes")
    refused = ended(folder, "continue", "last", "again.py", "--yes")
    assert refused.status == 1
    assert "PickWhileHolding" in refused.out
    assert missions(folder)[-1]["state"] == "failed"


@pytest.mark.slow
def test_a_model_is_shown_what_happened_and_writes_the_rest(folder: Path) -> None:
    with server(BEGUN, REST) as model:
        assert ended(folder, "run", "Bring Anne a mug.", *at(model), "--yes").status == 1
        assert ended(folder, "continue", *at(model), "--yes").status == 0
    request = asked(model.requests[-1])
    for words in ("AskNoPerson", 'in "kitchen": picked up "mug"', 'in "lab" and holds "mug"'):
        assert words in request
    assert "Bring Anne a mug." in str(model.requests[-1].body["messages"])
    assert missions(folder)[-1]["state"] == "done"


def test_recover_continues_by_itself_within_the_approved_contract(folder: Path) -> None:
    begun = BEGUN.replace('"Bob"', '"Anne" if is_in_room("mug") else "Bob"')
    with server(begun, REST) as model:
        done = ended(folder, "run", "Bring Anne a mug.", *at(model), "--recover", "1", given="y\n")
    assert done.status == 0, done.err
    assert [one["state"] for one in missions(folder)] == ["failed", "done"]
    assert len(model.requests) == 2


@pytest.mark.parametrize("times", [0, 1])
def test_recover_gives_up_after_so_many_times(folder: Path, times: int) -> None:
    fails = 'def task_program():\n    go_to("lab")\n    ask("Bob", "Tea?", ["yes"])\n'
    with server(*[fails] * (times + 1)) as model:
        gave_up = ended(folder, "run", "Ask Bob.", *at(model), "--yes", "--recover", str(times))
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
    model = Several(('def task_program():\n    go_to("kitchen")\n    pick("mug")\n', REST))
    console = Console(Interrupted(world, speed=None), tmp_path, lambda _: model, models=("m",), world=world)
    handlers = {one: signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        status = run(console, Request("Fetch the mug.", yes=True, recoveries=1))
    finally:
        for one, handler in handlers.items():
            signal.signal(one, handler)
    assert (status, len(read_missions(tmp_path))) == (128 + signal.SIGINT, 1)


def test_recover_asks_for_approval_of_what_was_not_approved(folder: Path) -> None:
    with server(BEGUN, WIDER) as model:
        done = ended(folder, "run", "Bring Anne a mug.", *at(model), "--recover", "1", given="y\nn\n")
    assert done.status == 1
    assert done.err.count("[y/N]") == 2
    assert [one["state"] for one in missions(folder)] == ["failed", "stopped"]


def test_the_rest_of_a_typed_program_must_be_typed(folder: Path) -> None:
    ended(folder, "run", "begun.py", "--yes")
    assert ended(folder, "continue", "--yes").status == 2


def test_an_unsure_step_needs_a_persons_word(folder: Path) -> None:
    ended(folder, "run", "begun.py", "--yes")
    mission = crashed(folder, "pick")
    program = folder / "place.py"
    program.write_text('def task_program():\n    place("mug")\n')
    assert ended(folder, "continue", "last", program, "--yes").status == 2
    nameless = ended(folder, "continue", "last", "--yes", given="y\n")
    assert (nameless.status, "did this happen" in nameless.err) == (2, False), "a word in vain"
    asked = ended(folder, "continue", "last", "-", "--yes", given="y\n" + program.read_text())
    assert asked.status == 2, "a program is no answer"
    assert ended(folder, "continue", "last", program, "--yes", given="n\n").status == 1
    assert ended(folder, "continue", mission["id"], program, "--yes", given="what?\ny\n").status == 0
    assert [one["state"] for one in missions(folder)][-1] == "done"


def test_a_wrong_answer_is_asked_for_again(folder: Path) -> None:
    (folder / "begun.py").write_text("def task_program():\n    ask('', 'Tea?', ['yes', 'no'])\n")
    ended(folder, "run", "begun.py", "--yes", "--despite-problems")
    crashed(folder, "ask")
    program = folder / "say.py"
    program.write_text("def task_program():\n    say('thanks')\n")
    assert ended(folder, "continue", "last", program, "--yes", given="y\nyea\nyes\n").status == 0


def test_recover_needs_an_instruction(folder: Path) -> None:
    assert ended(folder, "run", "begun.py", "--yes", "--recover", "1").status == 2


def test_a_model_that_writes_no_rest_leaves_the_status_of_the_mission(folder: Path) -> None:
    with server(BEGUN) as model:
        program = model.answer
        model.answer = lambda one: program(one) if len(model.requests) < 2 else ""
        failed = ended(folder, "run", "Bring Anne a mug.", *at(model), "--yes", "--recover", "1")
    assert failed.status == 1
    assert "Traceback" not in failed.err
