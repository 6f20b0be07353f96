"""Heat maps: the number, the shade and the link of a cell."""

from __future__ import annotations

from pathlib import Path

import pytest

from roboeval.analysis.metrics import percent
from roboeval.evaluation.judging.failures import plural_of
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.web.heat_map import TaskCells, failure_rows, failure_text, shade
from roboeval.web.run_store import RunStore
from roboeval.web.snapshot import CompletionFilter
from seals import unseal


@pytest.mark.parametrize(
    ("share", "text", "look"),
    [(0, "0", "s0"), (1e-4, "<1", "s1"), (0.336, "34", "s3"), (0.9999, ">99", "s9"), (1, "100", "s10")],
)
def test_small_shares_are_not_0_and_large_ones_not_100_percent(share: float, text: str, look: str) -> None:
    assert (percent(share), shade(share, bad=False)) == (text, look)
    assert shade(share, bad=True) == look.replace("s", "f")
    assert shade(None, bad=True) == "waits"


@pytest.mark.parametrize(
    ("chosen", "column", "value"),
    [
        (CompletionFilter(), "passed", True),
        (CompletionFilter("LunchBreak", 1, passed=False), "passed", False),
        (CompletionFilter("LunchBreak", failure_class="PythonError"), "failure_class", "PythonError"),
    ],
)
def test_cells_show_shares_of_a_run(runs: Path, chosen: CompletionFilter, column: str, value: object) -> None:
    rows = RunFolder(runs / "hasty").rows("paper")
    unseal(runs / "hasty")
    rows.write_bytes(b"".join(rows.read_bytes().splitlines(keepends=True)[:30]))
    run = RunStore(runs).open("hasty")
    cells = TaskCells(run, chosen, "paper")
    assert [each["name"] for each in cells.columns] == ["mean", *(f"prompt {n}" for n in range(5))]
    completions = run.completions.to_dicts()
    for task in cells.tasks:
        mean, *prompts = cells.row(task)
        shares = []
        for number, cell in enumerate(prompts):
            same = [row for row in completions if (row["task"], row["prompt"]) == (task, number)]
            judged = [row for row in same if row["passed"] is not None]
            if judged:
                shares.append(sum(row[column] == value for row in judged) / len(judged))
                assert cell["text"] == percent(shares[-1]), cell["title"]
            else:
                assert (cell["text"], cell["shade"]) == (f"({len(same)})", "waits")
            assert cell["here"] is ((task, number) == (chosen.task, chosen.prompt))
            assert f"task={task}&prompt={number}" in cell["href"]
        assert mean["text"] == (percent(sum(shares) / len(shares)) if shares else "-")
    assert cells.row("NoTask") == [{"text": "no completions", "shade": "none", "span": 6}]


def test_a_filter_is_described_in_words() -> None:
    assert failure_text(CompletionFilter(passed=False)) is None
    assert failure_text(CompletionFilter(failure_class="RobotExecutionError")) == "in a robot error"
    assert (
        failure_text(CompletionFilter(failure_class="PythonError", failure_kind="NameError"))
        == "in NameError"
    )
    assert failure_text(CompletionFilter(failure_class="NoProgram")) == "without a program"
    cut_off = CompletionFilter(failure_class="NoProgram", failure_kind="cut-off")
    assert failure_text(cut_off) == "without a program (cut-off)"


def test_failures_are_listed_by_class_with_their_kinds(runs: Path) -> None:
    run = RunStore(runs).open("hasty")
    expected = []
    classes = [name for name, kind in run.failures if kind is None]
    for name in sorted(classes, key=lambda name: -run.failures[name, None].share):
        expected.append(("of-all", plural_of(name), percent(run.failures[name, None].share)))
        kinds = [one for (of, kind), one in run.failures.items() if of == name and kind is not None]
        expected += [("of-class", one.name, percent(one.share)) for one in kinds]
    rows = failure_rows([run, run])
    assert [(row["look"], row["name"], row["cells"][0]["text"]) for row in rows] == expected
    assert all(row["cells"][0] == row["cells"][1] for row in rows)
    assert failure_rows([]) == []
