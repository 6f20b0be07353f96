"""Run verifiers itself with a scripted server in place of a model."""

from __future__ import annotations

import asyncio
import json
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import entry_points
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import fmean
from time import monotonic
from typing import Any, TypeAlias

import pytest
import verifiers.v1 as vf
import verifiers.v1.cli.eval.main
import verifiers.v1.cli.validate  # noqa: F401 - commands, which the tests run
from codebotler_verifiers import (
    MissionToolset,
    TrainingConfig,
    TrainingData,
    TrainingEnvConfig,
    TrainingTask,
    TrainingTaskset,
    TrainingTrace,
)
from mcp.server.mcpserver import MCPServer
from verifiers.v1.graph import MessageNode
from verifiers.v1.runtimes import make_runtime
from verifiers.v1.utils.loaders import environment_class, resolve_env_config, taskset_class

from codebotler.simulator.pool import SHARED_POOL, shared_pool
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.agents.mission import MAX_MISTAKES
from roboeval.suites.families.tasks import trained_task
from roboeval.training.missions import TrainingMission, load_missions, mission_tools
from roboeval.training.prompts import load_prompts

NAME, FAMILY = "codebotler-verifiers", "BringThing"
AGENT_FAMILY = "AnnounceInOrder"  # Its solutions have no branches.
SCRIPTS = Path(sys.executable).parent
FORK = get_context("fork")
Call: TypeAlias = tuple[str, dict[str, Any]]
Run: TypeAlias = Callable[..., None]
PARTS = {"passed", "requirements", "without_errors", "parses", "rules_kept"}


def taskset(**options: Any) -> TrainingTaskset:  # noqa: ANN401 - of any option
    return TrainingTaskset(TrainingConfig(id=NAME, **options))


def solution(task: TrainingTask) -> str:
    return f"Here it is:\n```python\n{trained_task(task.data.family, task.data.seed).solution}```"


def trace_of(task: TrainingTask, reply: str, calls: Sequence[Call] = ()) -> TrainingTrace:
    trace = TrainingTrace(
        task=vf.TraceTask[TrainingData](type=type(task).__name__, data=task.data),
        agent=vf.AgentInfo(config=vf.AgentConfig(runtime=vf.SubprocessConfig())),
    )
    for name, arguments in calls:
        call = vf.ToolCall(id="1", name=name, arguments=json.dumps(arguments))
        trace.nodes.append(MessageNode(message=vf.AssistantMessage(tool_calls=[call]), sampled=True))
    trace.nodes.append(MessageNode(message=vf.AssistantMessage(content=reply), sampled=True))
    return trace


@pytest.fixture(scope="session", autouse=True)
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Run commands, each forked from a process that has imported what it needs and has no threads."""
    line, theirs = FORK.Pipe()
    process = FORK.Process(target=fork_commands, args=(theirs, line))
    process.start()
    theirs.close()

    def run(name: str, *arguments: str | Path, stop_engine: bool = False) -> None:
        said = tmp_path_factory.mktemp("command") / "said"
        line.send((said, stop_engine, name, *map(str, arguments)))
        assert line.recv() == 0, said.read_text()[-6_000:]

    yield run
    line.close()
    process.join()


def fork_commands(line: Connection, other_end: Connection) -> None:
    other_end.close()
    with suppress(EOFError):
        while True:
            command = FORK.Process(target=be_command, args=line.recv())
            command.start()
            command.join(240)
            line.send(command.exitcode)
            command.kill()


def be_command(said: Path, stop_engine: bool, name: str, *arguments: str) -> None:  # noqa: FBT001 - from a pipe
    with said.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    sys.argv, sys.stdout, sys.stderr = [name, *arguments], os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
    os.environ["PATH"] = f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"  # The null harness needs uv.
    if stop_engine:
        shared_pool().submit(lambda: shared_pool().here().stop()).result()
    (script,) = entry_points(group="console_scripts", name=name)
    sys.exit(script.load()())


@pytest.fixture
def task() -> TrainingTask:
    return next(iter(taskset()))


# --- data


def test_tasks_are_those_of_load_prompts() -> None:
    some = list(taskset(split="test", count=3, seed=2, worlds=11))
    for task, row in zip(some, load_prompts("test", count=3, seed=2), strict=True):
        sent = task.data.model_dump(mode="json")  # Traces and servers use this format.
        asked = [{"role": one["role"], "content": one["content"]} for one in sent["prompt"]]
        assert [{"role": "system", "content": sent["system_prompt"]}, *asked] == row["prompt"]
        assert {name: sent[name] for name in ("family", "seed", "prompt_index")}.items() <= row.items()
        assert sent["worlds"] == 11
        assert TrainingData.model_validate(sent) == task.data
    assert [task.data.idx for task in some] == [0, 1, 2]
    assert len({task.key for task in some}) == 3


def test_tasks_are_unlimited_without_a_count() -> None:
    endless = taskset()
    assert not endless.bounded
    assert endless.take(2).bounded
    assert taskset(count=2).bounded
    first = [task.key for task in islice(endless, 5)]
    assert first == [task.key for task in taskset(count=5)]
    assert not set(first) & {task.key for task in islice(taskset(seed=1), 5)}


def test_options_that_do_not_exist_are_refused() -> None:
    wrong = {"families": ["NoSuchFamily"], "split": "plus", "count": 0, "worlds": 0, "seed": -1}
    for name, value in wrong.items():
        with pytest.raises(ValueError, match=name):
            taskset(**{name: value})


def test_verifiers_finds_it_by_name_with_defaults_that_need_no_cloud() -> None:
    assert taskset_class(NAME) is TrainingTaskset
    assert issubclass(environment_class(NAME), vf.SingleAgentEnv)
    config = resolve_env_config({"taskset": {"id": NAME}})
    assert isinstance(config, TrainingEnvConfig)
    assert config.agent_harnesses()["agent"].id == "null"
    assert config.agent.runtime.type == "subprocess"


# --- rewards


def test_the_reference_solution_earns_1(task: TrainingTask) -> None:
    trace = trace_of(task, solution(task))
    asyncio.run(task.score(trace))
    assert list(trace.rewards) == ["reward"]
    assert trace.reward == 1
    assert trace.metrics == dict.fromkeys(PARTS, 1.0)


@pytest.mark.parametrize("reply", ["", "I cannot do that.", "```python\ndef task_program():\n    pass\n```"])
def test_a_program_that_does_nothing_earns_0(task: TrainingTask, reply: str) -> None:
    trace = trace_of(task, reply)
    asyncio.run(task.score(trace))
    assert trace.reward == trace.metrics["passed"] == 0
    assert trace.metrics["requirements"]  # Some hold before the robot acts.
    assert set(trace.metrics) == PARTS


def test_judging_does_not_block_the_event_loop(task: TrainingTask) -> None:
    async def longest_pause() -> tuple[float, float]:
        begin = last = monotonic()
        scoring = asyncio.create_task(
            task.score(trace_of(task, "def task_program():\n    while True: pass\n"))
        )
        longest = 0.0
        while not scoring.done():
            await asyncio.sleep(0)
            longest, last = max(longest, monotonic() - last), monotonic()
        return longest, last - begin

    longest, total = asyncio.run(longest_pause())
    assert longest < total / 2


def test_each_task_is_valid() -> None:
    runtime = make_runtime(vf.SubprocessConfig())
    for task in taskset(count=3):
        assert asyncio.run(task.validate(runtime)) is True


@contextmanager
def break_engine() -> Iterator[None]:
    shared_pool().submit(lambda: shared_pool().here().stop()).result()
    try:
        yield
    finally:
        SHARED_POOL.end()  # The next call starts another pool.


def test_a_failure_of_the_engine_is_no_reward(task: TrainingTask) -> None:
    trace = trace_of(task, "```python\ndef task_program():\n    say('not judged before')\n```")
    with break_engine(), pytest.raises(vf.TaskError, match="EngineError") as found:
        asyncio.run(task.score(trace))
    assert isinstance(found.value.__cause__, EngineError)
    assert trace.rewards == {"reward": None}


# --- missions of agents


def agent_tasks(count: int) -> list[TrainingTask]:
    return list(taskset(mode="agent", count=count, families=[AGENT_FAMILY]))


def right_calls(task: TrainingTask) -> list[Call]:
    program = trained_task(task.data.family, task.data.seed).solution
    rooms, message = re.findall(r"\[.*\]", program)[0], re.findall(r'say\("(.*)"\)', program)[0]
    each = [(("go_to", {"location": room}), ("say", {"message": message})) for room in json.loads(rooms)]
    return [call for calls in each for call in calls]


def test_missions_are_those_of_load_missions() -> None:
    some = list(taskset(mode="agent", split="test", count=3, seed=2))
    for task, row in zip(some, load_missions("test", count=3, seed=2), strict=True):
        assert (
            task.data.model_dump(include={"family", "seed", "prompt_index", "world"}).items() <= row.items()
        )
        assert task.data.system_prompt == row["prompt"][0]["content"]
        assert instruction_of(task) == row["prompt"][-1]["content"]
    assert len({task.key for task in some}) == 3
    assert [MissionToolset] == [type(one) for one in TrainingTaskset.toolsets(TrainingConfig(mode="agent"))]
    assert TrainingTaskset.toolsets(TrainingConfig()) == []


def test_the_server_offers_the_tools_and_passes_arguments_unchanged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent: list[Call] = [("say", {"message": "[1, 2]"}), ("wait", {"seconds": "soon"})]
    received: list[Call] = []

    async def call(_: MissionToolset, name: str, arguments: dict[str, Any]) -> str:
        received.append((name, arguments))
        return ""

    monkeypatch.setattr(MissionToolset, "call", call)
    tools, server = MissionToolset(vf.SharedToolsetConfig()), MCPServer("tools")
    tools.register(server)
    offered = {tool.name: tool.input_schema for tool in asyncio.run(server.list_tools())}
    for tool in mission_tools():
        schema = tool["function"]["parameters"]
        found = offered.pop(tool["function"]["name"])
        assert found.get("required", []) == schema["required"]
        for name, one in schema["properties"].items():
            assert one.items() <= found["properties"][name].items()
    assert not offered
    for one in sent:
        asyncio.run(server.call_tool(*one))
    assert received == sent


def test_a_mission_is_judged_by_its_calls() -> None:
    (task,) = agent_tasks(1)
    calls = right_calls(task)
    cases: list[list[Call]] = [[], calls[:2], calls, [*calls, ("give_up", {})], [("fly", {})] * MAX_MISTAKES]
    for some in cases:
        trace, mission = trace_of(task, "Done.", some), TrainingMission.begin(task.data.model_dump())
        for call in some:
            mission.call(*call)
        assert asyncio.run(task.mission_is_over(trace)) is mission.is_over
        mission.answer("Done.")
        asyncio.run(task.score(trace))
        assert trace.reward == mission.components.reward
        assert set(trace.metrics) == PARTS
    right = trace_of(task, "Done.", calls)
    asyncio.run(task.score(right))
    assert right.reward == right.metrics["passed"] == 1


def test_the_server_returns_the_results_of_calls() -> None:
    (task,) = agent_tasks(1)
    tools, mission = MissionToolset(vf.SharedToolsetConfig()), TrainingMission.begin(task.data.model_dump())
    trace = trace_of(task, "")
    trace.state = tools.state
    asyncio.run(task.setup(trace, make_runtime(vf.SubprocessConfig())))
    for call in [*right_calls(task), ("get_current_location", {}), ("give_up", {}), ("get_all_rooms", {})]:
        assert asyncio.run(tools.call(*call)) == mission.call(*call)


def test_a_mission_that_verifiers_stops_has_reached_a_limit() -> None:
    (task,) = agent_tasks(1)
    trace = trace_of(task, "", right_calls(task))
    trace.stop("max_turns")
    asyncio.run(task.score(trace))
    assert trace.reward == 0.5
    assert trace.metrics["without_errors"] == 0


def test_the_eval_command_lets_agents_act(tmp_path: Path, run: Run) -> None:
    tasks = agent_tasks(2)
    replies: dict[str, list[dict[str, Any]]] = {}
    for number, task in enumerate(tasks):
        calls = right_calls(task) if number % 2 else []
        replies[instruction_of(task)] = [*({"tool": call} for call in calls), {"content": "Done."}]
    with serve_replies(replies) as url:
        options = eval_options(url, tmp_path, 2, AGENT_FAMILY)
        run("vf-eval", *options, "--env.taskset.mode", "agent")
    traces = [trace for one in read_lines(tmp_path / "run" / "traces.jsonl") for trace in one["traces"]]
    assert all(trace["ok"] for trace in traces)
    scores = {trace["task"]["key"]: trace["rewards"]["reward"]["score"] for trace in traces}
    assert scores == {task.key: float(number % 2) for number, task in enumerate(tasks)}
    offered = [{tool["name"] for tool in trace["tools"]} for trace in traces]
    assert offered == [{tool["function"]["name"] for tool in mission_tools()}] * 2
    results = [node["message"]["content"] for trace in traces for node in trace["nodes"]
               if node["message"]["role"] == "tool"]  # fmt: skip
    assert results == ["done"] * sum(len(right_calls(task)) for task in tasks[1::2])


# --- the commands of verifiers


def test_the_eval_command_judges_programs(tmp_path: Path, run: Run) -> None:
    tasks = list(taskset(count=2, families=[FAMILY]))
    replies = {
        instruction_of(task): [{"content": solution(task) if number % 2 else ""}]
        for number, task in enumerate(tasks)
    }
    with serve_replies(replies) as url:
        run("vf-eval", *eval_options(url, tmp_path, 2))
    episodes = read_lines(tmp_path / "run" / "traces.jsonl")
    traces = [trace for episode in episodes for trace in episode["traces"]]
    assert all(trace["ok"] for trace in traces)
    scores = {trace["task"]["key"]: trace["rewards"]["reward"]["score"] for trace in traces}
    assert scores == {task.key: float(number % 2) for number, task in enumerate(tasks)}
    assert fmean(scores.values()) == 0.5
    assert all(set(trace["metrics"]) >= PARTS for trace in traces)


def test_the_eval_command_records_a_failure_of_the_engine(tmp_path: Path, run: Run) -> None:
    (task,) = taskset(count=1, families=[FAMILY])
    with serve_replies({instruction_of(task): [{"content": solution(task)}]}) as url:
        run("vf-eval", *eval_options(url, tmp_path, 1), stop_engine=True)
    (episode,) = read_lines(tmp_path / "run" / "traces.jsonl")
    (trace,) = episode["traces"]
    assert not episode["ok"]
    assert not trace["ok"]
    assert trace["errors"][0]["type"] == "TaskError"
    assert "EngineError" in trace["errors"][0]["message"]
    assert not any(trace["rewards"].values())


def test_the_validate_command_accepts_all_tasks(tmp_path: Path, run: Run) -> None:
    options = ("-n", "3", "-c", "2", "--runtime.type", "subprocess", "-o", tmp_path, "--run.name", "run")
    run("vf-validate", NAME, "--no-rich", *options)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcomes"]["valid"] == summary["total"] == 3


def instruction_of(task: TrainingTask) -> str:
    """Return the instruction at the end of a prompt."""
    return str(task.data.model_dump()["prompt"][-1]["content"])


def eval_options(url: str, folder: Path, count: int, family: str = FAMILY) -> list[str]:
    model = ["-m", "scripted", "--client.base-url", url, "--client.api-key-var", "NO_SUCH_KEY"]
    place = ["-o", str(folder), "--run.name", "run", "--no-push", "--no-rich"]
    return [NAME, "-n", str(count), "-c", "2", *model, *place, "--env.taskset.families", f'["{family}"]']


def read_lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@contextmanager
def serve_replies(replies: dict[str, list[dict[str, Any]]]) -> Iterator[str]:
    """Serve each instruction's replies, one after each result, and yield the address."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            stream, sent = bool(body.get("stream")), body["messages"]
            instruction = [one["content"] for one in sent if one["role"] == "user"][-1]
            results = sum(one["role"] == "tool" for one in sent)
            answer = encode_completion(replies[instruction][results], number=results, stream=stream)
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream" if stream else "application/json")
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/v1"
        finally:
            server.shutdown()


def encode_completion(reply: dict[str, Any], *, number: int, stream: bool) -> bytes:
    """Encode a chat completion, whole or as the only event of a stream."""
    message = {"role": "assistant", "content": reply.get("content", "")}
    if "tool" in reply:
        name, arguments = reply["tool"]
        function = {"name": name, "arguments": json.dumps(arguments)}
        message["tool_calls"] = [
            {"index": 0, "id": f"call-{number}", "type": "function", "function": function}
        ]
    reason = "tool_calls" if "tool" in reply else "stop"
    choice = {"index": 0, "finish_reason": reason, "delta" if stream else "message": message}
    usage = {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2}
    kind = "chat.completion.chunk" if stream else "chat.completion"
    body = {"id": "1", "object": kind, "created": 1, "model": "scripted", "choices": [choice], "usage": usage}
    data = json.dumps(body)
    return f"data: {data}\n\ndata: [DONE]\n\n".encode() if stream else data.encode()
