"""Search all traces of a run with a formula."""

import json
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.files import to_line
from codebotler.rtl import parse
from command_line import refused, roboeval
from roboeval.analysis.search import TraceMatch, TraceQuery, search_row


def row(index: int, *traces: list[list[object]], passed: bool = False, task: str = "Visit") -> dict[str, Any]:
    verdicts = [
        {"world": f"World {n}", "satisfied": passed, "status": "finished", "error": None, "line": None}
        | {"failed_checks": [], "trace": trace}
        for n, trace in enumerate(traces, 1)
    ]
    why = None if passed else {"class": "TaskCompletionError", "kind": "Location", "world": 0, "check": "c"}
    return {"task": task, "prompt": 0, "index": index, "passed": passed, "failure": why, "verdicts": verdicts}


ROWS = [
    row(0, [["goto", "hall"]], [["say", "x"]]),
    row(1, [["say", "hall"]], [["goto", "the hall"]], passed=True),
    row(2, [], []),
    row(3, [["goto", "hall"]], [["goto", "hall"]], task="Wait"),
]


def matches(question: TraceQuery, rows: list[dict[str, Any]] | None = None) -> list[TraceMatch]:
    return [one for one in search(ROWS if rows is None else rows, question) if one.worlds]


def search(rows: list[dict[str, Any]], question: TraceQuery) -> list[TraceMatch]:
    return [search_row(json.loads(to_line(row)), question) for row in rows]


HALL = parse('tr.Exists(goto("hall"))')


def test_a_formula_is_tried_in_every_world() -> None:
    assert [(one.key[2], [n for n, _ in one.worlds]) for one in matches(TraceQuery(HALL))] == [
        (0, [1]),
        (1, [2]),
        (3, [1, 2]),
    ]
    negated = matches(TraceQuery(HALL, negated=True))
    assert [(one.key[2], [n for n, _ in one.worlds]) for one in negated] == [(0, [2]), (1, [1]), (2, [1, 2])]


def test_a_search_can_be_limited_to_a_task_or_a_world() -> None:
    assert [one.key[2] for one in matches(TraceQuery(HALL, task="Wait"))] == [3]
    assert [one.key[2] for one in matches(TraceQuery(HALL, world="2"))] == [1, 3]
    assert [one.key[2] for one in matches(TraceQuery(HALL, world="world 1"))] == [0, 3]
    assert len(matches(TraceQuery())) == 4


def test_an_undecided_formula_matches_only_if_negated() -> None:
    asks = row(0, [["ask", "tea?", [{"no text": "1"}], None]])
    formula = parse('tr.Exists(ask("tea", "yes"))')
    assert matches(TraceQuery(formula), [asks]) == []
    assert len(matches(TraceQuery(formula, negated=True), [asks])) == 1


@pytest.mark.slow
def test_places_come_from_the_row_and_not_from_requests() -> None:
    formula = parse('tr.Exists(at("hall", say("x")))')
    old = row(0, [["goto", "hall"], ["say", "x"]])
    new = {**old, "verdicts": [{**old["verdicts"][0], "places": [[1, "hall"], [2, "the hall"], [3, "lab"]]}]}
    other = {**old, "verdicts": [{**old["verdicts"][0], "places": [[1, "hall"], [2, "lab"]]}]}
    assert [len(one.worlds) for one in search([new, other], TraceQuery(formula))] == [1, 0]


# --- the command


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    made = roboeval(
        "evaluate", "recorded:hasty", "--tasks", "GrilledCheese,SayGoodDay", "--out", "run", cwd=folder
    )
    assert made.status == 0, made
    return folder / "run"


def test_find_prints_matches_and_groups(runs: Path) -> None:
    made = roboeval("find", runs, 'tr.Exists(goto("lab"))', "--task", "SayGoodDay")
    assert made.status == 0, made
    assert made.out.startswith("found ")
    assert "GrilledCheese" not in made.out
    of_the_task = json.loads(roboeval("find", runs, "--task", "SayGoodDay", "--json").out)
    assert of_the_task["looked_at"] == len(of_the_task["found"]) > 0
    assert f" of {of_the_task['looked_at']} completions" in made.out
    assert " passes, and differs in " in made.out
    data = json.loads(roboeval("find", runs, "--json").out)
    assert data["looked_at"] == len(data["found"])
    failed = sum(not one["passed"] for one in data["found"])
    assert sum(group["size"] for group in data["groups"]) == failed > 0
    assert all(group["why"] for group in data["groups"])
    every = roboeval("find", runs).out
    assert every.startswith(f"{failed} completions of {data['looked_at']} failed, in ")
    assert "passed" not in every.splitlines()[2]
    there = json.loads(roboeval("find", runs, 'tr.Exists(goto("lab"))', "--json").out)["found"]
    said = roboeval("find", runs, 'tr.Exists(goto("lab"))').out.partition("failed, in")[0]
    counts = [row.split()[1:3] for row in said.splitlines() if ", world " in row]
    passed = sum(one["passed"] for one in there)
    assert [sum(map(int, column)) for column in zip(*counts, strict=True)] == [len(there), passed]
    few = roboeval("find", runs, "--groups", "1").out
    assert "--groups" in few


def test_find_refuses_wrong_formulas_and_options(runs: Path) -> None:
    said = refused("find", runs, 'tr.Exist(goto("lab"))').sentence
    for name in ("column 4", "Exist;", "Exists?"):
        assert name in said
    assert refused("find", runs, "--not").sentence.startswith("--not ")
    assert '"Nothing"' in refused("find", runs, "--task", "Nothing").sentence
    said = refused("find", runs, "--task", "SayGoodDay", "--world", "99").sentence
    assert "SayGoodDay" in said
    assert '"99"' in said


def test_find_refuses_rows_about_other_programs(runs: Path) -> None:
    file = runs / "completions.jsonl"
    kept = file.read_text()
    file.write_text(kept.replace("def task_program", "def  task_program"))
    ended = roboeval("find", runs)
    file.write_text(kept)
    assert ended.status == 2
    assert "run/evaluations/paper.jsonl, line 1: the program of " in ended.err
    assert "--redo" in ended.err
