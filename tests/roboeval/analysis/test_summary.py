"""Counts of an evaluation, and how they are printed."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from codebotler.core.errors import UserError
from made_results import table_of
from roboeval.analysis.counting.counts import tally_of
from roboeval.analysis.counting.summary import ALL, EvaluationSummary, kinds_in_order, summarise, summary_data
from roboeval.analysis.counting.summary import causes as causes_of
from roboeval.cli.views.results import summary_view
from roboeval.evaluation.judging.failures import FAILURE_CLASSES
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.scope import JudgingScope
from roboeval.suites.load import Suite
from small_run import ROWS, SUITE, TASK, row, text_of


def summary(
    rows: Sequence[Mapping[str, Any]],
    suite: Suite,
    *,
    k: Sequence[int] = (1,),
    scope: JudgingScope | None = None,
    ablated: bool = False,
) -> EvaluationSummary:
    scope = scope or JudgingScope(Counter(row["task"] for row in rows))
    return summarise(tally_of(table_of(rows)), suite, scope, k=k, ablated=ablated)


def completion(prompt: int, index: int, **more: str) -> Completion:
    return Completion(task="Visit", prompt=prompt, index=index, program="", more=more)


def test_a_summary_counts_tasks_prompts_and_failures() -> None:
    data = summary_data(summary(ROWS, SUITE, k=(1, 2)))
    assert (data["completions"], data["passed"], data["judged"], data["to_judge"]) == (4, 1, 4, 4)
    assert (data["requested"], data["cut_off"], data["max_tokens"]) == (None, 0, None)
    assert data["missing"] == ("Wait",)
    assert data["pass@1"] == {"mean": 0.25, "low": 0.0, "high": 1.0, "over": "tasks"}
    assert data["pass@2"]["mean"] == 0.5
    (task,) = data["tasks"]
    assert task["pass@1"] == {"mean": 0.25, "lowest": 0.0, "highest": 0.5}
    assert task["pass@2"] == {"mean": 0.5, "lowest": 0.0, "highest": 1.0}
    assert task["prompts"] == [
        {"prompt": 0, "completions": 2, "passed": 1, "pass@1": 0.5, "pass@2": 1.0},
        {"prompt": 1, "completions": 2, "passed": 0, "pass@1": 0.0, "pass@2": 0.0},
    ]
    counts = [(each["class"], each["count"], each["share"]) for each in data["failures"]]
    assert counts == [
        ("NoProgram", 0, 0.0),
        ("PythonError", 2, 0.5),
        ("RobotExecutionError", 0, 0.0),
        ("TaskCompletionError", 1, 0.25),
    ]
    json.dumps(data)


def test_all_known_kinds_are_always_listed_and_others_after_them() -> None:
    none, python, robot, checks, _ = FAILURE_CLASSES.values()
    kinds = [[kind.name for kind in each.kinds] for each in summary(ROWS, SUITE).failures]
    assert kinds == [[*none.kinds], [*python.kinds, "MemoryError"], [*robot.kinds], [*checks.kinds]]


def test_each_prompt_counts_the_same_however_many_completions_it_has() -> None:
    rows = [row(0, 0), row(1, 0), *(row(1, i, ("PythonError", "KeyError")) for i in range(1, 4))]
    assert summary(rows, SUITE).overall[0].mean == (1 + 0.25) / 2


def test_tasks_are_in_the_order_of_the_suite() -> None:
    rows = [row(0, 0, task="Wait"), row(0, 0)]
    assert [task.task for task in summary(rows, SUITE).tasks] == ["Visit", "Wait"]


def test_a_summary_of_nothing_is_refused() -> None:
    with pytest.raises(UserError, match=r"^0 of 0 completions "):
        summary([], SUITE)


@pytest.mark.parametrize("k", [0, 3])
def test_a_k_that_cannot_be_estimated_is_refused(k: int) -> None:
    with pytest.raises(UserError, match=r"\bk from 1 to 2$"):
        summary(ROWS, SUITE, k=(k,))


@pytest.mark.parametrize("width", [80, 120])
def test_tables_fit_the_width_without_breaking_numbers(width: int) -> None:
    rows = [
        row(p, i, ("PythonError", "NameError"), task=task)
        for task in ("Visit", "Wait")
        for p in range(2)
        for i in range(1000)
    ]
    text = text_of(summary_view(summary(rows, SUITE, k=(1, 2)), title="runs/one"), width)
    assert max(map(len, text.splitlines())) <= width
    assert "runs/one" in text
    assert "Visit" in text
    assert "4,000 of 4,000 completions failed (100.0%)" in text
    unknown = "pass@2 over all prompts: 0.000 (95% interval over tasks unknown: no variation between tasks)"
    assert unknown in " ".join(text.split())
    assert "\n4,000 of 4,000 completions, 4 prompts of 2 tasks\n" in text
    assert "without a program" not in text, "every reply has a program"
    assert re.search(r"\n  NameError +4,000  100\.0%", text)
    assert re.search(r"failed checks +0 +0.0%", text)
    assert "ExhaustiveSearch" not in text


def test_a_single_program_shows_only_its_own_failure() -> None:
    tasks = {name: replace(TASK, name=name) for name in ("Visit", "A", "B", "C", "D")}
    counts = summary([row(0, 0, ("PythonError", "NameError"))], replace(SUITE, tasks=tasks))
    text = text_of(summary_view(counts, title="mine"), 100)
    assert text.rstrip().endswith("Python errors  1  100.0%\n  NameError    1  100.0%")
    assert "\nno results for 4 tasks\n" in text


def test_tasks_without_a_score_are_counted() -> None:
    suite = replace(SUITE, tasks={name: replace(TASK, name=name) for name in ("Visit", "A", "B", "C")})
    scope = JudgingScope({"Visit": 9, "B": 2, "C": 5}, frozenset({"Visit", "A", "B"}))
    counted = summary(ROWS, suite, scope=scope)
    data = summary_data(counted)
    assert data["missing"] == ("A", "B", "C")
    assert (data["judged"], data["to_judge"]) == (4, 11)
    text = text_of(summary_view(counted, title="x"))
    assert "\n4 of 11 completions (7 not judged), 2 prompts of 1 task\n" in text
    assert re.search(r"\nVisit +4 of 9 ", text)
    assert "\nno results for 3 tasks\n" in text
    with pytest.raises(UserError, match=r"^0 of 11 completions "):
        summary([], suite, scope=scope)


def test_missing_completions_are_counted() -> None:
    about = {"batches": [{"tasks": ["Visit"], "num_completions": 3}], "settings": {"max_tokens": 512}}
    there = [completion(n // 2, n % 2, finish_reason="length" if n else "stop") for n in range(4)]
    counted = summary(ROWS[:3], SUITE, scope=JudgingScope.of(there, frozenset({"Visit"}), about, SUITE))
    data = summary_data(counted)
    assert (data["judged"], data["to_judge"], data["requested"]) == (3, 4, 6)
    assert (data["cut_off"], data["max_tokens"], data["tasks"][0]["requested"]) == (3, 512, 6)
    text = text_of(summary_view(counted, title="x"), 200)
    assert "\n3 of 6 completions (2 missing, 1 not judged)," in text
    assert re.search(r"\nVisit +3 of 6 ", text)
    assert re.search(r"\n3 of 4 replies \(75\.0%\) .*512 tokens; .*--max-tokens\n", text)


@pytest.mark.parametrize(("cut_off", "is_said"), [(2, False), (3, True)])
def test_more_than_one_cut_off_reply_in_fifty_causes_a_warning(cut_off: int, *, is_said: bool) -> None:
    warning = JudgingScope({"Visit": 100}, cut_off=cut_off).cut_off_warning
    assert (warning is not None) == is_said
    if warning is not None:
        assert "--max-tokens" in warning
        assert "tokens" not in warning.partition(";")[0], "the limit is unknown"


def test_replies_without_a_program_are_a_class_with_kinds() -> None:
    rows = [row(0, 0), row(0, 1, ("NoProgram", "cut-off")), row(1, 0, ("NoProgram", "refusal"))]
    counted = summary(rows, SUITE)
    text = text_of(summary_view(counted, title="x"))
    assert re.search(r"\nwithout a program +2 +66\.7%", text)
    assert re.search(r"\n  cut-off +1 +33\.3%", text)


def test_one_completion_is_written_in_the_singular() -> None:
    one = row(0, 0, ("PythonError", "NameError"))
    assert "1 of 1 completion failed" in text_of(summary_view(summary([one], SUITE), title="x"))
    with pytest.raises(UserError, match=r"^0 of 1 completion "):
        summary([], SUITE, scope=JudgingScope({"Visit": 1}))


def test_one_passing_prompt_has_no_interval_and_no_failures() -> None:
    text = text_of(summary_view(summary([row(0, 0)], SUITE), title="x"))
    assert "interval" not in text
    assert "SyntaxError" not in text


def test_an_ablation_is_named_and_reports_no_missing_task() -> None:
    text = text_of(summary_view(summary(ROWS, SUITE, ablated=True), title="x"))
    assert "x (ablation" in text
    assert "Wait" not in text


def test_causes_are_shares_by_class_and_by_kind() -> None:
    rows = [
        row(0, 0),
        *(row(0, n, ("PythonError", kind)) for n, kind in enumerate(("X", "NameError", "X"), 1)),
    ]
    found = causes_of(tally_of(table_of([*rows, row(0, 4, ("TaskCompletionError", "Location"))])))
    assert found.classes == {
        "passed": pytest.approx(0.2),
        "NoProgram": 0,
        "PythonError": pytest.approx(0.6),
        "RobotExecutionError": 0,
        "TaskCompletionError": pytest.approx(0.2),
    }
    assert found.kinds["PythonError"] == {"NameError": pytest.approx(1 / 3), "X": pytest.approx(2 / 3)}
    assert found.kinds["RobotExecutionError"] == {}
    assert found.counts["PythonError", "X"] == 2
    assert found.counts["PythonError", ALL] == 3
    other = causes_of(tally_of(table_of([row(0, 0, ("PythonError", "TypeError"))])))
    assert kinds_in_order([found, other], "PythonError") == ["NameError", "TypeError", "X"]
