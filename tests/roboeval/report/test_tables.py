"""The tables of a report: hand-computed numbers, the paper's beside ours, and CSV that holds them all."""

import csv
import re
from dataclasses import replace
from pathlib import Path

import pytest
from roboeval.evaluation.evaluation import Evaluation

from codebotler.files import to_line
from made_up_runs import HOSTILE, SUITE, made_up, usual
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.failures import PYTHON
from roboeval.evaluation.run import Run, open_source
from roboeval.report import paper
from roboeval.report.causes import all_causes, beside_notes, causes_of, causes_sheet, kinds_in_order
from roboeval.report.contents import Wishes, sections
from roboeval.report.reading import JudgedRun, Written, _readable, named_apart, read_run
from roboeval.report.retries import accepted, retries_sheet, steps_sheet
from roboeval.report.scores import (
    curve,
    curve_sheet,
    overall_sheet,
    prompt_sheet,
    published_sheet,
    task_sheet,
)
from roboeval.report.sheets import Column, Sheet, sheet, told, write_csv
from roboeval.suites.load import Suite


def column(table: Sheet, head: str) -> list[object]:
    at = [column.head for column in table.columns].index(head)
    return [row[at] for row in table.rows]


def test_tasks_have_mean_worst_and_best_prompt() -> None:
    table = task_sheet(usual(), SUITE)
    (row,) = [row for row in table.rows if row[:3] == ("Visit", "strong", "all")]
    assert row[3:] == pytest.approx((29 / 30, 0.9, 1.0))
    assert [row[2] for row in table.rows].count("common sense only") == 2
    assert "middle, weak" in table.notes[0]


def test_the_curve_by_hand() -> None:
    assert curve([1.0, 0.5, 0.5, 0.0]) == [(1.0, 0.25), (0.5, 0.75)]
    assert curve([0.0]) == [(1.0, 0.0)]
    table = curve_sheet([made_up("a", {"Visit": (10, 5, 5, 0)})])
    assert table.rows == ((1.0, 0.25), (0.5, 0.75))


def test_intervals_of_prompts_and_of_tasks() -> None:
    table = overall_sheet([made_up("a", {"Visit": (10, 10), "CountMugs": (0, 0)})])
    row = dict(zip((c.head for c in table.columns), table.rows[0], strict=True))
    assert row["pass@1"] == 0.5
    assert (row["tasks: low"], row["tasks: high"]) == (0.0, 1.0)
    assert row["completions"] == 40


def test_an_unfinished_run_says_so() -> None:
    run = replace(made_up("a", {"Visit": (1,)}), total=99)
    assert re.match(r"a: .*\b10 of 99 completions\b", overall_sheet([run]).notes[-1])


def test_a_bootstrap_of_few_tasks_is_not_to_be_quoted() -> None:
    few, enough = (made_up(name, {f"T{n}": (1,) for n in range(of)}) for name, of in (("a", 7), ("b", 8)))
    assert overall_sheet([enough]).notes == ()
    (note,) = overall_sheet([few]).notes
    assert re.search(r"bootstrap .*\b8 tasks\b.* narrow", note)
    (note,) = overall_sheet([few, enough]).notes
    assert "bootstrap of a " in note


def test_causes_are_counted() -> None:
    one = causes_of(made_up("a", {"Visit": (3,)}))  # the fourth to the tenth fail, by all kinds in turn
    assert one.classes["passed"] == pytest.approx(0.3)
    assert one.classes[PYTHON] == pytest.approx(0.2)
    assert one.kinds[PYTHON] == {"NameError": 0.5, "ZeroDivisionError": 0.5}
    assert kinds_in_order([one], PYTHON) == ["NameError", "ZeroDivisionError"]
    assert sum(one.classes.values()) == pytest.approx(1)


def test_retries_as_they_are_elsewhere() -> None:
    runs = [made_up("a", {"Visit": (5,)}), made_up("b", {"Visit": (5,)}, trials=None)]
    table = retries_sheet(runs)
    assert table is not None
    assert {row[0] for row in table.rows} == {"a"}
    assert runs[0].trials is not None
    share = accepted(runs[0].trials)
    assert column(table, "at the limit") == pytest.approx([1 - share[n] for n in (0, 2, 4, 8, 100)])
    assert steps_sheet(runs[1:]) is retries_sheet(runs[1:]) is None


# --- the paper's numbers


def paper_run(name: str, **changes: object) -> JudgedRun:
    run = made_up(name, {"CountSavory": (5,) * 5}, head={"suite": "paper", "digest": "0"})
    return replace(run, **changes)  # type: ignore[arg-type]  # fields of a run


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("openai-chat:gpt-4", "GPT-4"),
        ("openai-chat:gpt-4o", None),
        ("completions:bigcode/starcoder", "StarCoder"),
        ("hf:codellama/CodeLlama-34b-Python-hf", "CodeLlama"),
        ("codellama/CodeLlama-7b-Python-hf", None),
        ("text-bison-001", "PaLM2"),
        ("openai:gpt-4-0613", "GPT-4"),
        ("openai-chat:openai/gpt-4", "GPT-4"),
        ("hf:somebody/gpt-4", None),
        ("openai-chat:gpt-4-turbo", None),
        ("openai-chat:gpt-3.5-turbo", None),
        ("openai-chat:gpt-3.5", None),
        ("gpt-3.5", "GPT-3.5"),
        ("starcoder", "StarCoder"),
        ("openai-chat:starcoder", None),  # a server calls what it likes so, a smaller one as well
        ("codellama", "CodeLlama"),
        ("openai-chat:codellama", None),
        ("palm-2", "PaLM2"),
    ],
)
def test_names_of_the_papers_models(name: str, model: str | None) -> None:
    assert paper.model_of(paper_run(name)) == model
    assert paper.model_of(replace(paper_run(name), head={"suite": "mine"})) is None


def test_a_folder_names_a_model_only_where_nobody_else_does() -> None:
    run = paper_run("x", model=None, folder="gpt-4")
    assert paper.model_of(run) == "GPT-4"
    assert paper.model_of(replace(run, is_mixed=True)) is None
    assert paper.model_of(replace(run, model="gpt-5")) is None


def test_the_page_says_which_model_a_run_is_taken_for() -> None:
    runs = [paper_run("openai:gpt-4-0613"), paper_run("mine")]
    assert any("openai:gpt-4-0613 for GPT-4" in note for note in beside_notes(runs))
    assert paper.taken_for(runs[1:]) == []


def test_cells_stand_only_beside_the_authors_own_prompts(paper_suite: Suite) -> None:
    theirs = paper_run("gpt-4")
    heads = [c.head for c in prompt_sheet([theirs], paper_suite).columns]
    assert heads == ["task", "prompt", "gpt-4", "gpt-4, published"]
    ours = {"CountSavory": Written("", paper_suite.tasks["CountSavory"].prompts[0])}
    for other in (
        replace(theirs, about={"settings": {}}),
        replace(theirs, written={("CountSavory", 0, 0): ours["CountSavory"]}),
    ):
        assert "gpt-4, published" not in [c.head for c in prompt_sheet([other], paper_suite).columns]
        means = published_sheet([other], paper_suite)
        assert means is not None
        assert paper.OTHER_PHRASINGS in means.notes
        assert column(means, "published")[0] == pytest.approx(0.995)


@pytest.fixture
def paper_suite(paper: Suite) -> Suite:
    return paper


def test_published_means_are_those_of_the_table_of_pass_at_1(paper_suite: Suite) -> None:
    tasks = list(paper_suite.tasks)
    assert paper.overall_mean("CodeLlama", tasks) == pytest.approx(0.463, abs=5e-4)
    assert paper.overall_mean("StarCoder", tasks) == pytest.approx(0.3125, abs=5e-5)
    assert paper.class_share("CodeLlama", None) == 0.457
    assert paper.class_share("StarCoder", None) == 0.312
    table = published_sheet([paper_run("starcoder")], paper_suite)
    assert table is not None
    assert paper.TWO_SUMS in table.notes


def test_published_causes_only_where_asked_for() -> None:
    runs = [paper_run("gpt-4"), paper_run("mine")]
    assert [one.name for one in all_causes(runs, published=False)] == ["gpt-4", "mine"]
    assert [one.name for one in all_causes(runs, published=True)] == ["gpt-4", "gpt-4, published", "mine"]
    table = causes_sheet(all_causes(runs, published=True))
    taken, sums, causes = beside_notes(runs)
    assert ([taken], sums) == (paper.taken_for(runs), paper.TWO_SUMS)
    assert "16 tasks" in causes
    assert "gpt-4" in causes
    assert "None of these" in beside_notes(runs[1:])[0]
    shares = {row[2]: row[4] for row in table.rows if row[:2] == ("gpt-4, published", "TaskCompletionError")}
    assert shares["SayAtLocation"] == pytest.approx(0.682)
    assert shares["InitialTerminal"] == pytest.approx(0.317)


@pytest.mark.parametrize(("file", "model"), [("gpt-4", "GPT-4"), ("palm-2", "PaLM2")])
def test_reports_of_published_completions_equal_the_published_cells(
    corpus: Path, paper_suite: Suite, tmp_path: Path, file: str, model: str
) -> None:
    run = Run(tmp_path / file)
    run.keep(open_source(str(corpus / "corpus" / "completions" / f"{file}.jsonl"), paper_suite).completions)
    for _ in evaluate_run(run, paper_suite, tasks=None, ablated=False, redo=False, workers=2):
        pass
    evaluation = Evaluation(run, "paper")
    read = read_run(evaluation, evaluation.rows(), paper_suite)
    table = prompt_sheet([read], paper_suite)
    assert len(table.rows) == 20
    assert column(table, file) == pytest.approx(column(table, f"{file}, published"))
    published = [paper.cell(model, str(task), int(str(prompt))) for task, prompt, *_ in table.rows]
    assert column(table, file) == pytest.approx(published)


# --- names, and CSV


def test_runs_are_named_apart() -> None:
    run = made_up("gpt-4", {"Visit": (1,)})
    runs = [
        replace(run, folder="a"),
        replace(run, folder="b"),
        replace(run, folder="b"),
        made_up("x", {"Visit": (1,)}),
    ]
    assert [one.name for one in named_apart(runs)] == ["gpt-4 (a)", "gpt-4 (b) #2", "gpt-4 (b) #3", "x"]


def test_a_run_as_it_is_read(paper_suite: Suite, tmp_path: Path) -> None:
    rows = [
        {
            "task": "LunchTime",
            "prompt": 0,
            "index": n,
            "model": model,
            "program": "def task_program():\n    1\n",
        }
        for n, model in enumerate(("gpt-4", "other"))
    ]
    (tmp_path / "a.jsonl").write_bytes(b"".join(map(to_line, rows)))
    run = Run(tmp_path / "gpt-4")
    run.keep(open_source(str(tmp_path / "a.jsonl"), paper_suite).completions)
    for _ in evaluate_run(run, paper_suite, tasks=None, ablated=False, redo=False, workers=1):
        pass
    evaluation = Evaluation(run, "paper")
    read = read_run(evaluation, evaluation.rows(), paper_suite)
    assert (read.is_mixed, read.model, read.name) == (True, None, "gpt-4")
    for row in read.rows:  # held in memory, all of them
        kept = [number for number, verdict in enumerate(row["verdicts"]) if "trace" in verdict]
        assert kept == [row["failure"]["world"]]


def test_a_very_long_name_keeps_both_ends() -> None:
    name = "begin" + "x" * 4_000 + "end"
    assert _readable(name).startswith("beginx")
    assert _readable(name).endswith("xend")
    assert len(_readable(name)) == 100
    assert _readable("x" * 100) == "x" * 100


def test_names_stay_apart_whatever_they_are() -> None:
    run = made_up("m", {"Visit": (1,)}, folder="f")
    names = [one.name for one in named_apart([run, run, made_up("m (f) #2", {"Visit": (1,)})])]
    assert len(set(names)) == 3


@pytest.mark.parametrize(
    "names", [("task", "prompt"), ("threshold", "retries"), ("=x", "'=x"), ("task #2", "task")]
)
def test_models_may_be_called_as_columns_are(names: tuple[str, str], tmp_path: Path) -> None:
    runs = [made_up(name, {"Visit": (3, 1)}) for name in names]
    for section in sections(runs, SUITE, Wishes()):
        for part in section.parts:
            if isinstance(part, Sheet):
                write_csv(part, tmp_path)
    with (tmp_path / "prompts.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert len(set(head)) == len(head) == 4
    assert rows[0] == ["Visit", "0", "0.3", "0.3"]


def test_csv_holds_all_digits_and_no_formula(tmp_path: Path) -> None:
    table = sheet(
        "t",
        "T",
        ["name", Column("share", "share"), Column("=n", "count")],
        [["=1+1", 1 / 3, 4], [HOSTILE, None, None]],
    )
    write_csv(table, tmp_path)
    with (tmp_path / "t.csv").open(newline="") as file:
        head, first, second = csv.reader(file)
    assert head == ["name", "share", "'=n"]
    assert first == ["'=1+1", str(1 / 3), "4"]
    assert second[1:] == ["", ""]
    assert "<script>" in second[0]


def test_cells_as_people_read_them() -> None:
    assert [
        told(None, "share"),
        told(0.12345, "share"),
        told(0.1, "difference"),
        told(-0.1, "difference"),
    ] == [
        "-",
        "0.123",
        "+0.100",
        "-0.100",
    ]
    assert [told(1e-17, "difference"), told(1234, "count"), told(1234.5678, "number")] == [
        "0.000",
        "1,234",
        "1,235",
    ]
