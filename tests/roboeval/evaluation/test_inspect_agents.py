"""Missions of agents in Inspect: our verdicts, in a log with each call and its result.

Inspect is an extra; `make test-inspect` runs this file.
"""

import gc
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

import pytest

pytest.importorskip("inspect_ai", reason="Inspect is an extra")

import anyio.lowlevel
from inspect_ai import eval as inspect_eval
from inspect_ai import score as inspect_score
from inspect_ai.log import EvalLog, EvalSample, read_eval_log
from inspect_ai.model import (
    ChatCompletionChoice,
    ChatMessageAssistant,
    ModelOutput,
    ModelUsage,
    get_model,
)
from inspect_ai.scorer import CORRECT, Score
from inspect_ai.tool import ToolCall

from codebotler.core.errors import UserError
from codebotler.prompts.tools import agent_prompt, tools_for
from roboeval.evaluation import inspect as inspecting
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.rows import Row
from roboeval.suites.load import Suite, load_suite
from small_suite import write_suite

# Inspect leaves one of its own streams open for each sample.
pytestmark = pytest.mark.filterwarnings("ignore:Unclosed <MemoryObjectReceiveStream:ResourceWarning")

Turn: TypeAlias = Sequence[tuple[str, Any]] | str
"""A reply of the model: calls with arguments, which may be invalid JSON, or a text."""

MAX_TURNS = 9
GO: Turn = [("go_to", {"location": "kitchen"})]
LOOK: Turn = [("is_in_room", {"entity": "jill"})]
HELLO: Turn = [("say", {"message": "hello"})]
STOP: Turn = [("give_up", {"reason": "I cannot."})]
CUT_OFF = "I will now"  # This reply reaches the limit of tokens.
UNLOGGABLE = "lone surrogates"
SCRIPTS: dict[str, tuple[Sequence[Turn], tuple[str, str] | None]] = {
    "passes": ([GO, LOOK, HELLO, "Done."], None),
    "recovers": ([[("fly", {})], GO, [*GO, *LOOK], HELLO, "Done."], None),
    "unknown tool": ([[("fly", {"to": "the moon"})]] * 4, ("AgentError", "UnknownTool")),
    "wrong arguments": ([[("go_to", {"place": "lobby"})]] * 4, ("AgentError", "WrongArguments")),
    "wrong type": ([[("go_to", {"location": ["lobby"]})]] * 4, ("AgentError", "WrongArguments")),
    "not JSON": ([[("get_all_rooms", '{"room": ')]] * 4, ("AgentError", "WrongArguments")),
    "several calls": ([[*GO, *GO, *LOOK]] * 4, ("AgentError", "SeveralCalls")),
    "no call": (["I would go to her office and ask her."], ("AgentError", "NoCall")),
    "turn limit": ([GO, LOOK] * 10, ("AgentError", "TurnLimit")),
    "gives up": ([LOOK, STOP], ("AgentError", "GaveUp")),
    "robot error": ([[("go_to", {"location": "x"})], STOP], ("RobotExecutionError", "GoToInvalidLocation")),
    "failed check": ([LOOK, "Done, and I said hello."], ("TaskCompletionError", "SayAtLocation")),
    "empty": ([GO, ""], ("NoProgram", "empty")),
    "cut off": ([GO, CUT_OFF], ("NoProgram", "cut-off")),
    UNLOGGABLE: (
        [[("say", {"message": "\ud800"})], [("f\ud800", {"\ud800": 1})], HELLO, "Done \ud800."],
        None,
    ),
}
TASK = f"""\
name: T
summary: s
prompts: {json.dumps(list(SCRIPTS))}
checks:
  says(what): {{category: SayAtLocation, rtl: 'tr.Exists(say("{{what}}"))'}}
worlds:
- {{about: one, robot: lobby, rooms: [kitchen, lobby], require: [says("hello")]}}
- about: two
  robot: kitchen
  rooms: [kitchen, lobby]
  people: {{kitchen: [{{name: jill}}]}}
  require: [says("hello")]
"""


@pytest.fixture(scope="module", autouse=True)
def collect_open_streams() -> Iterator[None]:
    """Collect the open streams while the mark above applies; it does not at the end of a session."""
    yield
    gc.collect()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_suite(tmp_path_factory.mktemp("suite"), TASK)


@pytest.fixture(scope="module")
def suite(folder: str) -> Suite:
    return load_suite(folder)


@pytest.fixture(scope="module")
def eval_log(folder: str, tmp_path_factory: pytest.TempPathFactory) -> EvalLog:
    """Carry out all scripts in all worlds at the same time."""
    return run_inspect(folder, tmp_path_factory.mktemp("logs"))


def run_inspect(folder: str, logs: Path, **options: Any) -> EvalLog:  # noqa: ANN401 - options of Inspect
    (log,) = inspect_eval(
        "codebotler/roboeval",
        model=get_model("mockllm/model", custom_outputs=answer, memoize=False),
        task_args={"suite": folder, "mode": "agent", "max_turns": MAX_TURNS},
        log_dir=str(logs),
        log_realtime=False,
        display="none",
        **options,
    )
    assert log.status == "success", log.error
    return read_eval_log(log.location)


async def answer(said: list[Any], *_: object) -> ModelOutput:
    """Reply with the turn of the script that follows those in the conversation."""
    turns, _failure = SCRIPTS[said[1].text]
    turn = turns[sum(message.role == "assistant" for message in said)]
    await anyio.lowlevel.checkpoint()  # Other samples can act between the turns.
    if isinstance(turn, str):
        reason = "max_tokens" if turn == CUT_OFF else "stop"
        output = ModelOutput.from_content("mockllm", turn, stop_reason=reason)
    else:
        calls = [as_call(f"call {number}", *call) for number, call in enumerate(turn)]
        message = ChatMessageAssistant(content="", tool_calls=calls)
        choices = [ChatCompletionChoice(message=message, stop_reason="tool_calls")]
        output = ModelOutput(model="mockllm", choices=choices)
    output.usage = ModelUsage(input_tokens=2, output_tokens=1, total_tokens=3)
    return output


def as_call(name: str, function: str, arguments: Any) -> ToolCall:  # noqa: ANN401 - JSON
    if isinstance(arguments, str):
        return ToolCall(name, function, {}, parse_error=f"Error parsing: {arguments}")
    return ToolCall(name, function, json.loads(json.dumps(arguments)))


def score_of(sample: EvalSample) -> Score:
    (score,) = (sample.scores or {}).values()
    return score


def replay(mission: AgentMission, turns: Sequence[Turn]) -> list[tuple[str, str]]:
    """Carry out a script without Inspect, and return each call with its result."""
    results: list[tuple[str, str]] = []
    for turn in turns[:MAX_TURNS]:
        if mission.ending is not None:
            break
        if turn in ("", CUT_OFF):
            mission.end("cut-off" if turn else "empty")
        elif isinstance(turn, str):
            mission.answer(turn)
        elif len(turn) == 1:
            results.append((turn[0][0], mission.call(*turn[0])))
        else:
            names = [name for name, _ in turn]
            result = mission.refuse_several(names)
            results += [(name, result) for name in names]
    if mission.ending is None:
        mission.end("TurnLimit")
    return results


@dataclass(frozen=True)
class Expected:
    """A mission that is carried out and judged without Inspect."""

    mission: AgentMission
    results: Sequence[tuple[str, str]]  # Each pair is the name of a call and its result.
    row: Row


@pytest.fixture(scope="module")
def expected(suite: Suite) -> dict[str, Expected]:
    """Carry out all scripts in all worlds, and return the results by the names of samples."""
    names, missions, completions = [], [], []
    for (prompt, (turns, failure)), world in product(enumerate(SCRIPTS.values()), range(2)):
        mission = AgentMission(suite, suite.task("T").scenarios[world].asked_by(prompt))
        missions.append((mission, replay(mission, turns)))
        no_program = mission.ending if failure is not None and failure[0] == "NoProgram" else None
        more = {"world": world, "ending": mission.ending, "no_program": no_program}
        program = mission.program
        completions.append(Completion(task="T", prompt=prompt, index=world, program=program, more=more))
        names.append(f"T/{prompt}/{world}")
    rows = evaluate(completions, suite)
    return {name: Expected(*mission, row) for name, mission, row in zip(names, missions, rows, strict=True)}


@pytest.mark.parametrize("world", [0, 1])
@pytest.mark.parametrize("name", [name for name in SCRIPTS if name != UNLOGGABLE])
def test_a_mission_gets_our_verdict_and_shows_its_calls(
    eval_log: EvalLog, expected: dict[str, Expected], name: str, world: int
) -> None:
    prompt, (_turns, failure) = list(SCRIPTS).index(name), SCRIPTS[name]
    ours = expected[f"T/{prompt}/{world}"]
    mission, results, row = ours.mission, ours.results, ours.row
    (sample,) = (one for one in eval_log.samples or [] if one.id == f"T/{prompt}/{world}")
    score = score_of(sample)
    assert (score.value == CORRECT) == row["passed"] == (failure is None)
    assert score.metadata["failure"] == row["failure"]
    if failure is not None:
        assert (score.metadata["failure"]["class"], score.metadata["failure"]["kind"]) == failure
    assert [one["world"] for one in score.metadata["worlds"]] == [["one", "two"][world]]
    assert score.metadata["ending"] == mission.ending
    assert score.metadata["tool_errors"] == dict(mission.mistakes)
    assert score.metadata["turns"] == sum(event.event == "model" for event in sample.events)
    assert score.answer == mission.program
    calls = [(event.function, event.result) for event in sample.events if event.event == "tool"]
    assert calls == results
    assert [message.text for message in sample.messages if message.role == "tool"] == [
        result for _, result in results
    ]


def test_text_that_a_log_cannot_contain_is_replaced(eval_log: EvalLog) -> None:
    prompt = list(SCRIPTS).index(UNLOGGABLE)
    for sample in (one for one in eval_log.samples or [] if one.id in {f"T/{prompt}/0", f"T/{prompt}/1"}):
        assert score_of(sample).value == CORRECT
        first = next(event for event in sample.events if event.event == "tool")
        assert (first.arguments, first.result) == ({"message": "?"}, "done")


def test_the_model_gets_our_prompt_and_tools(eval_log: EvalLog, suite: Suite) -> None:
    (sample,) = (one for one in eval_log.samples or [] if one.id == "T/0/0")
    first = next(event for event in sample.events if event.event == "model")
    assert [(tool.name, tool.description) for tool in first.tools] == [
        (tool.name, tool.description) for tool in tools_for(suite.skills)
    ]
    for tool, ours in zip(first.tools, tools_for(suite.skills), strict=True):
        assert tool.parameters.model_dump(exclude_none=True) == json.loads(ours.schema)
    asked = agent_prompt(sample.input, skills=suite.skills)
    assert [(said.role, said.text) for said in sample.messages[:2]] == [
        (said.role, said.text) for said in asked.messages
    ]
    assert (first.config.temperature, first.config.top_p) == (0.2, 0.95)


def test_a_log_of_missions_can_be_judged_again(eval_log: EvalLog) -> None:
    again = inspect_score(eval_log, inspecting.verdict(eval_log.eval.task_args["suite"]), action="overwrite")
    assert [score_of(one).value for one in again.samples or []] == [
        score_of(one).value for one in eval_log.samples or []
    ]
    assert {one.scores["verdict"].metadata["ending"] for one in again.samples or []} >= {
        "answer",
        "UnknownTool",
    }


@pytest.mark.parametrize("limit", [{"message_limit": 4}, {"turn_limit": 1}, {"token_limit": 4}])
def test_a_limit_of_inspect_ends_a_mission(folder: str, tmp_path: Path, limit: dict[str, int]) -> None:
    (sample,) = run_inspect(folder, tmp_path, limit=1, **limit).samples or []
    score = score_of(sample)
    assert sample.limit is not None
    assert score.metadata["failure"]["kind"] == "TimeoutError"
    assert score.metadata["turns"] == 1


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"mode": "replan"}, "replan"),
        ({"max_turns": 5}, "mode=agent"),
        ({"mode": "agent", "max_turns": 0}, "1,000"),
        ({"mode": "agent", "max_turns": "many"}, "1,000"),
    ],
)
def test_a_wrong_mode_or_limit_is_an_error(arguments: dict[str, Any], why: str) -> None:
    with pytest.raises(UserError, match=why):
        inspecting.roboeval(**arguments)
