"""Verdicts that another suite changes: counted by hand, and in the commands."""

import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from command_line import Ended, refused, roboeval
from made_results import results_of
from made_up_runs import leave_figures_empty
from roboeval.analysis.comparisons.verdict_changes import (
    VerdictChanges,
    changes_data,
    describe_ranking,
    describe_run,
    ranks,
    verdict_changes,
    warn_of_prompts,
)
from roboeval.cli.views.comparison import changes_view
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import key_of
from small_run import HOSTILE, SHOWN, SUITE, row, text_of

STRICT = replace(SUITE, name="strict")
PROGRAM = 'def task_program():\n    say("hello")\n'
FAILURES = (
    ("PythonError", "NameError"),
    ("PythonError", "ZeroDivisionError"),
    ("RobotExecutionError", "GoToInvalidLocation"),
    ("RobotExecutionError", "PickInvalidObject"),
    ("TaskCompletionError", "SayAtLocation"),
    ("TaskCompletionError", "InitialTerminal"),
    ("TaskCompletionError", "EventOrdering"),
)
Passes = Mapping[str, tuple[int, ...]]


def results_by(passes: Passes, *, strictly: bool = False) -> Results:
    """Return ten completions of each prompt: the first ones pass, the others fail by all kinds in turn."""
    rows = [
        row_of(task, prompt, index, passed=index < passed)
        for task, prompts in passes.items()
        for prompt, passed in enumerate(prompts)
        for index in range(10)
    ]
    return results_of(rows, STRICT if strictly else SUITE, {key_of(row): PROGRAM for row in rows})


def row_of(task: str, prompt: int, index: int, *, passed: bool) -> dict[str, Any]:
    name, kind = FAILURES[(index + 3 * prompt) % len(FAILURES)]
    check = f"{kind.lower()}()" if name == "TaskCompletionError" else None
    error = None if check else {"kind": kind, "message": f"{kind} it is"}
    why = None if passed else {"class": name, "kind": kind, "world": 0, "check": check}
    verdict = {
        "satisfied": passed,
        "error": None if passed else error,
        "failed_checks": [check] if check else [],
    }
    return {**row(prompt, index, task=task), "passed": passed, "failure": why, "verdicts": [verdict]}


def changes_between(first: Passes, second: Passes, *, name: str = "a") -> VerdictChanges:
    return verdict_changes(name, results_by(first), results_by(second, strictly=True))


def test_changed_verdicts_by_hand() -> None:
    found = changes_between({"Visit": (10, 4), "FindBook": (0,)}, {"Visit": (7, 4), "FindBook": (2,)})
    assert found.suites == ("small", "strict")
    assert [(t.task, t.both, t.first_only, t.second_only, t.neither) for t in found.tasks] == [
        ("Visit", 11, 3, 0, 6),
        ("FindBook", 0, 0, 2, 8),
    ]
    assert found.completions == 30
    assert found.pass_at_1 == pytest.approx((1.4 / 3, 1.3 / 3))
    assert sorted(key for one in found.first_only for key in one.members) == [
        ("Visit", 0, 7),
        ("Visit", 0, 8),
        ("Visit", 0, 9),
    ]
    assert [key for one in found.second_only for key in one.members] == [
        ("FindBook", 0, 0),
        ("FindBook", 0, 1),
    ]
    assert {one.failure["class"] for one in found.second_only} == {
        "PythonError"
    }  # The first suite names the failure.
    assert found.programs == 2
    assert re.search(
        r"^a: strict .*\b3 of the 14 .*\bsmall .*\b2 .*small .*\(2 distinct programs\)", describe_run(found)
    )


def test_suites_that_agree_have_no_changes() -> None:
    found = changes_between({"Visit": (3,)}, {"Visit": (3,)})
    assert (found.first_only, found.second_only) == ((), ())
    assert re.search(r"\bsmall and strict agree .*\b10\b", describe_run(found))
    assert "only, and what" not in text_of(changes_view([found], most=3))


def test_completions_judged_by_one_suite_only_are_left_out() -> None:
    found = changes_between({"Visit": (3,), "FindBook": (1,)}, {"Visit": (2,), "BringTea": (9, 9)})
    assert (found.completions, found.left_out) == (10, 30)
    assert [task.task for task in found.tasks] == ["Visit"]
    with pytest.raises(UserError, match="both suites") as error:
        changes_between({"Visit": (3,)}, {"FindBook": (3,)})
    assert error.value.file == "a"


def runs(**scores: tuple[int, int]) -> list[VerdictChanges]:
    return [changes_between({"Visit": (a,)}, {"Visit": (b,)}, name=name) for name, (a, b) in scores.items()]


def test_runs_with_equal_scores_share_a_rank() -> None:
    small, strict = ranks(runs(a=(5, 5), b=(9, 5), c=(5, 2), d=(1, 2)))
    assert small == {"a": 2, "b": 1, "c": 2, "d": 4}
    assert strict == {"a": 1, "b": 1, "c": 3, "d": 3}


def test_changed_ranks_are_listed() -> None:
    (sentence,) = describe_ranking(runs(a=(9, 3), b=(5, 5), c=(9, 2), d=(1, 1)))
    assert "under small: 1 a, 1 c, 3 b, 4 d; under strict: 1 b, 2 a, 3 c, 4 d" in sentence


def test_an_unchanged_order_is_reported() -> None:
    (sentence,) = describe_ranking(runs(a=(5, 3), b=(2, 1)))
    assert re.search(r"\b2 runs is the same under strict\b.* small", sentence)
    assert describe_ranking(runs(a=(5, 3))) == []


def test_runs_with_different_prompts_cause_a_warning() -> None:
    one, other = runs(a=(5, 3), b=(2, 1))
    more = changes_between({"Visit": (1, 1)}, {"Visit": (1, 1)}, name="c")
    assert warn_of_prompts([one, other]) == []
    (warning,) = warn_of_prompts([one, more])
    assert "different prompts" in warning


def test_hostile_names_stay_text() -> None:
    found = replace(changes_between({"Visit": (3,)}, {"Visit": (1,)}), name=HOSTILE)
    assert "".join(SHOWN.split()) in "".join(text_of(changes_view([found, found], most=1), 300).split())
    assert "\x1b[2J" not in text_of(changes_view([found], most=1))


def test_the_largest_groups_are_shown() -> None:
    found = changes_between({"Visit": (10,)}, {"Visit": (0,)})
    assert re.search(r"\b6 more groups\b.* --groups\b", text_of(changes_view([found], most=1)))
    assert "more groups" not in text_of(changes_view([found], most=7))


@pytest.fixture(scope="module")
def judged_twice(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for name in ("hasty", "careful"):
        for source, suite in ((f"recorded:{name}", "paper"), (name, "plus")):
            more = ("--tasks", "GetDrink,GrilledCheese", "--suite", suite)
            made = roboeval("evaluate", source, "--out", name, *more, cwd=folder)
            assert made.status == 0, made
    return folder


@pytest.mark.slow
def test_compare_lists_verdicts_that_differ_by_suite(judged_twice: Path) -> None:
    made = roboeval("compare", "hasty", "careful", "--suites", "paper,plus", cwd=judged_twice)
    assert made.status == 0, made
    assert made.err == ""
    assert re.search("under plus only, .*paper", made.out)
    ended = roboeval("compare", "hasty", "--suites", "paper, plus", "--json", cwd=judged_twice)
    data = json.loads(ended.out)
    assert data["suites"] == ["paper", "plus"]
    assert [run["places"] for run in data["runs"]] == [[1, 1]]
    (run,) = data["runs"]
    for members, (passes, fails) in (("first_only", ("paper", "plus")), ("second_only", ("plus", "paper"))):
        names = [name for group in run[members] for name in group["members"]]
        assert names
        verdicts = [verdicts_of(judged_twice / "hasty", suite) for suite in (passes, fails)]
        assert all(verdicts[0][name] and not verdicts[1][name] for name in names)


def verdicts_of(run: Path, suite: str) -> dict[str, bool]:
    lines = (run / "evaluations" / f"{suite}.jsonl").read_text().splitlines()
    rows = map(json.loads, lines)
    return {f"{row['task']}/{row['prompt']}/{row['index']}": row["passed"] for row in rows}


@pytest.mark.slow
def test_swapping_suites_mirrors_the_changes(judged_twice: Path) -> None:
    def data(suites: str) -> dict[str, Any]:
        ended = roboeval("compare", "hasty", "careful", "--suites", suites, "--json", cwd=judged_twice)
        return dict(json.loads(ended.out))

    one, other = data("paper,plus")["runs"][0], data("plus,paper")["runs"][0]
    assert one["first_only"] == other["second_only"]
    assert one["difference"] == pytest.approx(-other["difference"])


@pytest.mark.slow
def test_verdicts_in_other_worlds_can_be_compared(judged_twice: Path, tmp_path: Path) -> None:
    shutil.copytree(judged_twice / "hasty", tmp_path / "hasty")
    few = ("--suite", "plus", "--tasks", "GetDrink,GrilledCheese", "--worlds", "12", "--seed", "5", "--redo")
    assert roboeval("evaluate", "hasty", *few, cwd=tmp_path).status == 0
    made = roboeval("compare", "hasty", "--suites", "paper,plus", cwd=tmp_path)
    assert (made.status, made.err) == (0, "")
    made = roboeval("find", "hasty", "--suite", "plus", cwd=tmp_path)
    assert (made.status, "has changed" in made.err) == (0, False)


@pytest.mark.slow
def test_a_report_can_show_verdicts_of_another_suite(
    judged_twice: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "report"
    options = ("--beside", "plus", "--no-check")
    made = roboeval("report", "hasty", "careful", "--out", str(out), *options, cwd=judged_twice)
    assert made.status == 0, made
    page = (out / "index.html").read_text()
    assert 'id="beside"' in page
    assert "--beside plus" in page
    assert (out / "tables" / "reversals.csv").exists()
    leave_figures_empty(monkeypatch)  # the first report has all that the second has
    made = roboeval("report", "hasty", "careful", "--out", str(out), "--no-check", cwd=judged_twice)
    assert "What other checks change" not in (out / "index.html").read_text()
    assert not (out / "tables" / "reversals.csv").exists()


def test_wrong_suites_and_unjudged_runs_are_refused(tmp_path: Path) -> None:
    def run_here(*words: str) -> Ended:
        return roboeval(*words, cwd=tmp_path)

    assert run_here("evaluate", "recorded:hasty", "--tasks", "LunchTime", "--out", "hasty").status == 0
    assert "two runs, not 1" in refused("compare", "hasty", cwd=tmp_path).sentence
    assert 'not "paper"' in refused("compare", "hasty", "--suites", "paper", cwd=tmp_path).sentence
    assert "comma" in refused("compare", "hasty", "--suites", "plus,plus", cwd=tmp_path).sentence
    assert "twice" in run_here("compare", "hasty", "./hasty", "--suites", "paper,plus").err
    twice = run_here("report", "hasty", "--out", "r", "--beside", "paper")
    assert (twice.status, '"paper"' in twice.err) == (2, True)
    unjudged = run_here("compare", "hasty", "--suites", "paper,rules")
    assert (unjudged.status, '"rules"' in unjudged.err) == (2, True)


def test_data_of_several_runs() -> None:
    data = changes_data(runs(a=(9, 3), b=(5, 5)))
    assert [run["places"] for run in data["runs"]] == [[1, 2], [2, 1]]
