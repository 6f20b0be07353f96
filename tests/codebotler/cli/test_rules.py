"""House rules are shown on the command line, and bind every command that takes them."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest

import command_line
from codebotler.robots.simulated import OFFICE
from command_line import Ended, command

RULES = """
rules:
  - name: vault
    says: Never go into the vault.
    always: not tr.Exists(goto("vault"))
  - name: knock
    says: Knock before you enter an office.
    always: >-
      not tr.Last(goto("office")) or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))
"""
WORLD = "robot: hall\nrooms: [hall, vault, office]\n"
SLY = "def task_program():\n    go_to('hall')\n    go_to('vault')\n"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in (
        ("rules.yaml", RULES),
        ("world.yaml", WORLD),
        ("sly.py", SLY),
        ("bad.yaml", "rules: 3"),
    ):
        (tmp_path / name).write_text(text)
    return tmp_path


def codebotler(folder: Path, *arguments: str, **variables: str) -> Ended:
    environment = {**os.environ, "NO_COLOR": "1", "CODEBOTLER_HOME": str(folder / "home"), **variables}
    return command("codebotler", *arguments, cwd=folder, environment=environment)


def test_rules_are_shown_with_examples(files: Path) -> None:
    ended = codebotler(files, "rules", "rules.yaml", "--world", "world.yaml")
    assert ended.status == 0
    assert "knock  Knock before you enter an office.\n" in ended.out
    assert '  keeps it\n    1  says "knock"\n    2  drives to "office"\n' in ended.out
    assert '  breaks it\n    1  drives to "vault"\n' in ended.out
    rules = json.loads(codebotler(files, "rules", "rules.yaml", "--json").out)
    assert [(rule["name"], rule["breaks"][0]["text"], rule["warnings"]) for rule in rules] == [
        ("vault", "vault", []),
        ("knock", "office", []),
    ]


@pytest.mark.parametrize("named", ["option", "variable"])
def test_a_program_that_breaks_a_rule_is_rejected_and_not_run(files: Path, named: str) -> None:
    more = ["--rules", "rules.yaml"] if named == "option" else []
    variables = {} if more else {"CODEBOTLER_RULES": "rules.yaml"}
    sentence = 'line 3: RuleViolation: the rule "vault" forbids going to "vault": Never go into the vault'
    for arguments in (["check", "sly.py"], ["run", "sly.py", "--yes", "--speed", "0"]):
        ended = codebotler(files, *arguments, "--world", "world.yaml", *more, **variables)
        assert ended.status == 1
        assert sentence in " ".join(ended.out.split())


@pytest.mark.parametrize(
    "arguments",
    [["check", "sly.py"], ["run", "sly.py", "--yes"], ["generate", "Say hello"], ["serve", "--port", "0"]],
)
def test_a_room_that_a_rule_names_and_the_world_lacks_is_refused(files: Path, arguments: list[str]) -> None:
    typo = (files / "rules.yaml").read_text().replace('goto("vault")', 'goto("valut")')
    (files / "typo.yaml").write_text(typo)
    ended = codebotler(files, *arguments, "--world", "world.yaml", "--rules", "typo.yaml")
    assert (ended.status, ended.out) == (2, "")
    assert re.search(r'typo.yaml, line 5: the rule "vault" names the room "valut".*"vault"', ended.err)


def test_a_rule_ends_a_program_that_runs_despite_problems(files: Path) -> None:
    force = ("--yes", "--despite-problems", "--speed", "0", "--rules", "rules.yaml")
    ended = codebotler(files, "run", "sly.py", "--world", "world.yaml", *force)
    assert ended.status == 1
    assert 'the rule "vault" prevented going to "vault"' in ended.out
    assert "stopped by rule vault" in ended.out
    assert "stopped: stopped" not in ended.out + codebotler(files, "missions", "last").out
    shown = codebotler(files, "missions", "last")
    assert 'the rule "vault" prevented going to "vault"' in shown.out


def test_prompt_lists_the_rules(files: Path) -> None:
    ended = codebotler(files, "generate", "Say hello", "--show-prompt", "--rules", "rules.yaml")
    assert "- Never go into the vault.\n- Knock before you enter an office." in ended.out
    plain = codebotler(files, "generate", "Say hello", "--show-prompt")
    assert "vault" not in plain.out


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "sly.py"],
        ["generate", "Say hello"],
        ["run", "sly.py", "--yes"],
        ["serve", "--port", "0"],
    ],
)
def test_rules_that_cannot_be_read_end_a_command_before_anything_else(
    files: Path, arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(files)
    refused = command_line.refused(*arguments, "--rules", "bad.yaml", name="codebotler")
    assert refused.at == ("bad.yaml", 1)
    assert '"rules" is 3, but it should be a list' in refused.sentence
    missing = command_line.refused(*arguments, "--rules", "none.yaml", name="codebotler")
    assert "none.yaml" in str(missing)
    assert not (files / "home").exists()


@pytest.mark.parametrize(
    "arguments",
    [["check", "sly.py"], ["rules", "anchor.yaml"], ["run", "sly.py", "--yes", "--speed", "0"]],
)
def test_a_rule_that_other_words_for_a_room_evade_is_refused_at_start(
    files: Path, arguments: list[str]
) -> None:
    (files / "anchor.yaml").write_text(RULES.replace('goto("vault")', 'goto("^vault$")'))
    (files / "regex.yaml").write_text(WORLD.replace("vault", "vault|safe"))
    rules = [] if "anchor.yaml" in arguments else ["--rules", "anchor.yaml"]
    ended = codebotler(files, *arguments, "--world", "regex.yaml", *rules)
    assert ended.status == 2
    assert 'the rule "vault" does not cover "safe"' in " ".join(ended.err.split())
    assert "Traceback" not in ended.err


def test_warning_names_a_skill_whose_steps_rules_do_not_see(files: Path) -> None:
    (files / "own.py").write_text(
        "from codebotler import Simulation, skill\n@skill\ndef tour(sim: Simulation) -> None:\n"
        "    'Tour.'\n    sim.drive('hall')\n"
    )
    (files / "good.py").write_text("def task_program():\n    tour()\n")
    own = ["--skills", "own.py", "--world", "world.yaml"]
    for arguments in (
        ["check", "good.py", "--rules", "rules.yaml"],
        ["rules", "rules.yaml"],
        ["run", "good.py", "--yes", "--speed", "0", "--rules", "rules.yaml"],
    ):
        ended = codebotler(files, *arguments, *own)
        assert ended.status == 0, ended
        assert "do not see what the skill tour makes the robot do" in " ".join(ended.err.split())


THROUGH = "def task_program():\n    go_to('printer room 1')\n    go_to('printer room 3')\n"
NEVER_INSIDE = """
rules:
  - name: printer
    says: Never be in printer room 2.
    always: not tr.Exists(inside("printer room 2"))
"""


def test_a_rule_about_the_robots_position_holds_on_the_way(files: Path) -> None:
    (files / "inside.yaml").write_text(NEVER_INSIDE)
    (files / "through.py").write_text(THROUGH)
    (files / "office.yaml").write_text(OFFICE.read_text())
    given = ("--world", "office.yaml", "--rules", "inside.yaml")
    found = json.loads(codebotler(files, "check", "through.py", "--json", *given).out)
    assert [(one["kind"], one["line"]) for one in found["problems"]] == [("RuleViolation", 3)]
    ended = codebotler(files, "run", "through.py", "--yes", "--despite-problems", "--speed", "0", *given)
    assert ended.status == 1
    assert "stopped by rule printer in line 3" in ended.out


def test_rules_that_name_no_destination_need_no_note_about_goto(files: Path) -> None:
    (files / "silent.yaml").write_text(
        "rules: [{name: look, says: Look after a drive., "
        'always: \'tr.AfterLast(goto(".*")).Exists(check(".*")) or not tr.Exists(say(".*"))\'}]'
    )
    assert codebotler(files, "rules", "silent.yaml").err == ""


def test_note_about_destinations_is_shown_unless_a_rule_is_about_poses(files: Path) -> None:
    (files / "inside.yaml").write_text(NEVER_INSIDE)
    assert "destinations" in codebotler(files, "rules", "rules.yaml").err
    shown = codebotler(files, "rules", "inside.yaml", "--json")
    assert "destinations" not in shown.err
    assert json.loads(shown.out)[0]["breaks"] == [{"step": 1, "kind": "inside", "text": "printer room 2"}]


@pytest.mark.parametrize("room", ["printer room 9", "^lab$", "lab 3"])
def test_a_rule_about_poses_must_name_a_room_of_the_world(files: Path, room: str) -> None:
    (files / "inside.yaml").write_text(NEVER_INSIDE.replace('"printer room 2"', f'"{room}"'))
    (files / "labs.yaml").write_text("robot: hall\nrooms: [hall, 'lab [0-9]']\n")
    ended = codebotler(files, "check", "sly.py", "--world", "labs.yaml", "--rules", "inside.yaml")
    assert ended.status == 2
    assert re.search("inside.yaml, line 5: the rule", ended.err)
