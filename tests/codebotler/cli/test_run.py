"""The commands around missions check, ask, run and stop programs, and show past missions."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from mcap.reader import make_reader

from codebotler.core.errors import UserError
from codebotler.core.files import home
from codebotler.models.recorded import RECORDED_NOTICE, open_recorded
from command_line import Ended, command
from forked import Forked
from processes import are_gone, children_of
from roboeval.suites.load import Suite
from server import Fault, Server

GOOD = """def task_program():
    go_to("kitchen")
    if is_in_room("mug"):
        pick("mug")
        say("I have it")
"""
BAD = 'def task_program():\n    go_to("cellar")\n'
FAR = """def task_program():
    for _ in range(9):
        try:
            for room in get_all_rooms():
                go_to(room)
        except BaseException:
            pass
"""
WORLD = "robot: hall\nrooms: [hall, kitchen, study, lab]\nobjects: {kitchen: [mug]}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("good.py", GOOD), ("bad.py", BAD), ("far.py", FAR), ("world.yaml", WORLD)):
        (tmp_path / name).write_text(text)
    return tmp_path


def variables(folder: Path) -> dict[str, str]:
    return {**os.environ, "CODEBOTLER_HOME": str(folder / "home"), "COLUMNS": "100", "NO_COLOR": "1"}


Process = Forked | subprocess.Popen[str]


def start(folder: Path, *arguments: str | Path, wrapper: Sequence[str] = ()) -> Process:
    """Start a command in a process of its own, to which signals can be sent."""
    if not wrapper:
        return Forked("codebotler", *arguments, cwd=folder, environment=variables(folder))
    return subprocess.Popen(
        [*wrapper, sys.executable, "-m", "codebotler", *map(str, arguments)],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=variables(folder),
    )


def call(folder: Path, *arguments: str | Path, given: str = "") -> Ended:
    return command("codebotler", *arguments, cwd=folder, given=given, environment=variables(folder))


def run(folder: Path, *arguments: str | Path, given: str = "") -> Ended:
    return call(folder, "run", *arguments, "--world", "world.yaml", "--speed", "0", given=given)


def states(folder: Path) -> list[str]:
    status, out, _ = call(folder, "missions", "--json")
    assert status == 0
    return [mission["state"] for mission in json.loads(out)]


def story_lines(out: str) -> list[str]:
    """Return the lines printed while the robot worked, without times."""
    _, _, story = out.partition("running on the robot simulated\n")
    return [re.sub(r"^ *([\d.]+ s  )?", "", line) for line in story.splitlines()]


# --- run


def test_program_is_checked_then_run(folder: Path) -> None:
    status, out, err = run(folder, "good.py", "--yes")
    assert (status, err) == (0, "")
    assert out.startswith("accepted: no problem in good.py\n")
    drives = [line for line in story_lines(out) if not line.startswith("at (")]
    assert drives[:6] == [
        'drives to "kitchen"',
        'looks for "mug"',
        "→ found",
        'picks up "mug"',
        'says "I have it"',
        "done",
    ]
    assert states(folder) == ["done"]


@pytest.mark.parametrize(("answer", "status"), [("y\n", 0), ("Yes\n", 0), ("n\n", 1), ("\n", 1), ("", 1)])
def test_person_is_asked(folder: Path, answer: str, status: int) -> None:
    found, out, err = run(folder, "good.py", given=answer)
    assert found == status
    assert re.search(r"\bsimulated\b.*\? \[y/N\] ", err)
    assert ("drives to" in out.partition("running on")[2]) == (status == 0)
    assert states(folder) == [["done", "stopped"][status]]


def test_program_with_problems_runs_only_with_despite_problems(folder: Path) -> None:
    status, out, err = run(folder, "bad.py", "--yes")
    assert status == 1
    assert re.search('line 2: GoToInvalidLocation: .*"cellar"', out)
    assert "--despite-problems" in err
    assert "running on" not in out
    status, out, _ = run(folder, "bad.py", "--yes", "--despite-problems")
    assert status == 1
    drives, *said = story_lines(out)[:3]
    assert drives == 'drives to "cellar"'
    assert re.match('GoToInvalidLocation: .*"cellar"', said[0])
    assert re.match(r'failed .*\bline 2: GoToInvalidLocation: .*"cellar"', said[1])
    assert states(folder) == ["failed", "failed"]


def test_warning_names_unknown_rooms_before_the_robot_moves(folder: Path) -> None:
    (folder / "careful.py").write_text(
        'def task_program():\n    try:\n        go_to("kitchn")\n    except Exception:\n        say("oh")\n'
    )
    status, out, err = run(folder, "careful.py", "--yes")
    assert status == 0
    assert re.search('before the robot moves: .*"kitchn".*"kitchen"', err)
    assert story_lines(out)[1] == 'drives to "kitchn"'  # The log repeats the warning first.


def test_instruction_becomes_a_program_and_is_run(folder: Path, paper: Suite) -> None:
    task = paper.tasks["StaplerDelivery"]
    instruction = task.prompts[0]
    (folder / "world.yaml").write_text(task.scenarios[0].world.to_yaml())
    status, out, err = run(folder, instruction, "--yes")
    assert (status, err.splitlines()[0]) == (0, RECORDED_NOTICE)
    assert "accepted: " in out
    program = "".join(line.removeprefix("    ") for line in out.splitlines(keepends=True)[:40])
    assert open_recorded("recorded:careful").solution(instruction, 0).program in program
    status, out, _ = call(folder, "missions", "last", "--json")
    mission = json.loads(out)
    assert (mission["instruction"], mission["model"]) == (instruction, "recorded:careful")


def test_program_with_a_syntax_error_never_runs(folder: Path) -> None:
    (folder / "odd.py").write_text("def task_program(:\n")
    status, _, err = run(folder, "odd.py", "--yes", "--despite-problems")
    assert (status, err) == (1, "not run because of problems\n")
    assert "running" not in states(folder)


def test_program_is_read_from_standard_input(folder: Path) -> None:
    status, out, _ = run(folder, "-", "--yes", given=GOOD)
    assert (status, "done" in story_lines(out)) == (0, True)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["none.py", "--yes"], ["none.py: ", "no such file"]),
        (["-"], ["--yes"]),
        (["", "--yes"], ["empty"]),
        (["good.py", "--robot", "simm"], ['"simm"', "sim, pyrobosim"]),
        (["no such thing", "--yes"], ["recorded:careful", '"no such thing"', "\nfor other instructions, "]),
    ],
)
def test_unusable_arguments_are_refused_in_one_sentence(
    folder: Path, arguments: list[str], named: list[str]
) -> None:
    status, out, err = run(folder, *arguments)
    assert (status, out) == (2, "")
    offered = err.count("\n  ")
    assert err.count("\n") == 1 + offered + ("\nfor other" in err)
    assert all(name in err for name in named), err
    assert "running" not in states(folder)


def test_without_a_world_the_robot_works_in_the_office_of_the_examples(folder: Path) -> None:
    (folder / "tea.py").write_text('def task_program():\n    go_to("alice\'s office")\n')
    status, out, err = call(folder, "run", "tea.py", "--yes", "--speed", "0")
    assert (status, "example office" in err, "--world FILE" in err) == (0, True, True)
    assert 'drives to "alice\'s office"' in out


def test_one_outcome_is_shown_or_all_of_them(folder: Path) -> None:
    one = run(folder, "good.py", "--yes")[1].partition("running on")[0]
    assert one.count("what the robot would do") == 1
    assert "1 of 2 different outcomes; --all" in one
    both = run(folder, "good.py", "--yes", "--all")[1].partition("running on")[0]
    assert [both.count('"mug": found'), both.count('"mug": not found')] == [1, 1]
    assert "--all" not in both


def test_a_typed_program_is_listed_by_its_first_steps(folder: Path) -> None:
    run(folder, "good.py", "--yes")
    assert 'typed: go_to("kitchen") if is_in_room("mug"):' in call(folder, "missions")[1]


@pytest.mark.slow
def test_feedback_comes_while_the_robot_drives(folder: Path) -> None:
    process = start(folder, "run", "good.py", "--yes", "--world", "world.yaml", "--speed", "5")
    with kill_at_end(process):
        read_until(process, "at (")
        assert process.poll() is None
        out, _ = process.communicate(timeout=60)
    assert "says" in out


# --- stop


@contextlib.contextmanager
def kill_at_end(process: Process) -> Iterator[None]:
    try:
        yield
    finally:
        process.kill()
        process.communicate()


def read_until(process: Process, text: str) -> str:
    assert process.stdout is not None
    lines = ""
    watchdog = threading.Timer(90, process.kill)
    watchdog.start()
    try:
        for line in process.stdout:
            lines += line
            if text in line:
                return lines
    finally:
        watchdog.cancel()
    process.kill()
    raise AssertionError((lines, *process.communicate()))


def start_driving(folder: Path, *wrapper: str) -> Process:
    """Start a mission, and wait until its robot drives."""
    arguments = ("far.py", "--yes", "--despite-problems", "--world", "world.yaml", "--speed", "1")
    process = start(folder, "run", *arguments, wrapper=wrapper)
    read_until(process, "at (")
    return process


@pytest.mark.parametrize(
    ("signals", "status"),
    [
        ([signal.SIGINT] * 3, 130),
        pytest.param([signal.SIGINT], 130, marks=pytest.mark.slow),
        pytest.param([signal.SIGTERM], 143, marks=pytest.mark.slow),
        pytest.param([signal.SIGHUP], 129, marks=pytest.mark.slow),
    ],
)
def test_signal_stops_the_robot(folder: Path, signals: Sequence[int], status: int) -> None:
    process = start_driving(folder)
    with kill_at_end(process):
        family = children_of(process.pid)
        for number in signals:
            process.send_signal(number)
            time.sleep(0.01)
        out, err = process.communicate(timeout=30)
    assert process.returncode == status
    assert re.search("^ +cancelled$", out, re.MULTILINE)
    assert re.search("robot has stopped", out)
    assert "Traceback" not in err
    assert family
    assert are_gone(family)
    assert states(folder) == ["stopped"]
    assert list(folder.rglob("*.held")), "a person stopped the robot, so no agent goes on by itself"


HOMING = """
import asyncio, pathlib

class Homing:
    def rooms(self): return ["hall"]
    async def connect(self):
        pathlib.Path("began").touch()
        await asyncio.sleep(60)
    def stop(self): pathlib.Path("stopped").touch()
    def go_to(self, location): pass
    def say(self, message): pass
    def ask(self, person, question, options): return options[0]
"""


@pytest.mark.parametrize(
    ("number", "status"),
    [
        (signal.SIGTERM, 143),
        pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, 129, marks=pytest.mark.slow),
    ],
)
def test_signal_stops_a_robot_that_is_connected(folder: Path, number: signal.Signals, status: int) -> None:
    (folder / "homing.py").write_text(HOMING)
    (folder / "say.py").write_text("def task_program():\n    say('it')\n")
    process = start(folder, "run", "say.py", "--yes", "--robot", "homing.py:Homing")
    with kill_at_end(process):
        while not (folder / "began").exists():
            time.sleep(0.01)
        process.send_signal(number)
        process.communicate(timeout=30)
    assert process.returncode == status
    assert (folder / "stopped").exists()


@pytest.mark.slow
def test_mission_outlives_its_terminal_with_nohup(folder: Path) -> None:
    process = start_driving(folder, "nohup")
    with kill_at_end(process):
        process.send_signal(signal.SIGHUP)
        read_until(process, "at (")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert process.returncode == 130


@pytest.mark.slow
def test_ctrl_c_at_the_question_ends_it(folder: Path) -> None:
    process = start(folder, "run", "good.py", "--world", "world.yaml")
    with kill_at_end(process):
        assert process.stderr is not None
        said = ""
        while not said.endswith("[y/N] ") and (letter := process.stderr.read(1)):
            said += letter
        process.send_signal(signal.SIGINT)
        process.wait(30)
    assert process.returncode == 130
    assert states(folder) == ["stopped"]


@pytest.mark.slow
def test_killed_tool_leaves_an_interrupted_mission(folder: Path) -> None:
    process = start_driving(folder)
    with kill_at_end(process):
        family = children_of(process.pid)
        process.kill()
        process.wait(30)
        assert are_gone(family)
    status, out, err = run(folder, "good.py", "--yes")
    assert status == 0
    assert re.match(r"mission \d{8}-\d{6} .*interrupted.* go_to\(\"\w+\"\), at .*simulated.*\n", err)
    assert states(folder) == ["interrupted", "done"]
    status, out, err = call(folder, "missions")
    assert (status, err) == (0, "")
    assert "interrupted" in out


@pytest.mark.slow
def test_mission_that_cannot_be_closed_blocks_no_command(folder: Path) -> None:
    process = start_driving(folder)
    with kill_at_end(process):
        process.kill()
        process.wait(30)
    (left,) = (folder / "home" / "missions").iterdir()
    (left / "mission.json.new").mkdir()  # This folder prevents writing, even for root.
    status, out, err = call(folder, "missions")
    assert (status, err.count("\n")) == (0, 1)
    assert re.match(rf"mission {left.name} .*interrupted.*closed: {left}", err)
    assert left.name in out
    assert call(folder, "missions", "last", "--json")[0] == 0
    assert run(folder, "good.py", "--yes")[0] == 0


@pytest.mark.parametrize("what", ["home", "home/missions"])
def test_home_that_is_not_a_folder_is_refused(folder: Path, what: str) -> None:
    (folder / what).parent.mkdir(exist_ok=True)
    (folder / what).touch()
    for arguments in (
        ["missions"],
        ["missions", "last"],
        ["run", "good.py", "--yes", "--world", "world.yaml"],
    ):
        status, out, err = call(folder, *arguments)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "home/missions: " in err
        assert "CODEBOTLER_HOME" in err


@pytest.mark.slow
def test_home_that_cannot_be_created_is_refused(folder: Path) -> None:
    words = ("run", "good.py", "--yes", "--world", "world.yaml")
    environment = variables(folder) | {"CODEBOTLER_HOME": "/sys/home"}
    status, out, err = command("codebotler", *words, cwd=folder, environment=environment)
    assert (status, out) == (2, "")
    assert re.fullmatch(r"codebotler: /sys/home/\w+: .*CODEBOTLER_HOME to another folder\n", err)


@pytest.mark.slow
def test_second_tool_cannot_use_a_reserved_robot(folder: Path) -> None:
    process = start_driving(folder)
    with kill_at_end(process):
        status, out, err = run(folder, "good.py", "--yes")
        assert (status, out) == (1, "")
        assert f"another tool (process {process.pid}, since " in err
        assert states(folder) == ["running"]
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert run(folder, "good.py", "--yes")[0] == 0
    assert states(folder) == ["stopped", "done"]


@pytest.mark.slow
def test_closed_output_pipe_stops_the_robot(folder: Path) -> None:
    process = start_driving(folder)
    with kill_at_end(process):
        assert process.stdout is not None
        process.stdout.close()
        process.stdout = None
        assert process.wait(30) == 1
    assert states(folder) == ["failed"]


@pytest.mark.slow
@pytest.mark.parametrize(("closed", "status"), [("0<&-", 1), ("1>&-", 0), ("2>&-", 0), ("0<&- 1>&- 2>&-", 1)])
def test_closed_standard_streams_raise_no_traceback(folder: Path, closed: str, status: int) -> None:
    arguments = ("run", "good.py", "--world", "world.yaml", "--speed", "0")
    process = start(folder, *arguments, wrapper=("sh", "-c", f'exec "$0" "$@" {closed}'))
    _, err = process.communicate("y\n", timeout=60)
    assert process.returncode == status
    assert "Traceback" not in err
    assert states(folder) == [["done", "stopped"][status]]


def test_unknown_home_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CODEBOTLER_HOME", "XDG_STATE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 2**31 - 7)
    with pytest.raises(UserError, match="CODEBOTLER_HOME"):
        home()


# --- missions, robots


def test_missions_are_listed_and_shown(folder: Path) -> None:
    status, out, err = call(folder, "missions")
    assert (status, "no missions" in out, err) == (0, True, "")
    assert call(folder, "missions", "--json") == (0, "[]\n", "")
    run(folder, "good.py", "--yes")
    _, out, _ = call(folder, "missions")
    (line,) = out.splitlines()
    name, state, robot, *_ = line.split()
    assert (state, robot) == ("done", "simulated")
    status, out, _ = call(folder, "missions", name)
    assert status == 0
    assert 'go_to("kitchen")' in out
    assert 'picks up "mug"' in out
    _, out, _ = call(folder, "missions", name, "--json")
    data = json.loads(out)
    assert (data["id"], data["events"][-1]["state"]) == (name, "done")


@pytest.mark.parametrize("seconds", ["1e300", "999_999.94", "1_000_000", "5"])
def test_times_stay_short_however_long_a_program_sleeps(folder: Path, seconds: str) -> None:
    (folder / "long.py").write_text(f"def task_program():\n    time.sleep({seconds})\n    say('late')\n")
    status, out, _ = run(folder, "long.py", "--yes", "--despite-problems")
    assert status == 0
    (line,) = (line for line in out.splitlines() if line.endswith('says "late"'))
    time = f"{float(seconds):.1f}" if float(seconds) < 1e6 else f"{float(seconds):.1e}"
    assert line == f'{time:>8} s  says "late"'
    _, out, _ = call(folder, "missions", "last")
    assert max(map(len, out.splitlines())) < 100
    assert f"{time} s" in out


def test_long_lines_of_programs_are_shown_whole(folder: Path) -> None:
    line = f"    say({'long ' * 40!r})"
    (folder / "long.py").write_text(f"def task_program():\n{line}\n")
    run(folder, "long.py", "--yes")
    assert f"    {line}\n" in call(folder, "missions", "last")[1]


def test_mission_is_written_as_mcap(folder: Path) -> None:
    run(folder, "good.py", "--yes")
    for clock in ("wall", "robot"):
        status, out, err = call(folder, "missions", "--mcap", "one.mcap", "--clock", clock)
        assert (status, out) == (0, "")
        assert err.startswith("wrote ")
        with (folder / "one.mcap").open("rb") as file:
            topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
        skills = {"/skill/go_to", "/skill/is_in_room", "/skill/pick", "/skill/say"}
        assert topics == {"/mission/state", "/mission/log", "/robot/pose", "/tf", "/rooms", *skills}


def test_mcap_that_cannot_be_written_is_named(folder: Path) -> None:
    run(folder, "good.py", "--yes")
    status, _, err = call(folder, "missions", "last", "--mcap", "/nowhere/one.mcap")
    assert (status, err) == (2, "codebotler: /nowhere: No such file or directory\n")
    program = (folder / "good.py").read_bytes()
    status, _, err = call(folder, "missions", "last", "--mcap", "good.py")
    assert status == 2
    assert err.startswith("codebotler: good.py: ")
    assert "unexpected content" in err
    assert (folder / "good.py").read_bytes() == program


def test_log_shows_each_state_once(folder: Path) -> None:
    run(folder, "good.py", "--yes")
    _, out, _ = call(folder, "missions", "last")
    assert out.count("program written") == 1


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["none"], ['"none"', "`codebotler missions`"]),
        (["--mcap", "x.mcap"], ['"last"', "`codebotler missions`"]),
        (["last", "--mcap", "x.mcap"], ['"last"']),
        (["last", "--clock", "sun"], ['"sun"', "wall or robot"]),
    ],
)
def test_unusable_options_of_missions_are_refused(
    folder: Path, arguments: list[str], named: list[str]
) -> None:
    status, out, err = call(folder, "missions", *arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert all(name in err for name in named), err
    assert not (folder / "x.mcap").exists()


def test_robots_are_listed_with_missing_requirements(folder: Path) -> None:
    status, out, err = call(folder, "robots")
    assert (status, err) == (0, "")
    assert re.search(r"^sim +works", out, re.MULTILINE)
    _, out, _ = call(folder, "robots", "--json")
    kinds = json.loads(out)
    assert [kind["name"] for kind in kinds] == ["sim", "pyrobosim", "ros1", "rosbridge", "ros2"]
    assert all(kind["works"] or kind["missing"] for kind in kinds)


def test_robots_are_checked_with_the_given_python(folder: Path) -> None:
    status, out, err = call(folder, "robots", "--json", "--ros-python", sys.executable)
    assert (status, err) == (0, "")
    missing = {kind["name"]: kind["missing"] for kind in json.loads(out)}
    for name, package in (("ros1", "rospy"), ("ros2", "rclpy")):
        assert sys.executable in missing[name]
        assert package in missing[name]


def test_mission_fails_if_the_model_writes_no_program(folder: Path) -> None:
    with Server(fault=lambda _: Fault.REFUSAL) as server:
        model = ("--model", "openai-chat:tiny", "--base-url", server.url)
        refused = run(folder, "Go to the kitchen.", *model, "--yes")
    assert (refused.status, refused.out) == (1, "")
    assert refused.err.splitlines()[0] == "The model refused: I can't help with weapons."
    (mission,) = json.loads(call(folder, "missions", "--json").out)
    assert (mission["state"], mission["reason"]) == (
        "failed",
        "The model refused: I can't help with weapons.",
    )
