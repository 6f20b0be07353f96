"""Compare two runs: scores computed by hand, and the command."""

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from command_line import refused, roboeval
from made_results import results_of
from roboeval.analysis.comparisons.compare import (
    Comparison,
    compare_scores,
    comparison_data,
    comparison_sentence,
    failure_shares,
    other_differences,
    pairs_to_compare,
    sample_size_sentences,
)
from roboeval.cli.inputs import expect_same_suite
from roboeval.cli.views.comparison import comparison_view
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import Results
from small_run import HOSTILE, SHOWN, SUITE, row, text_of

FIRST = {("A", 0): 0.5, ("A", 1): 0.5, ("B", 0): 0.2, ("C", 0): 1.0}
SECOND = {("A", 0): 0.7, ("A", 1): 0.9, ("B", 0): 0.2, ("D", 0): 1.0}


def test_scores_are_paired_by_prompt() -> None:
    found = compare_scores(FIRST, SECOND)
    assert (found.prompts, found.left_out) == (3, 2)
    assert (found.first, found.second) == pytest.approx((0.4, 0.6))
    assert found.over_tasks.mean == found.over_prompts.mean == pytest.approx(0.2)
    assert [(one.task, one.prompts) for one in found.tasks] == [("A", 2), ("B", 1)]
    assert [one.share for one in found.tasks] == pytest.approx([0.2, 0.0])
    assert sum(one.share for one in found.tasks) == pytest.approx(found.over_tasks.mean)
    assert found.p_tasks == 1.0  # B has no difference, so only A has a sign.
    assert found.p_prompts == 0.5


def test_swapping_runs_mirrors_the_comparison() -> None:
    one, other = compare_scores(FIRST, SECOND), compare_scores(SECOND, FIRST)
    assert one.over_tasks.low == pytest.approx(-other.over_tasks.high)
    assert one.p_prompts == other.p_prompts
    assert one.sample_sizes == other.sample_sizes


def test_runs_without_a_common_prompt_are_refused() -> None:
    with pytest.raises(UserError, match="no prompt"):
        compare_scores({("A", 0): 1.0}, {("A", 1): 1.0})


def test_verdicts() -> None:
    def text(differences: list[float], tasks: int) -> str:
        a = {(f"T{i % tasks}", i): 0.4 for i in range(len(differences))}
        b = {key: 0.4 + d for key, d in zip(a, differences, strict=True)}
        return comparison_sentence(compare_scores(a, b), ("one", "two"))

    assert "equally" in text([0.0] * 4, 4)
    assert "two is better than one by 10.0 points (p = 0.002 over tasks)." in text([0.1] * 10, 10)
    assert "one is better than two by 10.0 points on prompts like these (p = 0.002" in text([-0.1] * 10, 2)
    assert "not significant (p = 1.000 over tasks)" in text([0.3, -0.2], 2)
    assert "(p < 0.001" in text([0.1] * 12, 12)
    assert text([0.1, 0.2, -0.3], 3) == text([0.0] * 4, 4)  # The sum is almost 0.


def test_prompts_of_only_one_run_are_reported_as_left_out() -> None:
    assert "2 prompts in common" in comparison_sentence(
        compare_scores(FIRST, {("A", 0): 1.0, ("B", 0): 0.0}), ("x", "y")
    )
    assert re.search(
        r"\b3 prompts in common, without 2 prompts\b",
        comparison_sentence(compare_scores(FIRST, SECOND), ("x", "y")),
    )
    assert "without" not in comparison_sentence(compare_scores(FIRST, FIRST), ("x", "y"))


def test_many_runs_are_each_compared_with_the_best() -> None:
    scores = {"a": 0.1, "b": 0.9, "c": 0.5}
    assert pairs_to_compare("abc", scores.__getitem__) == [("a", "b"), ("a", "c"), ("b", "c")]
    many = pairs_to_compare("abcdef", lambda run: scores.get(run, 0.0))
    assert many == [(run, "b") for run in "acdef"]


def test_sample_sizes_are_reported() -> None:
    (alike,) = sample_size_sentences(compare_scores(FIRST, FIRST))
    assert not re.search(r"\d", alike)
    sentences = sample_size_sentences(compare_scores(FIRST, SECOND))
    assert re.search(r"\b25 completions .*\b75\b", sentences[0])
    assert re.search(r"\b8\b", sentences[1])


def view(found: Comparison, first: str = "a", failure: str = "PythonError", width: int = 120) -> str:
    rows = [row(0, 0), row(0, 1, (failure, "cut-off"))]
    programs = {("Visit", 0, index): "" for index in range(2)}
    one = results_of(rows, SUITE, programs)
    shares = failure_shares(one.table)
    assert shares[failure] == 0.5
    return text_of(comparison_view(found, (first, "b"), [one, one], [shares, shares]), width=width)


def test_counts_and_failures_of_both_runs_are_shown() -> None:
    found = compare_scores(FIRST, SECOND)
    text = view(found, failure="NoProgram")
    assert re.search(r"\npass@1 of a +\d\.\d{3}  2 of 2 completions *\n", text)
    assert re.search(r"\nwithout a program +50\.0% +50\.0%\n", text)
    assert "without a program" not in view(found)


def test_hostile_names_stay_text() -> None:
    found = compare_scores(FIRST, SECOND)
    assert SHOWN.split("\\n", maxsplit=1)[0][:10] in view(found, HOSTILE, width=200)
    assert json.loads(json.dumps(comparison_data(found, (HOSTILE, "b"))))["prompts"] == 3


def a_run(about: Mapping[str, Any], head: Mapping[str, Any]) -> Results:
    return replace(results_of([], SUITE, head=head), about=about)


def test_other_differences_between_runs_are_listed() -> None:
    settings = {"temperature": 0.2, "seed": None}
    judged = {"python": "3.11", "codebotler": "1"}
    one = a_run({"template": "a", "settings": settings}, judged)
    two = a_run({"template": "b", "settings": {"temperature": 0.8, "seed": 1}}, {**judged, "python": "3.12"})
    assert other_differences(one, one) == []
    for sentence, (name, values) in zip(
        other_differences(one, two),
        [
            ("Python", "3.11 and 3.12"),
            ("template", "a and b"),
            ("seed", "none and 1"),
            ("temperature", "0.2 and 0.8"),
        ],
        strict=True,
    ):
        assert name in sentence
        assert sentence.endswith(values)
    (unknown,) = other_differences(one, a_run({"python": "3.9"}, {"python": "3.11"}))
    assert "settings" in unknown
    for wrong in ([1, 2], "abc", 3):
        assert other_differences(one, a_run({"template": "a", "settings": wrong}, judged)) == [unknown]


def test_other_suites_are_refused() -> None:
    def results_named(name: str, digest: str) -> Results:
        return replace(a_run({}, {"digest": digest}), run=RunFolder(Path(name)))

    expect_same_suite([results_named("a", "1"), results_named("b", "1")], "mine")
    with pytest.raises(UserError, match=r"^b: .*another version") as e:
        expect_same_suite([results_named("a", SUITE.digest), results_named("b", "1")], "mine")
    assert "`roboeval evaluate b --suite mine --redo`" in str(e.value)


def test_a_bootstrap_of_few_tasks_is_called_too_narrow() -> None:
    def shown(tasks: int) -> str:
        a = {(f"T{n}", 0): n / 10 for n in range(tasks)}
        found = compare_scores(a, {key: value / 2 for key, value in a.items()})
        return view(found)

    assert re.search(r"bootstrap.* too narrow", shown(7))
    assert "too narrow" not in shown(8)
    assert "too narrow" not in shown(1)
    assert re.search(r"over tasks +unknown: too few tasks", shown(1))


def test_equal_differences_have_no_interval() -> None:
    shown = view(compare_scores(FIRST, FIRST))
    assert re.search(r"interval over prompts +unknown: no variation between prompts", shown)
    assert "+0.000 to" not in shown


def test_one_prompt_is_written_in_the_singular() -> None:
    assert "over 1 prompt " in view(compare_scores({("A", 0): 1}, {("A", 0): 0}))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for name in ("hasty", "careful"):
        made = roboeval(
            "evaluate", f"recorded:{name}", "--tasks", "LunchTime,SayGoodDay", "--out", name, cwd=folder
        )
        assert made.status == 0, made
    return folder


@pytest.mark.slow
def test_compare_prints_a_sentence_or_json(runs: Path) -> None:
    made = roboeval("compare", "hasty", "careful", cwd=runs)
    assert made.status == 0, made
    assert made.out.startswith("careful is better than hasty by ")
    assert made.err == ""
    data = json.loads(roboeval("compare", "hasty", "careful", "--json", cwd=runs).out)
    assert data["prompts"] == 10
    assert data["p"]["tasks"] == 0.5
    assert data["warnings"] == []


def test_compare_warns_of_another_python_and_refuses_another_suite(runs: Path) -> None:
    head = runs / "hasty" / "evaluations" / "paper.json"
    kept = head.read_text()
    head.write_text(json.dumps(json.loads(kept) | {"python": "3.99"}))
    warned = roboeval("compare", "careful", "hasty", cwd=runs)
    assert "warning: Python for judging" in warned.err
    assert warned.status == 0
    head.write_text(json.dumps(json.loads(kept) | {"digest": "1"}))
    ended = roboeval("compare", "careful", "hasty", cwd=runs)
    head.write_text(kept)
    assert ended.status == 2
    assert "another version of the suite" in ended.err
    refusal = refused("compare", runs / "careful", "none")
    assert refusal.at == ("none", None)
    assert "completions.jsonl" in refusal.sentence
