"""`codebotler replay` shows what house rules would have stopped in programs and logs, and when."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.files import to_line
from codebotler.missions.storage.log import LogLine
from command_line import Ended, command, refused
from forked import Forked

RULES = """
rules:
  - name: vault
    says: Never go into the vault.
    always: not tr.Exists(goto("vault"))
  - name: no-means-no
    says: Ask nobody who says no.
    always: not tr.Exists(answered("no"))
  - name: report
    says: Say that it is done.
    finally: tr.Exists(say("done"))
  - name: hush
    says: Do not sing.
    always: not tr.Exists(say("la la"))
    refuse: true
"""
WORLD = """
robot: hall
rooms: [hall, vault, office]
people: {office: [{name: Ann, answers: ["no"]}]}
"""
CATCH = "try:\n        say('la la')\n    except Exception:\n        say('done')"
BODIES = {
    "before": "say('done')\n    go_to('vault')",
    "late": "go_to('office')\n    ask('Ann', 'Tea?', ['yes', 'no'])\n    say('done')",
    "at-end": "go_to('office')",
    "kept": "say('done')",
    "failed": "pick('mug')\n    go_to('vault')",
    "endless": "while True:\n        say('done')",
    "refused": CATCH,
    "wild": "getattr(str, 'upper')\n    go_to('vault')",
    "wrong": "say('done'",
}
EFFECTS = {
    "before": ("stopped", "vault", "before", 3, 'going to "vault"'),
    "late": ("stopped", "no-means-no", "late", 3, 'the answer "no" to "Tea?"'),
    "at-end": ("finished", "report", "at the end", None, ""),
    "kept": ("finished", "", "", None, ""),
    "failed": ("PickInvalidObject", "", "", 2, ""),
    "endless": ("TimeoutError", "", "", 3, ""),
    "refused": ("finished", "hush", "before", None, 'saying "la la"'),
    "wild": ("stopped", "vault", "before", 3, 'going to "vault"'),
    "wrong": ("SyntaxError", "", "", 2, ""),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rules.yaml").write_text(RULES)
    (tmp_path / "world.yaml").write_text(WORLD)
    (tmp_path / "plans").mkdir()
    for name, body in BODIES.items():
        (tmp_path / "plans" / f"{name}.py").write_text(f"def task_program():\n    {body}\n")
    return tmp_path


def replay(folder: Path, *arguments: str) -> Ended:
    environment = {
        **os.environ,
        "NO_COLOR": "1",
        "COLUMNS": "200",
        "CODEBOTLER_HOME": str(folder / "home"),
    }
    return command("codebotler", "replay", *arguments, cwd=folder, environment=environment)


def effects(folder: Path, *arguments: str) -> dict[str, tuple[Any, ...]]:
    ended = replay(folder, *arguments, "--rules", "rules.yaml", "--json")
    assert (ended.status, ended.err) == (0, "")
    keys = ("ended", "rule", "when", "line", "step")
    return {Path(row["file"]).stem: tuple(map(row.get, keys)) for row in json.loads(ended.out)["files"]}


@pytest.mark.slow
def test_each_program_is_a_row_with_its_end_and_the_rule(folder: Path) -> None:
    found = effects(folder, "plans", "--world", "world.yaml")
    assert found == EFFECTS
    assert list(found) == sorted(found)


@pytest.mark.slow
def test_an_endless_program_ends_after_a_thousand_calls(folder: Path) -> None:
    ended = replay(folder, "plans/endless.py", "--world", "world.yaml", "--rules", "rules.yaml", "--json")
    (row,) = json.loads(ended.out)["files"]
    assert "1,000" in row["error"]


@pytest.mark.slow
def test_the_table_ends_with_numbers_for_each_rule(folder: Path) -> None:
    chosen = [f"plans/{name}.py" for name in ("before", "late", "at-end", "kept", "failed", "wild")]
    ended = replay(folder, *chosen, "--world", "world.yaml", "--rules", "rules.yaml")
    assert ended.status == 0
    assert re.search(r"^plans/before.py +stopped +vault +before +line 3: going to", ended.out, re.MULTILINE)
    assert "6 files: 2 before, 1 late, 1 at the end, 2 not at all (1 of these did not finish)" in ended.out
    assert re.search(
        r"^rule +before +late +at the end\nvault +2 +0 +0\nno-means-no +0 +1 +0\n", ended.out, re.MULTILINE
    )


@pytest.mark.slow
def test_without_a_world_programs_run_in_the_rooms_they_name(folder: Path) -> None:
    found = effects(folder, "plans/failed.py", "plans/kept.py")
    assert found["failed"][:4] == ("stopped", "vault", "before", 3)
    assert found["kept"] == EFFECTS["kept"]


@pytest.mark.slow
def test_equal_programs_have_a_row_each(folder: Path) -> None:
    (folder / "plans" / "again.py").write_text((folder / "plans" / "kept.py").read_text())
    assert effects(folder, "plans/again.py", "plans/kept.py") == dict.fromkeys(
        ("again", "kept"), EFFECTS["kept"]
    )


# --- logs


def event(kind: str, /, **data: object) -> dict[str, object]:
    return {"time": 1.0, "clock": 0.0, "event": kind, **data}


def call_lines(skill: str, end: str = "result", result: str | None = None, **given: object) -> list[LogLine]:
    call = event("skill", number=1, skill=skill, line=7, arguments=given)
    return [call, event(end, number=1, skill=skill, result=result)]


TO_OFFICE = call_lines("go_to", location="office")
TO_VAULT = call_lines("go_to", location="vault")
FAILURE = call_lines("go_to", "cancelled", location="office")
QUESTION = call_lines("ask", result="no", person="", question="Tea?", options=["yes", "no"])
PICK = call_lines("pick", obj="mug")
SAY = call_lines("say", message="done")
SONG = [event("rule", rule="x", says="X.", formula="x", what=["say", "la la"], prevented=True, line=3)]
END = [event("state", state="done")]
LOGS = {
    "kept": (SAY + TO_OFFICE + PICK + END, ("finished", "", "", None, "")),
    "before": (SAY + TO_VAULT + END, ("stopped", "vault", "before", 7, 'going to "vault"')),
    "late": (QUESTION + SAY + END, ("stopped", "no-means-no", "late", 7, 'the answer "no" to "Tea?"')),
    "at-end": (TO_OFFICE + END, ("finished", "report", "at the end", None, "")),
    "prevented": (SAY + SONG + END, ("stopped", "hush", "before", 3, 'saying "la la"')),
    "stopped": ([*FAILURE, event("state", state="stopped", line=7)], ("stopped", "", "", 7, "")),
}


def test_logs_are_judged_without_running_anything(folder: Path) -> None:
    (folder / "mission").mkdir()
    for name, (lines, _) in LOGS.items():
        (folder / "mission" / f"{name}.jsonl").write_bytes(b"".join(map(to_line, lines)))
    assert effects(folder, "mission") == {name: effect for name, (_, effect) in LOGS.items()}


def test_a_rule_about_a_room_uses_the_positions_in_the_log(folder: Path) -> None:
    rule = 'not tr.Exists(at("office", say(".*")))'
    (folder / "rules.yaml").write_text(f"rules: [{{name: quiet, says: Hush., always: '{rule}'}}]")
    for name, lines in {"there": TO_OFFICE + SAY, "here": FAILURE + SAY, "map": SAY}.items():
        (folder / f"{name}.jsonl").write_bytes(b"".join(map(to_line, lines)))
    there = {"name": "office", "footprint": [[0, 0], [1, 0], [1, 1]], "stand_at": [0, 0]}
    with (folder / "map.jsonl").open("ab") as file:
        file.write(to_line(event("map", rooms=[there], robot="office")))
    found = effects(folder, "there.jsonl", "here.jsonl", "map.jsonl")
    assert {name: effect[1] for name, effect in found.items()} == {
        "there": "quiet",
        "here": "",
        "map": "quiet",
    }


def test_leaving_rules_are_judged_before_drives_in_a_log(folder: Path) -> None:
    rule = 'tr.Exists(say("done"))'
    (folder / "rules.yaml").write_text(f"rules: [{{name: bye, says: Say it., leaving: '{rule}'}}]")
    kept_back = event(
        "rule", rule="x", says="X.", formula="x", what=["goto", "office"], prevented=True, line=3
    )
    for name, lines in {"did": TO_OFFICE, "tried": [kept_back], "kept": SAY + TO_OFFICE, "end": []}.items():
        (folder / f"{name}.jsonl").write_bytes(b"".join(map(to_line, [*lines, *END])))
    found = effects(folder, "did.jsonl", "tried.jsonl", "kept.jsonl", "end.jsonl")
    assert {name: effect[1:3] for name, effect in found.items()} == {
        "did": ("bye", "before"),
        "tried": ("bye", "before"),
        "kept": ("", ""),
        "end": ("bye", "at the end"),
    }


def test_own_skills_in_a_log_are_judged_by_their_own_names(folder: Path) -> None:
    (folder / "own.py").write_text(
        "from codebotler import Simulation, skill\n\n\n@skill\n"
        'def pour(sim: Simulation, what: str) -> None:\n    """Pour."""\n'
    )
    rule = 'not tr.AtLeast(pour("tea"), 2)'
    (folder / "rules.yaml").write_text(f"rules: [{{name: one, says: Once., always: '{rule}'}}]")
    failed = [event("error", number=1, skill="pour", kind="Spilled", message="spilled")]
    lines = [call_lines("pour", what="tea")[0], *failed, *call_lines("pour", what="tea")]
    (folder / "pour.jsonl").write_bytes(b"".join(map(to_line, lines)))
    assert effects(folder, "pour.jsonl", "--skills", "own.py")["pour"][:3] == ("stopped", "one", "before")


@pytest.mark.slow
def test_a_mission_is_judged_like_its_program(folder: Path) -> None:
    environment = {**os.environ, "CODEBOTLER_HOME": str(folder / "home")}
    for name in ("before", "late", "at-end", "kept"):
        options = ("--world", "world.yaml", "--yes", "--despite-problems", "--speed", "0")
        command("codebotler", "run", f"plans/{name}.py", *options, cwd=folder, environment=environment)
    found = [*effects(folder, "home/missions").values()]
    assert found == [EFFECTS[name] for name in ("before", "late", "at-end", "kept")]


# --- bad input


@pytest.mark.parametrize(
    ("name", "content", "line"),
    [
        ("empty.py", b"", None),
        ("latin.py", b"say('\xe9')", 1),
        ("text.jsonl", b"hello\n", 1),
        ("own.jsonl", to_line(call_lines("pour")[0]), None),
        ("old.jsonl", to_line(call_lines("say", message="a", volume=3)[0]), None),
        ("map.jsonl", to_line(event("map", rooms=[{}], robot="hall")), None),
    ],
)
def test_a_file_that_cannot_be_read_is_a_row(
    folder: Path, name: str, content: bytes, line: int | None
) -> None:
    (folder / name).write_bytes(content)
    ended = replay(folder, name, "--rules", "rules.yaml", "--json")
    (row,) = json.loads(ended.out)["files"]
    assert (ended.status, row["ended"], row["line"], bool(row["error"])) == (0, "unreadable", line, True)


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (["gone.py", "--rules", "rules.yaml"], "gone.py"),
        (["home", "--rules", "rules.yaml"], "home"),
        (["rules.yaml", "--rules", "rules.yaml"], "rules.yaml"),
        (["plans"], None),
        (["plans", "--rules", "gone.yaml"], "gone.yaml"),
    ],
)
def test_unusable_arguments_are_refused(folder: Path, arguments: list[str], file: str | None) -> None:
    (folder / "home").mkdir()
    assert refused("replay", *arguments, name="codebotler", cwd=folder).file == file


@pytest.mark.slow
def test_ctrl_c_ends_replay_at_once(folder: Path) -> None:
    for number in range(40):
        body = f"n = {number}\n    while True:\n        sum(range(10**7))"  # Each tick takes long.
        (folder / "plans" / f"{number}.py").write_text(f"def task_program():\n    {body}\n")
    arguments = ("replay", "plans", "--rules", "rules.yaml")
    with Forked("codebotler", *arguments, cwd=folder, environment=os.environ) as process:
        threads = Path(f"/proc/{process.pid}/task")
        while not any(children.read_text() for children in threads.glob("*/children")):
            time.sleep(0.01)  # Wait until the engine has started.
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert (process.returncode, err) == (130, "codebotler: stopped\n")
