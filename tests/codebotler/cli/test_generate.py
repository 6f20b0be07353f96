"""`codebotler generate` prints the program on standard output, and nothing else there."""

import json
import os
import re
import shlex
import sys
from pathlib import Path

import pytest

import command_line
from codebotler.models.recorded import RECORDED_NOTICE, open_recorded
from codebotler.robots.simulated import OFFICE
from command_line import Ended, Refusal, command, process
from roboeval.suites.load import Suite
from server import Fault, Request, Server

KEY = "sk-verysecret0123456789abcdefghijkl"
LOST = "```python\ndef task_program():\n    go_to('the moon')\n```\n"
FINE = "```python\ndef task_program():\n    go_to('kitchen')\n```\n"
CODEBOTLER = shlex.join([sys.executable, "-m", "codebotler"])
WORLD = "robot: start_loc\nrooms: [start_loc, kitchen]\n"


def codebotler(*arguments: str | Path, cwd: Path | None = None, before: str = "", after: str = "") -> Ended:
    """Run a command, in a process of its own if shell code comes before or after it."""
    variables = {**os.environ, "OPENAI_API_KEY": KEY, "COLUMNS": "100"}
    if before or after:
        name, words = "codebotler", arguments
        return process(name, *words, cwd=cwd, before=before, after=after, environment=variables)
    return command("codebotler", *arguments, cwd=cwd, environment=variables)


def refusal_of(*arguments: str | Path, cwd: Path | None = None, lines: int = 1) -> Refusal:
    return command_line.refused("generate", *arguments, name="codebotler", cwd=cwd, lines=lines)


def instruction(suite: Suite) -> str:
    return suite.tasks["StaplerDelivery"].prompts[0]


def answer_wrong_first(request: Request) -> str:
    return LOST if request.body["seed"] == 0 else FINE


def generate(server: Server, *more: str, cwd: Path) -> Ended:
    (cwd / "world.yaml").write_text(WORLD)
    model = ("--model", "openai:tiny", "--base-url", server.url, "--seed", "0", "--world", "world.yaml")
    return codebotler("generate", "Go to the kitchen.", *model, *more, cwd=cwd)


@pytest.mark.slow
def test_a_recorded_program_goes_through_a_pipe_into_the_check(tmp_path: Path, paper: Suite) -> None:
    world = tmp_path / "world.yaml"
    world.write_text(paper.tasks["StaplerDelivery"].scenarios[0].world.to_yaml())
    alone = codebotler("generate", instruction(paper), "--model", "recorded")
    assert (alone.status, alone.err) == (0, f"{RECORDED_NOTICE}\n")
    compile(alone.out, "program", "exec")
    assert alone.out.startswith("def task_program():\n")
    piped = codebotler("generate", instruction(paper), after=f"| {CODEBOTLER} check - --world {world}")
    assert (piped.status, piped.err) == (0, f"{RECORDED_NOTICE}\n")
    assert piped.out.startswith("accepted: no problem in the program")


def test_unrecorded_instruction_is_refused() -> None:
    refusal = refusal_of("Bring me the moon.", lines=5)
    assert "recorded:careful" in refusal.sentence
    assert '"Bring me the moon."' in refusal.sentence
    assert "\nfor other instructions, " in refusal.sentence


def test_suggested_instructions_are_whole_and_fit_the_world(tmp_path: Path) -> None:
    office = tmp_path / "office.yaml"
    office.write_text(OFFICE.read_text())
    refusal = refusal_of(
        "Go to the lobby, and tell me how many people are there.", "--world", office, lines=5
    )
    _, *offered, _ = refusal.sentence.splitlines()
    known = open_recorded("recorded").replies
    assert {text.strip() for text in offered} <= known.keys()
    assert not any("lobby" in text.lower() for text in offered)
    (tmp_path / "hall.yaml").write_text("robot: hall\nrooms: [hall]\n")
    assert len(refusal_of("Go.", "--world", tmp_path / "hall.yaml", lines=2).sentence.splitlines()) == 2


@pytest.mark.parametrize("instruction", ["", "  \n"])
def test_empty_instruction_is_refused(instruction: str) -> None:
    assert "instruction is empty" in refusal_of(instruction).sentence


def test_a_program_with_problems_is_printed_with_status_1(tmp_path: Path) -> None:
    with Server(answer=answer_wrong_first) as server:
        ended = generate(server, cwd=tmp_path)
    assert ended.status == 1
    assert ended.out == "def task_program():\n    go_to('the moon')\n"
    _, problem = ended.err.splitlines()
    assert re.search(r'^  line 2: GoToInvalidLocation: .*"the moon"', problem)
    assert len(server.requests) == 1


def test_rejection_sampling_asks_again_and_reports_both_attempts(tmp_path: Path) -> None:
    with Server(answer=answer_wrong_first) as server:
        ended = generate(server, "--retries", "3", cwd=tmp_path)
    assert ended.status == 0
    assert ended.out == "def task_program():\n    go_to('kitchen')\n"
    lines = ended.err.splitlines()
    assert re.match("attempt 1 of 4 .*problem", lines[0])
    assert re.match('  line 2: GoToInvalidLocation: .*"the moon"', lines[1])
    assert re.match("attempt 2 of 4 .*accepted", lines[2])
    assert len(lines) == 3
    first, second = server.requests
    assert first.body["messages"] == second.body["messages"]
    assert "kitchen" in json.dumps(first.body["messages"][-1])
    assert KEY not in ended.out + ended.err


def test_a_repair_carries_the_program_and_the_problem_in_words(tmp_path: Path) -> None:
    with Server(answer=answer_wrong_first) as server:
        ended = generate(server, "--repair", cwd=tmp_path)
    assert (ended.status, len(server.requests)) == (0, 2)
    said = json.dumps(server.requests[1].body["messages"][-2:])
    assert "go_to('the moon')" in said
    assert "GoToInvalidLocation" in said
    assert len(server.requests[1].body["messages"]) == len(server.requests[0].body["messages"]) + 2


def test_retries_are_limited(tmp_path: Path) -> None:
    with Server(answer=lambda _: LOST) as server:
        ended = generate(server, "--retries", "2", cwd=tmp_path)
    assert (ended.status, len(server.requests)) == (1, 3)
    assert re.match("attempt 3 of 3 .*problem", ended.err.splitlines()[-2])


def test_a_refused_key_is_one_sentence(tmp_path: Path) -> None:
    with Server(fault=lambda _: Fault.UNAUTHORIZED) as server:
        ended = generate(server, cwd=tmp_path)
    assert (ended.status, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert "401" in ended.err
    assert KEY not in ended.err


def test_the_prompt_is_shown_without_a_key_or_a_server() -> None:
    chat = codebotler("generate", "Go to the kitchen.", "--model", "anthropic:claude", "--show-prompt")
    assert (chat.status, chat.err) == (0, "")
    assert chat.out.startswith("--- system\n")
    assert chat.out.endswith("--- user\nGo to the kitchen.\n")
    base = codebotler("generate", "Go to the kitchen.", "--model", "completions:x", "--show-prompt")
    assert base.out.endswith("# Instruction: Go to the kitchen.\ndef task_program():\n")


@pytest.mark.parametrize(
    ("model", "named"),
    [
        ("nonsense", ['"nonsense"', "recorded, "]),
        ("hf:", ['"hf:"', "recorded, "]),
        ("recorded:lazy", ['"recorded:lazy"', "recorded:careful or "]),
    ],
)
def test_no_prompt_is_shown_for_an_unknown_model(model: str, named: list[str]) -> None:
    refusal = refusal_of("Go to the kitchen.", "--model", model, "--show-prompt")
    assert all(name in refusal.sentence for name in named), refusal


def test_invalid_world_is_refused(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text("rooms: 3\n")
    assert refusal_of("Go.", "--world", "world.yaml", cwd=tmp_path).file == "world.yaml"


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (Fault.EMPTY, "The reply is empty."),
        (Fault.WITHOUT_CODE, "The reply holds no code."),
        (Fault.TOOL_CALL, "The model called a tool"),
        (Fault.REFUSAL, "The model refused: I can't help with weapons."),
        (Fault.FILTERED, "A content filter blocked"),
    ],
    ids=lambda value: value.name if isinstance(value, Fault) else "",
)
def test_reply_without_a_program_is_reported_and_nothing_is_printed(
    fault: Fault, words: str, tmp_path: Path
) -> None:
    with Server(fault=lambda _: fault) as server:
        ended = generate(server, cwd=tmp_path)
    assert (ended.status, ended.out) == (1, "")
    assert ended.err.startswith(words)
    assert "SyntaxError" not in ended.err


def test_a_reply_that_was_cut_off_names_the_option_that_helps(tmp_path: Path) -> None:
    with Server(answer=lambda _: FINE, limits=True) as server:
        ended = generate(server, "--max-tokens", "8", cwd=tmp_path)
        mended = generate(server, "--max-tokens", "32", cwd=tmp_path)
    assert (ended.status, ended.out) == (1, "")
    assert ended.err.startswith("The reply was cut off at 8 tokens. --max-tokens 32 ")
    assert (mended.status, mended.err) == (0, "")


@pytest.mark.parametrize("repair", [False, True])
def test_a_reply_without_a_program_is_asked_for_again(*, repair: bool, tmp_path: Path) -> None:
    with Server(answer=lambda _: FINE) as server:
        server.faults.append(Fault.WITHOUT_CODE)
        ended = generate(server, "--retries", "1", *["--repair"] * repair, cwd=tmp_path)
    assert (ended.status, len(server.requests)) == (0, 2)
    assert ended.out == "def task_program():\n    go_to('kitchen')\n"
    assert ended.err.splitlines()[0] == "attempt 1 of 2: The reply holds no code."
    first, second = (request.body["messages"] for request in server.requests)
    assert len(first) == len(second)
    assert ("holds no code" in second[-1]["content"]) is repair
