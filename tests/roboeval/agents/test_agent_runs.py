"""Test runs in which the real chat client connects a scripted agent."""

import json
import os
import signal
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from agent_server import (
    INPUT_TOKENS,
    OUTPUT_TOKENS,
    REASONING_TOKENS,
    Agent,
    Turn,
    results_in,
    serve,
    turns_before,
)
from codebotler.core.errors import UserError
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from forked import PROGRAMS, Forked
from roboeval.evaluation.agents.conversation import TurnLimits
from roboeval.evaluation.agents.plan import AgentMode, AgentPlan
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.generating.generate import GenerationProgress, Pace, generate_run
from roboeval.evaluation.generating.requests import GenerationPlan
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.rows import Row
from roboeval.suites.load import Suite, load_suite
from server import Request, Server
from small_suite import write_suite

LIMITS = TurnLimits(20)
WORLDS = """\
name: T
summary: s
prompts: [Greet Jill., Say hello to Jill.]
checks:
  says(what): {category: SayAtLocation, rtl: 'tr.Exists(say("{what}"))'}
worlds:
- {about: one, robot: lobby, rooms: [kitchen, lobby], require: [says("hello")]}
- {about: two, robot: kitchen, rooms: [kitchen, lobby], require: [says("hello")]}
"""
GO: Turn = [("go_to", {"location": "kitchen"})]
LOOK: Turn = [("is_in_room", {"entity": "jill"})]
STOP: Turn = [("give_up", {"reason": "I cannot."})]


@pytest.fixture
def suite(tmp_path: Path) -> Suite:
    """A suite of two prompts and two worlds."""
    return load_suite(write_suite(_make_folder(tmp_path / "suite"), WORLDS))


@pytest.fixture
def small(tmp_path: Path) -> Suite:
    """A suite of one prompt and one world."""
    return load_suite(write_suite(_make_folder(tmp_path / "small")))


def _make_folder(folder: Path) -> Path:
    folder.mkdir()
    return folder


@pytest.fixture(autouse=True)
def set_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "a key")


def act(
    run: RunFolder,
    suite: Suite,
    server: Server,
    *,
    mode: AgentMode = "agent",
    limits: TurnLimits = LIMITS,
    count: int = 1,
) -> GenerationProgress:
    model = open_model("openai-chat:agent", SamplingSettings(base_url=server.url, seed=0))
    plan = AgentPlan(suite, None, count, mode=mode, limits=limits)
    return generate_run(run, plan, model, Pace())


def rows_of(run: RunFolder, suite: Suite) -> list[Row]:
    return [*evaluate_run(run, suite, ablated=False, tasks=None, redo=False)]


def run_agent(
    tmp_path: Path, suite: Suite, turns: Sequence[Turn], limits: TurnLimits = LIMITS
) -> tuple[list[Completion], list[Row], Agent, list[Request]]:
    run = RunFolder(tmp_path / "run")
    agent, server = serve(lambda _: turns)
    with server:
        assert act(run, suite, server, limits=limits).missing is None
    return [*run.read(suite)], rows_of(run, suite), agent, server.requests


def test_each_world_of_each_prompt_is_a_mission_with_its_costs(tmp_path: Path, suite: Suite) -> None:
    completions, rows, agent, _ = run_agent(tmp_path, suite, [GO, LOOK, "Done."])
    prompts = len(suite.tasks["T"].prompts)
    assert {(one.prompt, one.more["world"]) for one in completions} == {
        (prompt, world) for prompt in range(prompts) for world in range(2)
    }
    for one in completions:
        assert (one.mode, one.more["turns"], one.more["ending"]) == ("agent", 3, "answer")
        assert one.more["usage"] == {
            "input_tokens": 3 * INPUT_TOKENS,
            "output_tokens": 3 * OUTPUT_TOKENS,
            "reasoning_tokens": 3 * REASONING_TOKENS,
        }
    assert sum(agent.answered.values()) == 3 * len(completions)
    assert [len(row["verdicts"]) for row in rows] == [1] * len(completions)
    abouts = {one.world.about for one in suite.tasks["T"].scenarios}
    assert {row["verdicts"][0]["world"] for row in rows} == abouts


@pytest.mark.parametrize(
    ("turns", "failure"),
    [
        ([[("fly", {"to": "the moon"})]], ("AgentError", "UnknownTool")),
        ([[("go_to", {"place": "lobby"})]], ("AgentError", "WrongArguments")),
        ([[("go_to", '{"location": ')]], ("AgentError", "WrongArguments")),
        ([[*GO, *LOOK]], ("AgentError", "SeveralCalls")),
        (["I would go to her office and ask her."], ("AgentError", "NoCall")),
        ([LOOK, [("wait", {"seconds": 1})]] * 150, ("AgentError", "RepeatedCalls")),
        ([GO, LOOK] * 100, ("AgentError", "TurnLimit")),
        ([LOOK, STOP], ("AgentError", "GaveUp")),
        ([[("go_to", {"location": "x"})], STOP], ("RobotExecutionError", "GoToInvalidLocation")),
        ([LOOK, "She comes at noon, and I have told you so."], ("TaskCompletionError", "Location")),
        ([GO, ""], ("NoProgram", "empty")),
        ([LOOK, "<think>She may be in the kitchen.</think>"], ("NoProgram", "empty")),
    ],
    ids=lambda one: one[1] if isinstance(one, tuple) else "",
)
def test_a_mistake_ends_a_mission_with_its_class(
    tmp_path: Path, small: Suite, monkeypatch: pytest.MonkeyPatch, turns: list[Turn], failure: tuple[str, str]
) -> None:
    monkeypatch.setattr("roboeval.evaluation.agents.mission.MAX_REPEATS", 6)
    completions, (row,), agent, _ = run_agent(tmp_path, small, turns)
    assert row["failure"] is not None
    assert (row["failure"]["class"], row["failure"]["kind"]) == failure
    assert sum(agent.answered.values()) == sum(one.more["turns"] for one in completions)


def test_a_limit_of_tokens_ends_a_mission(tmp_path: Path, small: Suite) -> None:
    each = INPUT_TOKENS + OUTPUT_TOKENS
    completions, _, _, _ = run_agent(tmp_path, small, [GO, LOOK] * 10, TurnLimits(20, tokens=4 * each))
    assert {(one.more["ending"], one.more["turns"]) for one in completions} == {("TokenLimit", 4)}


def test_the_model_sees_each_result_and_its_own_calls(tmp_path: Path, small: Suite) -> None:
    _, _, _, requests = run_agent(tmp_path, small, [[("fly", {})], GO, LOOK, "Done."])
    last = max(requests, key=turns_before)
    sent = results_in(last)
    assert sent[0].startswith("UnknownTool")
    assert sent[1] == "done"
    assert sent[2] in {"true", "false"}
    calls = [one["tool_calls"][0] for one in last.body["messages"] if one["role"] == "assistant"]
    assert [call["function"]["name"] for call in calls] == ["fly", "go_to", "is_in_room"]
    assert {tool["function"]["name"] for tool in last.body["tools"]} == {
        *small.skills,
        "wait",
        "give_up",
    }


def test_a_failed_request_is_repeated_in_the_same_mission(tmp_path: Path, suite: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    agent, server = serve(lambda _: [GO, LOOK, "Done."])
    agent_sends, broken = server.sends, True

    def respond(request: Request) -> tuple[int, dict[str, str], bytes] | None:
        if broken and turns_before(request) == 2:
            return 401, {"Content-Type": "application/json"}, b'{"error": {"message": "No."}}'
        return agent_sends(request)

    server.sends = respond
    with server:
        assert act(run, suite, server).missing is not None
        broken = False
        assert act(run, suite, server).missing is None
    assert {*agent.answered.values()} == {1}
    assert {one.more["turns"] for one in run.read(suite)} == {3}


def test_a_reasoning_models_thoughts_are_kept(tmp_path: Path, small: Suite) -> None:
    completions, _, _, _ = run_agent(tmp_path, small, [GO, "<think>She is away.</think>Done."])
    assert {one.more["reasoning"] for one in completions} == {"She is away."}


def rejecting_server(turns: int) -> Server:
    """A server that rejects conversations with this number of turns."""
    _, server = serve(lambda _: [GO, LOOK, "Done."])
    answers = server.sends

    def respond(request: Request) -> tuple[int, dict[str, str], bytes] | None:
        if turns_before(request) == turns:
            return 400, {"Content-Type": "application/json"}, b'{"error": {"message": "Too long."}}'
        return answers(request)

    server.sends = respond
    return server


def test_a_server_that_rejects_results_stops_the_command(tmp_path: Path, suite: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    with rejecting_server(1) as server:
        assert "Too long" in str(act(run, suite, server, count=9).missing)
    assert not run.completions.read_bytes()  # An empty file lets the same command continue later.


@pytest.mark.slow
def test_many_rejected_missions_in_a_row_stop_the_command(tmp_path: Path, suite: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    with rejecting_server(2) as server:
        assert "Too long" in str(act(run, suite, server, count=9).missing)
    assert Pace().concurrency <= len([*run.read(suite)]) < 2 * Pace().concurrency


def test_rejecting_a_long_conversation_ends_its_mission(tmp_path: Path, suite: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    with rejecting_server(2) as server:
        assert act(run, suite, server).missing is None
    completions = [*run.read(suite)]
    assert {(one.more["ending"], one.turns) for one in completions} == {("Rejected", 2)}
    assert all("Too long" in one.program for one in completions)


PROGRAM = """
```python
def task_program():
    {body}
```
"""
WRONG_DOOR = "say('Hello'); go_to('the moon')"


def replan(
    tmp_path: Path, suite: Suite, bodies: Sequence[str], turns: int = 4
) -> tuple[list[Completion], list[Row], Server]:
    run = RunFolder(tmp_path / "run")
    _, server = serve(lambda _: [PROGRAM.format(body=body) for body in bodies])
    with server:
        assert act(run, suite, server, mode="replan", limits=TurnLimits(turns)).missing is None
    return [*run.read(suite)], rows_of(run, suite), server


@pytest.mark.slow
def test_after_a_failure_the_model_writes_the_rest(tmp_path: Path, suite: Suite) -> None:
    completions, rows, server = replan(tmp_path, suite, [WRONG_DOOR, "say('Sorry')"])
    for one in completions:
        assert (one.mode, one.more["turns"], one.more["ending"]) == ("replan", 2, "answer")
        assert one.more["tool_errors"] == {"GoToInvalidLocation": 1}
    for row in rows:
        spoken = [event[1] for event in row["verdicts"][0]["trace"] if event[0] == "say"]
        assert spoken == ["hello", "sorry"]  # Texts are lower-cased, and none is repeated.
    second = max(server.requests, key=turns_before)
    sent = second.body["messages"][-1]["content"]
    assert 'failed to go to "the moon"' in sent  # The prompt must not say that the robot went there.


def test_looking_at_rooms_and_waiting_are_no_steps(tmp_path: Path, small: Suite) -> None:
    _, _, server = replan(tmp_path, small, ["get_all_rooms(); time.sleep(1); int('x')", "say('hello')"])
    sent = max(server.requests, key=turns_before).body["messages"][-1]["content"]
    assert "- no step was finished" in sent  # Looking at rooms and waiting are no steps.


@pytest.mark.parametrize(
    ("body", "name", "kind"),
    [
        (WRONG_DOOR, "RobotExecutionError", "GoToInvalidLocation"),
        ("say(undefined)", "PythonError", "NameError"),
        ("say('x'", "PythonError", "SyntaxError"),
        ("import time\n    while True: time.sleep(1)", "PythonError", "TimeoutError"),
        ("'x'.encode().decode('utf-16')", "PythonError", "UnicodeDecodeError"),  # It takes five arguments.
        ("1 / 0", "PythonError", "ZeroDivisionError"),
        ("raise Exception('no path')", "PythonError", "Exception"),
    ],
)
def test_the_last_failure_counts(tmp_path: Path, small: Suite, body: str, name: str, kind: str) -> None:
    completions, rows, _ = replan(tmp_path, small, [body], turns=2)
    is_limit = kind == "TimeoutError"
    assert {one.more["turns"] for one in completions} == {1 if is_limit else 2}
    for row in rows:
        assert row["failure"] is not None
        assert (row["failure"]["class"], row["failure"]["kind"]) == (name, kind)
    counts = [sum(one.more["tool_errors"].values()) for one in completions]
    assert counts == [one.turns for one in completions]


def test_the_text_of_the_last_failure_is_not_quoted_again(tmp_path: Path, small: Suite) -> None:
    _, rows, _ = replan(tmp_path, small, ["say('hello'); {}['a']"], turns=1)
    assert rows[0]["verdicts"][0]["error"] == {"kind": "KeyError", "message": "'a'"}


LOOKS = "[is_in_room('jill') for _ in range(600)]"
SLEEP = "time.sleep(1900)"  # Two sleeps exceed the limit of 3600 seconds.


@pytest.mark.parametrize("use", [LOOKS, f"import time; {SLEEP}"])
def test_the_programs_of_a_mission_share_its_limits(tmp_path: Path, small: Suite, use: str) -> None:
    completions, rows, _ = replan(tmp_path, small, [f"{use}; int('x')", f"{use}; say('hello')"])
    assert {(one.more["ending"], one.turns) for one in completions} == {("TimeoutError", 2)}
    assert {row["failure"]["kind"] for row in rows if row["failure"]} == {"TimeoutError"}


LATE = "try: pick('moon')\n    except Exception as error: time.sleep(100); raise error"


@pytest.mark.parametrize("fails", ["time.sleep(100); int('x')", f"0\n    {LATE}"])
def test_the_clock_continues_in_the_next_program(tmp_path: Path, small: Suite, fails: str) -> None:
    says = "time.sleep(50); say(str(time.monotonic()))"
    _, rows, _ = replan(tmp_path, small, [f"import time; {fails}", f"import time; {says}"])
    assert {event[1] for row in rows for event in row["verdicts"][0]["trace"]} == {"150.0"}


def test_calls_of_a_program_do_not_count_as_turns(tmp_path: Path, suite: Suite) -> None:
    body = "[is_in_room('jill') for _ in range(150)]; say('hello')"
    completions, rows, _ = replan(tmp_path, suite, [body])
    assert {one.more["ending"] for one in completions} == {"answer"}
    assert all(row["passed"] for row in rows)


def test_a_run_keeps_to_one_mode(tmp_path: Path, suite: Suite) -> None:
    replan(tmp_path, suite, ["say('hello')"])
    _, server = serve(lambda _: [PROGRAM.format(body="say('hello')")])
    with server:
        model = open_model("openai-chat:agent", SamplingSettings(base_url=server.url, seed=0))
        with pytest.raises(UserError, match=r"different mode \(replan, now program\)"):
            generate_run(RunFolder(tmp_path / "run"), GenerationPlan(suite, None, 9), model, Pace())


def test_a_run_keeps_its_limits(tmp_path: Path, suite: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    _, server = serve(lambda _: [GO, "Done."])
    with server:
        act(run, suite, server, limits=TurnLimits(20, tokens=5_000))
        with pytest.raises(UserError, match="tokens"):
            act(run, suite, server, count=2)


PRELOAD = (*PROGRAMS, "codebotler.models.servers.chat", "openai.resources.chat")
SCRIPT = """
import pathlib, sys
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from roboeval.evaluation.agents.conversation import TurnLimits
from roboeval.evaluation.agents.plan import AgentPlan
from roboeval.evaluation.generating.generate import Pace, generate_run
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.load import load_suite
model = open_model("openai-chat:agent", SamplingSettings(base_url={url!r}, seed=0))
plan = AgentPlan(load_suite({suite!r}), None, 3, mode="agent", limits=TurnLimits(20))
generate_run(RunFolder(pathlib.Path({run!r})), plan, model, Pace(concurrency=3))
"""


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_run_continues_after_its_last_turn(
    tmp_path: Path, suite: Suite, end: signal.Signals
) -> None:
    run = RunFolder(tmp_path / "run")
    agent, server = serve(lambda _: [GO, LOOK, *[[("say", {"message": str(n)})] for n in range(5)], "Done."])
    server.pause = 0.02
    answers = server.sends

    def respond_slowly(request: Request) -> tuple[int, dict[str, str], bytes] | None:
        time.sleep(0.01)  # The pause lets a signal find open requests.
        return answers(request)

    server.sends = respond_slowly
    environment = {**os.environ, "OPENAI_API_KEY": "a key"}
    with server:
        for asked in (20, 90):
            script = SCRIPT.format(url=server.url, suite=str(suite.folder), run=str(run.path))
            process = Forked("-c", script, cwd=tmp_path, environment=environment, preload=PRELOAD)
            deadline = time.monotonic() + 60
            while len(server.requests) < asked and process.poll() is None:
                assert time.monotonic() < deadline
                time.sleep(0.005)
            process.send_signal(end)
            process.communicate(timeout=60)
        progress = act(run, suite, server, count=3)
    assert progress.missing is None
    completions = [*run.read(suite)]
    assert {one.more["turns"] for one in completions} == {8}
    twice = sum(agent.answered.values()) - len(agent.answered)
    assert len(agent.answered) == 8 * len(completions)
    about = json.loads(run.about.read_text())
    assert twice <= about["possibly_paid_twice"] <= 6
    assert {one.more["usage"]["input_tokens"] for one in completions} == {INPUT_TOKENS * 8}


def test_the_log_of_turns_has_every_reply(tmp_path: Path, suite: Suite) -> None:
    completions, _, _, _ = run_agent(tmp_path, suite, [GO, LOOK, "Done."])
    lines = map(json.loads, (tmp_path / "run" / "turns.jsonl").read_text().splitlines())
    turns = Counter((row["task"], row["prompt"], row["index"]) for row in lines)
    assert turns == {one.key: 3 for one in completions}
