"""Commands show, save and require contracts."""

import json
from pathlib import Path

import pytest
import yaml

from command_line import command, refused

WORLD = "robot: hall\nrooms: [hall, kitchen, lab]\nobjects: {kitchen: [mug]}\n"
GREET = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"
FETCH = "def task_program():\n    go_to('kitchen')\n    pick('mug')\n    go_to('hall')\n    place('mug')\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in {"world.yaml": WORLD, "greet.py": GREET, "fetch.py": FETCH}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_contract_is_shown_and_saved(folder: Path) -> None:
    ended = command(
        "codebotler",
        "check",
        "greet.py",
        "--world",
        "world.yaml",
        "--contract",
        "--save-contract",
        "c.yaml",
        cwd=folder,
    )
    assert ended.status == 0
    assert 'go to "kitchen"' in ended.out
    assert "asks nobody" in ended.out
    assert set(yaml.safe_load((folder / "c.yaml").read_text())["skills"]) == {"go_to", "say"}


def test_a_program_beyond_a_saved_contract_is_rejected(folder: Path) -> None:
    world = ("--world", "world.yaml")
    command("codebotler", "check", "greet.py", *world, "--save-contract", "c.yaml", cwd=folder)
    same = command("codebotler", "check", "greet.py", *world, "--within", "c.yaml", cwd=folder)
    other = command("codebotler", "check", "fetch.py", *world, "--within", "c.yaml", "--json", cwd=folder)
    assert (same.status, other.status) == (0, 1)
    problems = [problem["kind"] for problem in json.loads(other.out)["problems"]]
    assert problems == ["OutsideContract"] * 3  # It enters another room and uses two other skills.


def test_a_mission_stays_within_a_contract(folder: Path) -> None:
    environment = {"CODEBOTLER_HOME": str(folder), "COLUMNS": "100"}
    world = ("--world", "world.yaml")
    command("codebotler", "check", "greet.py", *world, "--save-contract", "c.yaml", cwd=folder)
    run = ("codebotler", "run", "fetch.py", *world, "--speed", "0", "--yes", "--within", "c.yaml")
    assert command(*run, cwd=folder, environment=environment).status == 1
    stopped = command(*run, "--despite-problems", cwd=folder, environment=environment)
    assert stopped.status == 1
    assert "stopped by rule approved contract" in stopped.out
    run = (*run[:2], "greet.py", *run[3:])
    assert command(*run, cwd=folder, environment=environment).status == 0


def test_a_contract_is_never_written_over_another_file(folder: Path) -> None:
    (folder / "c.yaml").write_text("mine")
    refusal = refused(
        "check",
        "greet.py",
        "--world",
        "world.yaml",
        "--save-contract",
        "c.yaml",
        name="codebotler",
        cwd=folder,
    )
    assert refusal.file == "c.yaml"
    assert (folder / "c.yaml").read_text() == "mine"


def test_a_contract_for_other_skills_is_refused(folder: Path) -> None:
    (folder / "c.yaml").write_text("version: 1\nskills:\n  fly: {}\n")
    refusal = refused("check", "greet.py", "--within", "c.yaml", name="codebotler", cwd=folder)
    assert refusal.at == ("c.yaml", 3)
