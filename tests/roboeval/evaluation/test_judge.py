"""Judging: errors, limits, worlds that may wait, and options that cannot be judged."""

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.trace import Event, Option, Outcome, RunError, Status, Trace
from codebotler.core.world import Room, World
from codebotler.rtl import holds
from codebotler.rtl.formulas import Formula
from codebotler.simulator.worker import run_log
from roboeval.evaluation.judging.failures import Verdict, failure_of_verdicts
from roboeval.evaluation.judging.judge import MAX_RESULT_EVENTS, ResultCache, evaluate, judge
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.rows import Failure, Row
from roboeval.suites.load import Scenario, Suite, load_suite
from small_suite import write_suite

SUITE = "name: mine\nversion: 1\n"
TASK = """\
name: T
summary: s
prompts: [p]
checks:
  goes: {category: Location, rtl: 'tr.Exists(goto("kitchen"))'}
  asks: {category: AskAtLocation, rtl: 'tr.Exists(ask("tea", ".*"))'}
  says(what): {category: SayAtLocation, rtl: 'tr.Exists(say("{what}"))'}
worlds:
  - about: one
    robot: kitchen
    rooms: [kitchen]
    people: {kitchen: [{name: kim, answers: ["1", "2"]}]}
    require: [goes, says("hi"), not asks]
  - about: may wait
    robot: kitchen
    rooms: [kitchen]
    may_wait_forever: true
    require: [goes]
"""


@pytest.fixture
def suite(tmp_path: Path) -> Suite:
    (tmp_path / "suite.yaml").write_text(SUITE)
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "T.yaml").write_text(TASK)
    return load_suite(str(tmp_path))


def judge_programs(suite: Suite, *programs: str) -> list[Row]:
    completions = [Completion(task="T", prompt=0, index=i, program=p) for i, p in enumerate(programs)]
    return list(evaluate(completions, suite, workers=2))


def test_a_program_is_judged_by_what_its_prompt_asks_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    task = TASK.replace("[p]", "[p, p and not a word, p in silence]").replace(
        '[goes, says("hi"), not asks]',
        """[goes, not asks, {check: 'not says("hi")', prompts: {1: not a word, 2: silence}}]""",
    )
    assert task != TASK
    suite = load_suite(write_suite(tmp_path, task))
    says, errs = (
        f"def task_program():\n    go_to('kitchen')\n    {last}\n" for last in ("say('hi')", "say(1)")
    )
    completions = [
        Completion(task="T", prompt=prompt, index=0, program=program)
        for prompt in range(3)
        for program in (says, errs)
    ]
    with caplog.at_level(logging.DEBUG, logger=run_log.name):
        rows = list(evaluate(completions, suite))
    assert [row["passed"] for row in rows[::2]] == [True, False, False]
    assert [row["verdicts"][0]["failed_checks"] for row in rows[::2]] == [[], *[['not says("hi")']] * 2]
    assert [row["verdicts"][0]["satisfied"] for row in rows] == [True, *[False] * 5]
    assert [row["failure"] for row in rows[1::2]] == [rows[1]["failure"]] * 3
    started = [record for record in caplog.records if record.getMessage().endswith("started")]
    assert len(started) == 2 * 2  # Each program runs once in each world.


def first_failure(suite: Suite, program: str) -> Failure | None:
    (row,) = judge_programs(suite, program)
    assert row["passed"] == (row["failure"] is None)
    return row["failure"]


GOOD = "def task_program():\n    go_to('the kitchen')\n    say('hi')\n"


def test_a_program_that_satisfies_every_world_passes(suite: Suite) -> None:
    assert first_failure(suite, GOOD) is None


def test_the_first_failed_check_decides(suite: Suite) -> None:
    assert first_failure(suite, "def task_program(): say('hi')") == {
        "class": "TaskCompletionError",
        "kind": "Location",
        "world": 0,
        "check": "goes",
    }


def test_an_error_decides_over_earlier_actions(suite: Suite) -> None:
    why = first_failure(suite, GOOD + "    pick('x')\n")
    assert why == {"class": "RobotExecutionError", "kind": "PickInvalidObject", "world": 0, "check": None}
    why = first_failure(suite, GOOD + "    undefined\n")
    assert why == {"class": "PythonError", "kind": "NameError", "world": 0, "check": None}


def test_the_trace_before_an_error_is_kept_but_not_judged(suite: Suite) -> None:
    (row,) = judge_programs(suite, GOOD + "    undefined\n")
    verdict = row["verdicts"][0]
    assert verdict["trace"] == [["goto", "the kitchen"], ["say", "hi"]]
    assert verdict["failed_checks"] == []
    assert not verdict["satisfied"]


def test_a_limit_fails_a_world_that_may_not_wait(suite: Suite) -> None:
    assert first_failure(suite, GOOD + "    while True: time.sleep(1)\n") == {
        "class": "PythonError",
        "kind": "TimeoutError",
        "world": 0,
        "check": None,
    }


def test_requirements_decide_at_a_limit_if_a_world_may_wait(suite: Suite) -> None:
    (waits, waits_elsewhere) = judge_programs(
        suite,
        GOOD + "    while True: time.sleep(1)\n",
        "def task_program():\n    while True: time.sleep(1)\n",
    )
    assert waits["verdicts"][1]["satisfied"]
    assert waits["verdicts"][1]["status"] == "timeout"
    assert not waits_elsewhere["verdicts"][1]["satisfied"]
    assert waits_elsewhere["verdicts"][1]["failed_checks"] == ["goes"]


def test_an_option_that_is_not_text_cannot_be_judged(suite: Suite) -> None:
    program = GOOD + "    ask('', 'coffee?', [1, 2])\n"
    assert first_failure(suite, program) == {
        "class": "TaskCompletionError",
        "kind": "AskAtLocation",
        "world": 0,
        "check": "not asks",
    }
    (row,) = judge_programs(suite, program)
    assert row["verdicts"][0]["status"] == "finished"
    assert row["verdicts"][0]["error"] is None
    assert row["verdicts"][0]["trace"][-1] == ["ask", "coffee?", [{"no text": "1"}, {"no text": "2"}], "1"]


def test_a_program_is_judged_without_changes(suite: Suite) -> None:
    assert first_failure(suite, "```python\n" + GOOD + "```") == {
        "class": "PythonError",
        "kind": "SyntaxError",
        "world": 0,
        "check": None,
    }
    assert first_failure(suite, "go_to('kitchen')\nsay('hi')\n") == {
        "class": "PythonError",
        "kind": "NameError",
        "world": 0,
        "check": None,
    }
    cut_off = GOOD[:-2]
    assert first_failure(suite, cut_off) is not None


def test_rows_come_in_the_order_of_completions(suite: Suite) -> None:
    programs = [f"def task_program():\n    say('{n}')\n" for n in (3, 1, 2, 1, 3)]
    said = [row["verdicts"][0]["trace"][0][1] for row in judge_programs(suite, *programs)]
    assert said == ["3", "1", "2", "1", "3"]


def test_a_killed_process_is_a_crash(suite: Suite) -> None:
    assert first_failure(suite, "import os\nos._exit(0)") == {
        "class": "PythonError",
        "kind": "Crash",
        "world": 0,
        "check": None,
    }


# --- judging outcomes

WORLD = Scenario(World((Room("kitchen"),), "kitchen", about="w"), ())
GREETING: Trace = (Event("say", "hi"),)


@pytest.mark.parametrize("status", [s for s in Status if s is not Status.FINISHED])
def test_only_a_finished_run_can_satisfy_a_world(status: Status) -> None:
    outcome = Outcome(status, GREETING, RunError("X", "x"))
    assert not judge(outcome, WORLD).satisfied
    assert judge(Outcome(Status.FINISHED, GREETING), WORLD).satisfied


def test_the_first_unsatisfied_world_decides() -> None:
    def verdict(kind: str, *, satisfied: bool) -> Verdict:
        error = None if satisfied else RunError(kind, "m")
        status = Status.FINISHED if satisfied else Status.PYTHON_ERROR
        return Verdict("w", Outcome(status, (), error), (), satisfied=satisfied)

    verdicts = [verdict("A", satisfied=True), verdict("B", satisfied=False), verdict("C", satisfied=False)]
    assert failure_of_verdicts(verdicts) == {"class": "PythonError", "kind": "B", "world": 1, "check": None}
    assert failure_of_verdicts(verdicts[:1]) is None


def test_options_of_different_types_differ() -> None:
    assert Option("1", is_text=False) != Option("1")


OURS = Completion(task="Visit", prompt=0, index=0, program="")


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (replace(OURS, task="Vist"), '"Vist"'),
        (replace(OURS, prompt=9), "no prompt 9; .* prompts 0 to "),
        (OURS.row, "dict.* Completion"),
    ],
)
def test_anything_but_a_completion_of_the_suite_is_refused(paper: Suite, wrong: object, named: str) -> None:
    task = next(iter(paper.tasks))
    if isinstance(wrong, Completion) and wrong.task == OURS.task:
        wrong = replace(wrong, task=task)
    completion: Any = wrong
    with pytest.raises(UserError, match=named):
        list(evaluate([completion], paper))


def test_evaluating_a_task_without_its_ablation_is_refused(paper: Suite) -> None:
    task = next(task.name for task in paper.tasks.values() if task.ablation is None)
    completion = replace(OURS, task=task)
    with pytest.raises(UserError, match=f'"{task}" .*ablation'):
        list(evaluate([completion], paper, ablated=True))


HI = (Event("goto", "kitchen"), Event("say", "hi"))


# --- replies without a program

HALF = 'def task_program():\n    go_to("kitchen")\n'


@pytest.mark.parametrize(
    ("program", "more", "why"),
    [
        ("I cannot do that.", {"no_program": "refusal"}, ("NoProgram", "refusal")),
        ("", {}, ("NoProgram", "empty")),
        ("def task_program():\n    say(", {"finish_reason": "length"}, ("NoProgram", "cut-off")),
        ("Sorry.", {"raw_reply": "Sorry.", "finish_reason": "stop"}, ("NoProgram", "no-code")),
        ("Sorry.", {"finish_reason": "tool_calls"}, ("NoProgram", "tool-call")),
        ("Sorry.", {}, ("PythonError", "SyntaxError")),  # The raw reply is unknown.
        ("x = task", {"no_program": None}, ("PythonError", "NameError")),
        (GOOD, {"finish_reason": "length"}, None),
        (GOOD, {"no_program": "cut-off"}, None),  # The verdict is about the program.
        (HALF, {"finish_reason": "length", "raw_reply": f"```\n{HALF}"}, ("NoProgram", "cut-off")),
        (
            HALF,
            {"finish_reason": "length", "raw_reply": f"```\n{HALF}```\nIt"},
            ("TaskCompletionError", "Say"),
        ),
        (HALF, {"no_program": "cut-off"}, ("NoProgram", "cut-off")),
    ],
)
def test_reply_without_a_program_fails_by_its_cause(
    suite: Suite, program: str, more: dict[str, Any], why: tuple[str, str] | None
) -> None:
    [row] = evaluate([Completion(task="T", prompt=0, index=0, program=program, more=more)], suite)
    failed = row["failure"]
    if why is None:
        assert row["passed"]
    else:
        assert failed is not None
        assert failed["class"] == why[0]
        assert failed["kind"].startswith(why[1])
        assert failed["world"] == 0
        assert failed["check"] is None or failed["class"] == "TaskCompletionError"


def test_kind_that_does_not_exist_is_refused() -> None:
    with pytest.raises(UserError, match="cut-off"):
        Completion(task="T", prompt=0, index=0, program="", more={"no_program": "cutoff"})


@pytest.fixture
def tested_traces(monkeypatch: pytest.MonkeyPatch) -> list[Trace]:
    """Record the traces on which a formula is tested, with an empty cache."""
    traces: list[Trace] = []
    monkeypatch.setattr("roboeval.evaluation.judging.judge.REQUIREMENT_CACHE", ResultCache())

    def record_trace(formula: Formula, trace: Trace) -> bool:
        traces.append(trace)
        return holds(formula, trace)

    monkeypatch.setattr("roboeval.evaluation.judging.judge.holds", record_trace)
    return traces


def test_equal_traces_are_tested_once_for_equal_requirements(
    suite: Suite, tested_traces: list[Trace]
) -> None:
    one, other = suite.tasks["T"].scenarios
    for time in range(3):
        run = Outcome(Status.FINISHED, tuple(replace(event, time=time) for event in HI))
        assert [judge(run, one).satisfied, judge(run, other).satisfied] == [True, True]
    assert len(tested_traces) == len(one.require) + len(other.require)
    alike = replace(one, world=replace(one.world, about="another"))
    assert judge(Outcome(Status.FINISHED, HI), alike).satisfied
    assert len(tested_traces) == len(one.require) + len(other.require)
    assert not judge(Outcome(Status.FINISHED, HI[:1]), one).satisfied


def test_long_traces_are_not_cached_and_old_ones_are_evicted(
    suite: Suite, tested_traces: list[Trace], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("roboeval.evaluation.judging.judge.MAX_RESULTS", 2)
    scenario = suite.tasks["T"].scenarios[1]
    long = Outcome(Status.FINISHED, HI * MAX_RESULT_EVENTS)
    runs = [Outcome(Status.FINISHED, (*HI, Event("say", text))) for text in "abc"]
    for run, times in ((long, 2), (runs[0], 1), (runs[1], 1), (runs[2], 1), (runs[0], 1)):
        tested_traces.clear()
        assert [judge(run, scenario).satisfied for _ in range(2)] == [True, True]
        assert len(tested_traces) == times
