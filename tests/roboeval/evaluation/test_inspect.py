"""The benchmark in Inspect: the same verdicts as ours, in a log that its viewer opens.

Inspect is an extra; `make test-inspect` runs this file.
"""

import asyncio
import gc
import os
import signal
import socket
import threading
import time
import urllib.request
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("inspect_ai", reason="Inspect is an extra")

from inspect_ai import eval as inspect_eval
from inspect_ai.log import EvalLog, list_eval_logs, read_eval_log
from inspect_ai.model import ModelOutput, ModelUsage, get_model
from inspect_ai.scorer import CORRECT, Target
from playwright.sync_api import expect, sync_playwright

from codebotler.core.errors import UserError
from codebotler.prompts import prompt_for
from forked import PROGRAMS, Forked
from roboeval.evaluation import inspect as inspecting
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite
from viewing import chromium

# Inspect leaves one of its own streams open for each sample.
pytestmark = pytest.mark.filterwarnings("ignore:Unclosed <MemoryObjectReceiveStream:ResourceWarning")

TASK = "codebotler/roboeval"


@pytest.fixture(scope="module", autouse=True)
def collect_open_streams() -> Iterator[None]:
    """Collect the open streams while the mark above applies; it does not at the end of a session."""
    yield
    gc.collect()


def model_of(completions: list[Completion], rules: Sequence[str] = ()) -> Any:  # noqa: ANN401 - Inspect has no types here
    """Return a model that answers with recorded programs, which take turns for the same prompt."""
    programs: dict[str, list[str]] = defaultdict(list)
    for completion in completions:
        assert completion.instruction is not None
        asked = prompt_for(completion.instruction, rules=rules).messages[-1].text
        programs[asked].append(completion.program)
    turns = {asked: count() for asked in programs}

    def answer(said: list[Any], *_: object) -> ModelOutput:
        known = programs[said[-1].text]
        program = known[next(turns[said[-1].text]) % len(known)]
        output = ModelOutput.from_content("mockllm", f"Here it is:\n```python\n{program}```\n")
        output.usage = ModelUsage()  # Inspect would download a table to count tokens.
        return output

    return get_model("mockllm/model", custom_outputs=answer)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs")


@pytest.fixture(scope="module")
def recorded(paper: Suite) -> list[Completion]:
    """Return right and wrong completions of all tasks."""
    return [*recorded_completions("recorded:hasty", paper)]


@pytest.fixture(scope="module")
def eval_log(logs: Path, recorded: list[Completion]) -> EvalLog:
    """Let Inspect judge the recorded completions."""
    most = max(Counter((completion.task, completion.prompt) for completion in recorded).values())
    (log,) = inspect_eval(
        TASK, model=model_of(recorded), epochs=most, log_dir=str(logs), log_realtime=False, display="none"
    )
    assert log.status == "success", log.error
    return read_eval_log(log.location)


def test_a_cut_off_reply_fails_without_a_program(tmp_path: Path) -> None:
    output = ModelOutput.from_content(
        "mockllm", "```python\ndef task_program():\n    say(", stop_reason="max_tokens"
    )
    output.usage = ModelUsage()
    (log,) = inspect_eval(
        TASK,
        model=get_model("mockllm/model", custom_outputs=[output] * 5),
        task_args={"tasks": ["LunchTime"]},
        log_dir=str(tmp_path),
        display="none",
    )
    scores = [score for one in log.samples or [] for score in (one.scores or {}).values()]
    assert [score.metadata["failure"]["class"] for score in scores] == ["NoProgram"] * 5
    assert {score.metadata["failure"]["kind"] for score in scores} == {"cut-off"}


def test_all_recorded_completions_get_our_verdicts(
    eval_log: EvalLog, recorded: list[Completion], paper: Suite
) -> None:
    ours = {
        (c.task, c.prompt, c.program.rstrip()): row
        for c, row in zip(recorded, evaluate(recorded, paper, workers=2), strict=True)
    }
    found = {}
    for sample in eval_log.samples or []:
        (score,) = (sample.scores or {}).values()
        key = sample.metadata["task"], sample.metadata["prompt"], score.answer.rstrip()
        found[key] = score
        row = ours[key]
        assert (score.value == CORRECT) == row["passed"]
        assert score.metadata["failure"] == row["failure"]
        for world, verdict in zip(score.metadata["worlds"], row["verdicts"], strict=True):
            assert [world[k] for k in ("world", "satisfied", "status", "error", "line")] == [
                verdict[k] for k in ("world", "satisfied", "status", "error", "line")
            ]
            assert [failed["check"] for failed in world["failed_checks"]] == verdict["failed_checks"]
            assert len(world["steps"]) == len(verdict["trace"])
            ended = f"{world['world']}: {'satisfied' if world['satisfied'] else 'not satisfied'}"
            assert ended in score.explanation.splitlines()
            for failed in world["failed_checks"]:
                assert f"- {failed['check']}: {failed['explanation']}" in score.explanation
    assert found.keys() == ours.keys()
    shares = eval_log.results.scores[0].metrics
    samples = eval_log.samples or []
    passed = sum(next(iter((s.scores or {}).values())).value == CORRECT for s in samples)
    assert shares["accuracy"].value == pytest.approx(passed / len(samples))
    assert shares.keys() >= {"accuracy", "stderr", *paper.tasks}


@pytest.mark.parametrize("model", ["careful", "hasty"])
def test_the_suite_of_house_rules_is_judged_by_its_rules(tmp_path: Path, model: str) -> None:
    suite = load_suite("rules")
    recorded = [*recorded_completions(f"recorded:{model}", suite)]
    (log,) = inspect_eval(
        TASK,
        model=model_of(recorded, suite.house_sentences),
        task_args={"suite": "rules"},
        log_dir=str(tmp_path),
        log_realtime=False,
        display="none",
    )
    assert log.status == "success", log.error
    samples = read_eval_log(log.location).samples or []
    passed = {
        sample.id: score.value == CORRECT for sample in samples for score in (sample.scores or {}).values()
    }
    assert len(passed) == sum(len(task.prompts) for task in suite.tasks.values())
    assert set(passed.values()) == {model == "careful"}


def test_a_sample_has_the_prompt_of_our_command(paper: Suite) -> None:
    made = inspecting.roboeval(tasks="LunchTime,SayGoodDay")
    assert [sample.id for sample in made.dataset] == [
        f"{task}/{number}" for task in ("LunchTime", "SayGoodDay") for number in range(5)
    ]
    (instruction, asked) = (paper.tasks["SayGoodDay"].prompts[2], made.dataset[7].input)
    assert asked == instruction
    state = SimpleNamespace(input_text=asked, messages=[])
    found = asyncio.run(made.setup(state, None)).messages
    ours = prompt_for(instruction).messages
    assert [(said.role, said.text) for said in found] == [(said.role, said.text) for said in ours]
    assert (made.config.temperature, made.config.top_p, made.config.max_tokens) == (0.2, 0.95, None)
    with pytest.raises(UserError, match='"Sing"'):
        inspecting.roboeval(tasks=["Sing"])
    with pytest.raises(UserError, match="written by hand"):
        inspecting.roboeval(worlds=3)


def score_program(program: str) -> Any:  # noqa: ANN401 - Inspect has no types here
    about = {"task": "SayGoodDay", "prompt": 0}
    state = SimpleNamespace(metadata=about, output=SimpleNamespace(completion=program, choices=[]))
    return inspecting.verdict()(state, Target(""))  # The scorer reads only these fields.


def test_text_that_a_log_cannot_contain_is_replaced() -> None:
    score = asyncio.run(score_program("def task_program():\n    go_to('amy\\'s lab')\n    say('\\ud800')\n"))
    assert score.metadata["worlds"][0]["steps"][-1]["text"] == "?"
    assert score.model_dump_json()


def test_the_event_loop_runs_while_a_program_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    went_on = threading.Event()

    def evaluate_slowly(*arguments: Any, **options: Any) -> Iterator[Row]:  # noqa: ANN401 - the arguments of evaluate
        assert went_on.wait(20), "the event loop is blocked"
        return evaluate(*arguments, **options)

    monkeypatch.setattr(inspecting, "evaluate", evaluate_slowly)

    async def judge_meanwhile() -> Any:  # noqa: ANN401 - Inspect has no types here
        judging = asyncio.ensure_future(score_program("def task_program():\n    pass\n"))
        await asyncio.sleep(0.1)
        went_on.set()
        return await judging

    assert asyncio.run(judge_meanwhile()).value != CORRECT


# --- the command and the viewer

COMMAND = """
import tiktoken
class Words:  # the mock model counts tokens with a table from the network, which tests go without
    def encode(self, text, **_):
        return text.split()
tiktoken.get_encoding = lambda name: Words()
from importlib.metadata import entry_points
(command,) = entry_points(group="console_scripts", name="inspect")
command.load()()
"""
PRELOAD = (
    *(*PROGRAMS, "inspect_ai._cli.main", "inspect_ai.model", "tiktoken"),
    *("inspect_ai.model._openai_responses", "inspect_ai.model._providers.anthropic"),
)
"""What the command needs, but not our task: Inspect is to find that by its name."""


@pytest.mark.parametrize(
    ("options", "kind"),
    [("", "no-code"), ("-T mode=agent -T max_turns=2", "NoCall")],
    ids=["program", "agent"],
)
def test_the_command_finds_the_task_by_its_name(tmp_path: Path, options: str, kind: str) -> None:
    asked = f"eval {TASK} --model mockllm/model -T tasks=LunchTime {options} --limit 2 --display plain"
    words = ("-c", COMMAND, *asked.split(), "--log-dir", str(tmp_path))
    with Forked(*words, cwd=tmp_path, environment=os.environ, preload=PRELOAD) as running:
        said = running.communicate()
    assert running.returncode == 0, said
    (found,) = list_eval_logs(str(tmp_path))
    log = read_eval_log(found)
    assert (log.status, log.eval.task_registry_name) == ("success", TASK)
    assert [scorer.name for scorer in log.eval.scorers] == ["verdict"]
    for sample in log.samples or []:
        (score,) = (sample.scores or {}).values()
        assert score.metadata["failure"]["kind"] == kind


@pytest.fixture
def viewer(logs: Path, tmp_path: Path) -> Iterator[str]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ("view", "start", "--host", "127.0.0.1", "--port", str(port), "--log-dir", str(logs))
    url = f"http://127.0.0.1:{port}/"
    with (
        Path(os.devnull).open("w") as nothing,
        Forked(
            *("-c", "import os\nos.dup2(2, 1)\n" + COMMAND, *words),
            cwd=tmp_path,
            environment=os.environ,
            stderr=nothing,
            preload=PRELOAD,
        ) as viewing,
    ):
        try:
            for _ in range(200):
                try:
                    urllib.request.urlopen(url).close()
                    break
                except OSError:
                    time.sleep(0.1)
            yield url
        finally:
            viewing.send_signal(signal.SIGTERM)


def test_the_viewer_opens_the_log(eval_log: EvalLog, viewer: str, pytestconfig: pytest.Config) -> None:
    browser_path = chromium()
    if browser_path is None:
        pytest.skip("there is no Chromium here: apt-get install chromium-headless-shell")
    sample = next(one for one in eval_log.samples or [] if one.scores["verdict"].metadata["failure"])
    failed = next(w for w in sample.scores["verdict"].metadata["worlds"] if not w["satisfied"])
    shots = pytestconfig.getoption("--shots")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=browser_path, args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1400, "height": 1000})
        page.set_default_timeout(40_000)
        expect.set_options(timeout=40_000)
        page.goto(viewer)
        expect(page.get_by_text("320 Samples")).to_be_visible()
        expect(page.get_by_text(sample.input[:40]).first).to_be_visible()
        if shots:
            page.screenshot(path=str(Path(shots) / "inspect-samples.png"))
        page.get_by_text(sample.id, exact=True).nth(sample.epoch - 1).click()
        page.get_by_role("tab", name="Scoring").click()
        expect(page.get_by_text(f"{failed['world']}: not satisfied")).to_be_visible()
        if shots:
            page.screenshot(path=str(Path(shots) / "inspect-scoring.png"))
        browser.close()
