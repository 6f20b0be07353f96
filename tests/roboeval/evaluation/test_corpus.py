"""Compare verdicts on programs of real models with those of a correct evaluator.

CODEBOTLER_CORPUS names the folder; without it, these tests are skipped.
"""

import json
from collections import Counter, defaultdict
from pathlib import Path
from statistics import fmean as mean
from typing import Any

import pytest

from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion, read_completions
from roboeval.suites.load import Suite, load_suite

KINDS_OF_TRACE = {
    "goto": "GoTo",
    "say": "Say",
    "ask": "Ask",
    "check": "CheckEntity",
    "pick": "Pick",
    "place": "Place",
}
ROBOT_KINDS = {
    "RobotGoToError: update_robot_location failed": {"GoToInvalidLocation"},
    "RobotPickError: removeObject failed": {"PickInvalidObject"},
    "RobotPickError: Robot is already holding": {"PickWhileHolding"},
    "RobotPlaceError: Robot is not holding": {"PlaceNoObject"},
    "RobotAskError: invalid options": {"AskEmptyOptions"},
    "RobotAskError: ask_agent failed": {"AskNoPerson", "AskInvalidOptions"},
}
CUT_AT = 40

Row = dict[str, Any]


def read_rows(path: Path) -> list[Row]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def judge_rows(rows: list[Row], suite: Suite) -> list[Row]:
    completions = [
        Completion(task=row["task"], prompt=0, index=index, program=row["program"])
        for index, row in enumerate(rows)
    ]
    return [{**row} for row in evaluate(completions, suite, workers=2)]


def expected_kinds(error: str) -> set[str]:
    """Return the kinds that an error of the original evaluator may have here."""
    kind, _, message = error.partition(": ")
    if kind != "Exception":
        return {kind}
    return next(kinds for text, kinds in ROBOT_KINDS.items() if message.startswith(text))


def status_of(verdict: Row) -> str:
    is_error = verdict["status"] in ("python-error", "robot-error")
    return "error" if is_error else str(verdict["status"])


def trace_of(verdict: Row) -> list[list[object]]:
    events = []
    for kind, text, *rest in verdict["trace"]:
        options = [option.lower() for option in rest[0]] if kind == "ask" else None
        events.append([KINDS_OF_TRACE[kind], text.lower(), options])
    return events[:CUT_AT] if verdict["status"] == "timeout" else events


@pytest.fixture(scope="module")
def programs(corpus: Path) -> list[Row]:
    return read_rows(corpus / "corpus" / "programs.jsonl")


@pytest.fixture(scope="module")
def evaluations(programs: list[Row], paper: Suite) -> list[Row]:
    return judge_rows(programs, paper)


def pairs(programs: list[Row], evaluations: list[Row]) -> list[tuple[str, Row, Row]]:
    return [
        (program["key"], verdict, true)
        for program, evaluation in zip(programs, evaluations, strict=True)
        for verdict, true in zip(evaluation["verdicts"], program["verdicts"], strict=True)
    ]


def test_a_sample_of_programs_is_judged_correctly(programs: list[Row], paper: Suite) -> None:
    sample = programs[::20]
    for key, verdict, true in pairs(sample, judge_rows(sample, paper)):
        assert (verdict["satisfied"], status_of(verdict)) == (true["satisfied"], true["status"]), key


@pytest.mark.slow
def test_all_programs_are_satisfied_where_they_should_be(programs: list[Row], evaluations: list[Row]) -> None:
    assert len(programs) == 954
    wrong = [
        (key, verdict["failed_checks"])
        for key, verdict, true in pairs(programs, evaluations)
        if verdict["satisfied"] != true["satisfied"]
    ]
    assert wrong == []


@pytest.mark.slow
def test_all_programs_end_as_they_should(programs: list[Row], evaluations: list[Row]) -> None:
    wrong = [
        (key, verdict["status"], true["status"])
        for key, verdict, true in pairs(programs, evaluations)
        if status_of(verdict) != true["status"]
    ]
    assert wrong == []


@pytest.mark.slow
def test_all_errors_are_of_the_right_kind(programs: list[Row], evaluations: list[Row]) -> None:
    counts: Counter[str] = Counter()
    for key, verdict, true in pairs(programs, evaluations):
        if true["status"] == "error":
            counts[verdict["error"]["kind"]] += 1
            assert verdict["error"]["kind"] in expected_kinds(true["error"]), key
            is_robots = true["error"].startswith("Exception: Robot")
            assert verdict["status"] == ("robot-error" if is_robots else "python-error"), key
    assert sum(counts.values()) == 446


@pytest.mark.slow
def test_all_traces_are_right(programs: list[Row], evaluations: list[Row]) -> None:
    compared = 0
    for key, verdict, true in pairs(programs, evaluations):
        if true["trace"]:
            compared += 1
            assert trace_of(verdict) == true["trace"], key
    assert compared > 2000


@pytest.mark.slow
def test_unheard_questions_differ_from_unanswerable_ones(programs: list[Row], evaluations: list[Row]) -> None:
    kinds = Counter(
        verdict["error"]["kind"]
        for _, verdict, true in pairs(programs, evaluations)
        if "ask_agent failed" in true["error"]
    )
    assert set(kinds) == {"AskNoPerson", "AskInvalidOptions"}


@pytest.mark.slow
def test_programs_written_by_hand_are_judged_correctly(corpus: Path, paper: Suite) -> None:
    rows = read_rows(corpus / "tasks" / "synthetic.jsonl")
    compared = 0
    for row, evaluation in zip(rows, judge_rows(rows, paper), strict=True):
        true_verdicts = row["should"] if "bug_of_original" in row else row["verdicts"]
        for verdict, true in zip(evaluation["verdicts"], true_verdicts, strict=True):
            if true is None:
                continue
            compared += 1
            name = (row["task"], row["about"], verdict)
            assert verdict["satisfied"] == true["satisfied"], name
            if "status" in true:
                assert status_of(verdict) == true["status"], name
            if true["error"] and not true["error"].startswith("while judging"):
                assert verdict["error"]["kind"] in expected_kinds(true["error"]), name
    assert compared == 1056


@pytest.mark.slow
@pytest.mark.parametrize(("file", "model"), [("gpt-4", "GPT-4"), ("palm-2", "PaLM2")])
def test_published_results_are_reproduced(corpus: Path, paper: Suite, file: str, model: str) -> None:
    published = json.loads((corpus / "reference" / "published_results.json").read_text())
    completions = list(read_completions(corpus / "corpus" / "completions" / f"{file}.jsonl"))
    passed: Counter[tuple[str, int]] = Counter()
    count: Counter[tuple[str, int]] = Counter()
    for completion, row in zip(completions, evaluate(completions, paper, workers=2), strict=True):
        passed[completion.task, completion.prompt] += row["passed"]
        count[completion.task, completion.prompt] += 1
    column = published["models"].index(model)
    ours = {cell: passed[cell] / count[cell] for cell in count}
    theirs = {cell: published["pass_at_1"][cell[0]][cell[1]][column] for cell in count}
    assert len(ours) == 20
    assert ours == pytest.approx(theirs)


@pytest.mark.slow
def test_the_table_in_the_readme_is_correct(corpus: Path) -> None:
    published = json.loads((corpus / "reference" / "published_results.json").read_text())
    read_me = (Path(__file__).parents[3] / "README.md").read_text()
    rows = [
        list(map(str.strip, line.split("|")[1:-1])) for line in read_me.splitlines() if line.startswith("| ")
    ]
    table = {row[0]: row[1:] for row in rows if len(row) == 8}
    assert len(table) == 16 + 2
    columns = [
        published["models"].index(name) for name in ("GPT-4", "PaLM2", "GPT-3.5", "CodeLlama", "StarCoder")
    ]
    means = {}
    for task, prompts in published["pass_at_1"].items():
        means[task] = [mean(prompt[column] for prompt in prompts) for column in columns]
    means["**all 16**"] = [mean(column) for column in zip(*means.values(), strict=True)]
    for task, shares in means.items():
        shown = [table[task][at] for at in (0, 2, 4, 5, 6)]
        assert shown == [f"{share:.3f}" for share in shares], task
    for file, at in (("gpt-4", 1), ("palm-2", 3)):
        completions = list(read_completions(corpus / "corpus" / "completions" / f"{file}.jsonl"))
        ours: dict[str, list[str]] = defaultdict(list)
        for suite in ("paper", "plus"):
            passed: dict[str, dict[int, list[bool]]] = defaultdict(lambda: defaultdict(list))
            for row in evaluate(completions, load_suite(suite), workers=2):
                passed[row["task"]][row["prompt"]].append(row["passed"])
            for task, prompts in passed.items():
                ours[task].append(f"{mean(mean(one) for one in prompts.values()):.3f}")
        assert {task: row[at] for task, row in table.items() if row[at][:1].isdigit()} == {
            task: ", ".join(shares) for task, shares in ours.items()
        }


@pytest.mark.slow
@pytest.mark.parametrize("file", ["gpt-4", "palm-2"])
def test_published_ablations_are_reproduced(corpus: Path, paper: Suite, file: str) -> None:
    completions = list(read_completions(corpus / "corpus" / "completions" / f"{file}.jsonl"))
    for completion, row in zip(
        completions, evaluate(completions, paper, ablated=True, workers=2), strict=True
    ):
        ours = [verdict["satisfied"] for verdict in row["verdicts"]]
        assert ours == completion.more["ablation"], completion.key
