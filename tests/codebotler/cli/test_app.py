"""The command line of CodeBotler shows its help and version, and checks programs."""

import json
import os
import re
import sys
from pathlib import Path

import pytest

import command_line
from codebotler.cli.app import app
from codebotler.cli.ending import run_command_line
from command_line import Ended, Refusal, command

GOOD = """def task_program():
    go_to("kitchen")
    if is_in_room("mug"):
        pick("mug")
        go_to("start_loc")
        place("mug")
"""
BAD = """def task_program():
    go_to("kitchn")
    say(mesage)
    is_in_room("person")
    ask("person", "Tea?", ["Yes", "No"])
"""
WORLD = "robot: start_loc\nrooms: [start_loc, kitchen]\n"


def codebotler(*arguments: str | Path, given: str = "") -> Ended:
    wide = {name: value for name, value in os.environ.items() if name != "COLUMNS"} | {"NO_COLOR": "1"}
    return command("codebotler", *arguments, given=given, environment=wide)


def refusal_of(*arguments: str | Path, given: str = "") -> Refusal:
    return command_line.refused(*arguments, name="codebotler", given=given)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in (("good.py", GOOD), ("bad.py", BAD), ("world.yaml", WORLD)):
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize("arguments", [(), ("--help",)])
def test_help_lists_the_commands(arguments: tuple[str, ...]) -> None:
    status, out, err = codebotler(*arguments)
    assert (status, err) == (0, "")
    assert out.startswith("Usage: codebotler [OPTIONS] COMMAND [ARGS]...\n")
    assert re.search(r"^  check +Look for problems", out, re.MULTILINE)


def test_the_version() -> None:
    assert re.fullmatch(r"codebotler \d+\.\d+\.\d+\n", codebotler("--version")[1])


def test_unknown_command_is_refused() -> None:
    assert "'dance'" in refusal_of("dance").sentence


# --- check


def test_check_shows_the_steps_of_an_accepted_program(files: Path) -> None:
    status, out, err = codebotler("check", files / "good.py", "--world", files / "world.yaml")
    assert (status, err) == (0, "")
    first, ran, *rest = out.split("\n")
    assert first == f"accepted: no problem in {files / 'good.py'}"
    assert "5 imagined worlds" in ran
    assert rest[:3] == ["", 'rooms: "start_loc", "kitchen"', ""]
    assert rest[3].endswith('"mug" is in "kitchen"')
    assert [line.split() for line in rest[4:6]] == [
        ["1", "start_loc", "→", "kitchen"],
        ["2", "looked", "for", '"mug":', "found"],
    ]
    assert '5      put down "mug"' in rest


def test_a_rejected_program_shows_each_line_to_blame(files: Path) -> None:
    status, out, err = codebotler("check", files / "bad.py", "--world", files / "world.yaml")
    assert (status, err) == (1, "")
    assert out.startswith(f"rejected: 2 problems in {files / 'bad.py'}\n")
    assert "in all imagined worlds" in out.splitlines()[1]
    assert re.search(r'^line 2: GoToInvalidLocation: .*"kitchn".*"kitchen"$', out, re.MULTILINE)
    assert '\n  1 | def task_program():\n> 2 |     go_to("kitchn")\n  3 |     say(mesage)\n' in out
    assert re.search(r"^line 3: NameError: .*\bmesage\b", out, re.MULTILINE)
    assert '"kitchn"  failed: ' in out


def test_slow_room_pattern_is_refused(files: Path) -> None:
    (files / "slow.yaml").write_text("robot: lab\nrooms:\n  - lab\n  - (a+)+$\n")
    status, _, err = codebotler("check", files / "good.py", "--world", files / "slow.yaml")
    assert status == 2
    assert "slow.yaml, line 4: " in err
    assert "too long" in err


def test_output_says_that_rooms_are_guessed(files: Path) -> None:
    status, out, _ = codebotler("check", files / "bad.py")
    assert status == 1
    guessed = re.search(r'^rooms (.+): "kitchn", "start_loc"$', out, re.MULTILINE)
    assert guessed is not None
    assert "--world FILE" in out
    assert guessed[1] not in codebotler("check", files / "good.py", "--world", files / "world.yaml")[1]


def test_json_lists_problems_and_samples(files: Path) -> None:
    arguments = ("check", files / "bad.py", "--json", "--seed", "3", "--samples", "4")
    status, out, err = codebotler(*arguments)
    assert (status, err) == (1, "")
    data = json.loads(out)
    assert (data["accepted"], data["rooms_are_guessed"], data["seed"]) == (False, True, 3)
    assert [(p["kind"], p["line"]) for p in data["problems"]] == [("NameError", 3)]
    assert len(data["samples"]) == 4


def test_the_robot_starts_where_the_world_says(files: Path) -> None:
    (files / "start.yaml").write_text("robot: hall\nrooms: [lab, hall]\n")
    (files / "say.py").write_text("def task_program():\n    say(get_current_location())\n")
    out = codebotler("check", files / "say.py", "--world", files / "start.yaml")[1]
    assert '1      said "hall"\n' in out


def test_a_world_that_shows_the_problem_is_preferred(files: Path) -> None:
    lines = (
        "def task_program():",
        '    if ask("", "Tea?", ["Yes", "No"]) == "No":',
        '        say("oh")',
        '        place("tea")',
    )
    (files / "tea.py").write_text("\n".join(lines))
    out = codebotler("check", files / "tea.py")[1]
    assert out.startswith("rejected: 1 problem")
    assert 'asked "Tea?" [Yes | No] → No\n' in out
    assert "→ Yes" not in out
    both = codebotler("check", files / "tea.py", "--all")[1]
    assert both.index("→ No") < both.index("→ Yes")


def test_programs_for_a_connected_robot_are_checked_against_its_file(files: Path) -> None:
    cellar = "{polygon: [[2, -1], [4, -1], [4, 1], [2, 1]]}"
    places = f"places: {{dock: {{x: 0, y: 0}}, cellar: {cellar}, lab: {{x: 6, y: 0}}}}\n"
    (files / "places.yaml").write_text(places)
    (files / "rules.yaml").write_text(
        "rules: [{name: cellar, says: Never be there., always: not tr.Exists(inside('cellar'))}]\n"
    )
    (files / "robot.yaml").write_text(
        "places: places.yaml\nskills:\n"
        "  go_to: {topic: /goal, type: geometry_msgs/msg/PoseStamped, message: {pose: $place.pose}}\n"
    )
    (files / "drive.py").write_text("def task_program():\n    go_to('dock')\n    go_to('lab')\n")
    (files / "down.py").write_text("def task_program():\n    go_to('cellar')\n")
    (files / "talk.py").write_text("def task_program():\n    go_to('attic')\n    say('hello')\n")
    options = ("--connect", files / "robot.yaml", "--rules", files / "rules.yaml")
    assert codebotler("check", files / "drive.py", *options)[0] == 0  # The robot may avoid the cellar.
    assert codebotler("check", files / "down.py", *options)[0] == 1
    status, out, _ = codebotler("check", files / "talk.py", "--connect", files / "robot.yaml")
    assert status == 1
    assert "say" in out
    status, _, error = codebotler(
        "run", files / "drive.py", "--robot", "sim", "--connect", files / "robot.yaml", "--yes"
    )
    assert status == 2
    assert "ros2" in error


def test_strict_and_seed_reach_the_check(files: Path) -> None:
    (files / "asks.py").write_text('def task_program():\n    ask("", "Tea?", ["Yes", "No"])\n')
    assert codebotler("check", files / "asks.py")[0] == 0
    status, out, _ = codebotler("check", files / "asks.py", "--strict", "--samples", "20")
    assert status == 1
    assert 'where nobody is in "start_loc"' in out


@pytest.mark.parametrize(
    "reply",
    [GOOD, f"Sure!\n\n```python\n{GOOD}```\nEnjoy.\n", "    " + GOOD.split("\n", 1)[1].lstrip(" ")],
)
def test_standard_input_may_be_a_whole_reply(reply: str) -> None:
    status, out, _ = codebotler("check", "-", given=reply)
    assert (status, out.split("\n")[0]) == (0, "accepted: no problem in the program")


def test_blank_lines_on_standard_input_count() -> None:
    assert "line 5: NameError" in codebotler("check", "-", given="\n\n" + BAD)[1]


def test_unusable_input_is_refused_in_one_sentence(files: Path) -> None:
    for path, fault in ((files / "gone.py", "No such file"), (files, "Is a directory")):
        refusal = refusal_of("check", path)
        assert refusal.at == (str(path), None)
        assert fault in refusal.sentence
    assert refusal_of("check", "fetch me a mug").sentence.startswith("fetch me a mug: ")
    assert "standard input: " in refusal_of("check", "-", given=" \n").sentence
    (files / "empty.py").write_text("\n")
    refusal = refusal_of("check", files / "empty.py")
    assert refusal.at == (str(files / "empty.py"), None)
    assert "no program" in refusal.sentence
    (files / "bytes.py").write_bytes(b"def \xff")
    assert "UTF-8" in refusal_of("check", files / "bytes.py").sentence
    assert refusal_of("check", files / "good.py", "--world", files / "no.yaml").file == str(files / "no.yaml")
    (files / "wrong.yaml").write_text("robot: hall\nrooms: [lab]\n")
    refusal = refusal_of("check", files / "good.py", "--world", files / "wrong.yaml")
    assert refusal.at == (str(files / "wrong.yaml"), 1)
    assert "samples" in refusal_of("check", files / "good.py", "--samples", "0").sentence


def test_control_characters_are_escaped(files: Path) -> None:
    (files / "odd.py").write_text('def task_program():\n    say("a\x1b[31mb")\n    go_to("\x1b[2J")\n')
    out = codebotler("check", files / "odd.py", "--world", files / "world.yaml")[1]
    assert "\x1b" not in out
    assert "\\x1b[2J" in out


def test_error_on_windows_names_wsl(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(SystemExit) as end:
        run_command_line(app, "codebotler")
    assert end.value.code == 1
    assert re.fullmatch(r"codebotler: .*\bWSL\n", capsys.readouterr().err)


def test_usable_models_are_listed(tmp_path: Path) -> None:
    """A server that happens to run on this machine puts its own models first in the list."""
    environment = {
        **os.environ,
        "ANTHROPIC_API_KEY": "sk-ant-none-of-yours",
        "CODEBOTLER_HOME": str(tmp_path),
    }
    status, out, err = command("codebotler", "models", environment={**environment, "COLUMNS": "100"})
    assert (status, err) == (0, "")
    assert re.search(r"^--model anthropic:\S+ +ANTHROPIC_API_KEY is set$", out, re.MULTILINE)
    assert out.rstrip().endswith("default model: recorded:careful")
    assert "none-of-yours" not in out
    (tmp_path / "config.yaml").write_text("model: anthropic:claude-sonnet-4-5\n")
    listed = json.loads(command("codebotler", "models", "--json", environment=environment)[1])
    assert {"name", "why", "base_url"} == set(listed[0])
    assert listed[-1]["name"] == "recorded:hasty"
    shown = command("codebotler", "generate", "Go.", "--show-prompt", environment=environment)
    assert shown.status == 0
    refusal = command("codebotler", "generate", "Go.", "--model", "recorded", environment=environment)
    assert "\nfor other instructions, add --model " in refusal.err
