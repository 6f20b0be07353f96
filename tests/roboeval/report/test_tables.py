"""The tables of a report: numbers by hand, numbers of the paper beside ours, and all of them as CSV."""

import csv
import re
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import to_line
from made_up_runs import HOSTILE, UNCHECKED, new_run, unfinished, usual
from roboeval.analysis.resample import accepted_after
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.judging.failures import FAILURE_CLASSES
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import read_results
from roboeval.evaluation.runs.source import open_source
from roboeval.report import paper
from roboeval.report.runs import JudgedRun, name_runs, read_labels
from roboeval.report.sections.cost import rejection_sampling_section
from roboeval.report.sections.failures import all_causes, causes_sheet, published_notes
from roboeval.report.sections.scores import curve_sheet, overall_sheet, prompt_sheet, task_sheet
from roboeval.report.sheets import Column, Sheet, format_cell, note, page_text, page_words, write_csv
from roboeval.report.writing import sections
from roboeval.suites.load import Suite


def column(table: Sheet, head: str) -> list[object]:
    at = [column.head for column in table.columns].index(head)
    return [row[at] for row in table.rows]


def test_tasks_have_mean_worst_and_best_prompt() -> None:
    table = task_sheet(usual())
    (row,) = [row for row in table.rows if row[:3] == ["Visit", "strong", "all"]]
    passed = usual()[0].scores[0].pass_at(1)
    assert row[3:5] == [30, 30]
    assert row[5:] == pytest.approx((29 / 30, passed.low, passed.high, 0.9, 1.0))
    assert [row[2] for row in table.rows].count("common sense only") == 2
    assert "middle, weak" in table.notes[0]


def test_the_curve_as_a_table() -> None:
    table = curve_sheet([new_run("a", {"Visit": (10, 5, 5, 0)}), new_run("b", {"Visit": (10, 2)})])
    assert table.rows == [[1.0, 0.25, 0.5], [0.5, 0.75, 0.5], [0.2, 0.75, 1.0]]


def test_intervals_of_prompts_and_of_tasks() -> None:
    table = overall_sheet([new_run("a", {"Visit": (10, 10), "CountMugs": (0, 0)})])
    row = dict(zip((c.head for c in table.columns), table.rows[0], strict=True))
    assert row["pass@1"] == 0.5
    assert (row["tasks: low"], row["tasks: high"]) == (0.0, 1.0)
    assert row["completions"] == 40


def test_an_unfinished_run_says_so() -> None:
    run = unfinished(new_run("a", {"Visit": (1,)}), 99)
    table = overall_sheet([run])
    assert (*column(table, "completions"), *column(table, "of")) == (10, 99)


def test_an_interval_without_width_is_in_the_table() -> None:
    alike = new_run("a", {"Visit": (5, 5), "CountMugs": (5,)})
    others = new_run("b", {"Visit": (4, 5), "CountMugs": (5,)})
    table = overall_sheet([alike, others])
    assert column(table, "tasks: low")[0] == column(table, "tasks: high")[0] == 0.5


def test_retries_agree_with_shares_of_accepted_programs() -> None:
    run, other = new_run("a", {"Visit": (5,)}), new_run("b", {"Visit": (5,)}, accepted=UNCHECKED)
    share = accepted_after(run.checked, 100)
    found = [part for part in rejection_sampling_section([run, other]).parts if isinstance(part, Sheet)]
    assert column(found[0], "at the limit") == pytest.approx([1 - share[n] for n in (0, 2, 4, 8, 100)])
    assert [part.name for part in found] == ["rejection-sampling", "rejection-sampling-curves", "accepted"]
    assert {row[0] for row in found[0].rows} == {"a"}
    assert column(found[2], "a") == share
    assert rejection_sampling_section([other]).parts == []


# --- the paper's numbers


def paper_run(name: str, **changes: Any) -> JudgedRun:  # noqa: ANN401 - the options of new_run
    manifest = {"suite": "paper", "digest": "0", **changes.pop("manifest", {})}
    return new_run(name, {"CountSavory": (5,) * 5}, manifest=manifest, **changes)


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
        ("openai-chat:starcoder", None),  # A server may give any model this name.
        ("codellama", "CodeLlama"),
        ("openai-chat:codellama", None),
        ("palm-2", "PaLM2"),
    ],
)
def test_names_of_the_papers_models(name: str, model: str | None) -> None:
    assert paper.model_of(paper_run(name)) == model
    assert paper.model_of(paper_run(name, manifest={"suite": "mine"})) is None


def test_a_folder_names_a_model_only_if_its_rows_do_not() -> None:
    assert paper.model_of(paper_run("x", model=None, folder="gpt-4")) == "GPT-4"
    assert paper.model_of(paper_run("x", model="gpt-5", folder="gpt-4")) is None
    mixed = paper_run("x", folder="gpt-4", written=lambda _, index: {"model": f"m{index}"})
    assert (mixed.is_mixed, mixed.model, paper.model_of(mixed)) == (True, None, None)


def test_the_page_names_the_model_of_the_paper() -> None:
    runs = [paper_run("openai:gpt-4-0613"), paper_run("mine")]
    assert any("openai:gpt-4-0613 is GPT-4" in note for note in published_notes(runs))
    assert paper.recognised_models(runs[1:]) == []


def test_published_cells_are_shown_only_for_the_authors_prompts(paper_suite: Suite) -> None:
    theirs = paper_run("gpt-4", suite=paper_suite)
    heads = [c.head for c in prompt_sheet([theirs]).columns]
    assert heads == ["task", "prompt", "gpt-4", "gpt-4, published"]
    ours = paper_suite.tasks["CountSavory"].prompts
    for other in (
        paper_run("gpt-4", suite=paper_suite, about={"settings": {}}),
        paper_run("gpt-4", suite=paper_suite, written=lambda prompt, _: {"instruction": ours[prompt]}),
    ):
        assert "gpt-4, published" not in [c.head for c in prompt_sheet([other]).columns]
        means = paper.published_sheet([other])
        assert note("other-phrasings") in means.notes
        assert column(means, "published")[0] == pytest.approx(0.995)


@pytest.fixture
def paper_suite(paper: Suite) -> Suite:
    return paper


def test_published_means_are_those_of_the_table_of_pass_at_1(paper_suite: Suite) -> None:
    tasks = list(paper_suite.tasks)
    assert paper.overall_mean("CodeLlama", tasks) == pytest.approx(0.463, abs=5e-4)
    assert paper.overall_mean("StarCoder", tasks) == pytest.approx(0.3125, abs=5e-5)
    assert paper.causes("CodeLlama").classes["passed"] == 0.457
    assert paper.causes("StarCoder").classes["passed"] == 0.312
    table = paper.published_sheet([paper_run("starcoder")])
    assert note("two-sums") in table.notes


def test_published_causes_are_of_known_classes_and_kinds() -> None:
    assert paper.published()["classes"].keys() <= {"passed", *FAILURE_CLASSES}
    for name, kinds in paper.published()["kinds"].items():
        assert kinds.keys() - {"ZeroDivisionError"} <= set(FAILURE_CLASSES[name].kinds)


def test_published_causes_are_shown_only_on_request() -> None:
    runs = [paper_run("gpt-4"), paper_run("mine")]
    assert [name for name, _ in all_causes(runs, with_published=False)] == ["gpt-4", "mine"]
    both = all_causes(runs, with_published=True)
    assert [name for name, _ in both] == ["gpt-4", "gpt-4, published", "mine"]
    table = causes_sheet(both)
    taken, sums, causes = published_notes(runs)
    assert ([taken], sums) == (paper.recognised_models(runs), note("two-sums"))
    assert "16 tasks" in causes
    assert "gpt-4" in causes
    assert "None of these" in published_notes(runs[1:])[0]
    shares = {row[2]: row[4] for row in table.rows if row[:2] == ["gpt-4, published", "TaskCompletionError"]}
    assert shares["SayAtLocation"] == pytest.approx(0.682)
    assert shares["InitialTerminal"] == pytest.approx(0.317)


def judge_in(folder: Path, completions: Path, suite: Suite) -> JudgedRun:
    run = RunFolder(folder)
    run.import_completions(open_source(str(completions), suite).completions)
    for _ in evaluate_run(run, suite, tasks=None, ablated=False, redo=False, workers=2):
        pass
    results = read_results(run, "paper", suite)
    (named,) = name_runs([JudgedRun(results, results.table)])
    return named


@pytest.mark.slow
@pytest.mark.parametrize(("file", "model"), [("gpt-4", "GPT-4"), ("palm-2", "PaLM2")])
def test_reports_of_published_completions_equal_the_published_cells(
    corpus: Path, paper_suite: Suite, tmp_path: Path, file: str, model: str
) -> None:
    run = judge_in(tmp_path / file, corpus / "corpus" / "completions" / f"{file}.jsonl", paper_suite)
    table = prompt_sheet([run])
    assert len(table.rows) == 20
    assert column(table, file) == pytest.approx(column(table, f"{file}, published"))
    published = [paper.cell(model, str(task), int(str(prompt))) for task, prompt, *_ in table.rows]
    assert column(table, file) == pytest.approx(published)


# --- names, and CSV


def test_labels_name_runs() -> None:
    paths = [Path("runs/a"), Path("runs/b")]
    labels = read_labels(["runs/a/=Base", "b= Mine "], paths)
    assert labels == {0: "Base", 1: "Mine"}
    runs = [new_run(name, {"Visit": (1,)}) for name in ("x", "y")]
    assert [run.name for run in name_runs(runs, labels)] == ["Base", "Mine"]
    assert [run.name for run in name_runs(runs, {1: "Mine"})] == ["x", "Mine"]


@pytest.mark.parametrize(
    ("texts", "why"),
    [
        (["a"], "RUN=TEXT"),
        (["a="], "RUN=TEXT"),
        (["=x"], "RUN=TEXT"),
        (["c=x"], "no such run"),
        (["d=x"], "more than one"),
    ],
)
def test_wrong_labels_are_refused(texts: list[str], why: str) -> None:
    with pytest.raises(UserError, match=why):
        read_labels(texts, [Path("runs/a"), Path("runs/b"), Path("one/d"), Path("two/d")])


def test_runs_get_distinct_names() -> None:
    folders = ["a", "b", "b"]
    runs = [new_run("gpt-4", {"Visit": (1,)}, folder=folder) for folder in folders]
    names = [one.name for one in name_runs([*runs, new_run("x", {"Visit": (1,)})])]
    assert names == ["gpt-4 (a)", "gpt-4 (b) #2", "gpt-4 (b) #3", "x"]


def test_a_run_of_two_models_is_mixed(paper_suite: Suite, tmp_path: Path) -> None:
    one = {"task": "LunchTime", "prompt": 0, "program": "def task_program():\n    1\n"}
    rows = [{**one, "index": n, "model": model} for n, model in enumerate(("gpt-4", "other"))]
    (tmp_path / "a.jsonl").write_bytes(b"".join(map(to_line, rows)))
    read = judge_in(tmp_path / "gpt-4", tmp_path / "a.jsonl", paper_suite)
    assert (read.is_mixed, read.model, read.name) == (True, None, "gpt-4")
    assert read.completions.height == 2


def test_a_very_long_name_keeps_both_ends() -> None:
    names = "begin" + "x" * 4_000 + "end", "x" * 100
    shortened, whole = (run.name for run in name_runs([new_run(name, {"Visit": (1,)}) for name in names]))
    assert re.fullmatch("beginx+…x+end", shortened)
    assert len(shortened) == 100
    assert whole == names[1]


def test_names_stay_distinct_even_if_a_run_has_a_numbered_name() -> None:
    run, other = (new_run(name, {"Visit": (1,)}, folder="f") for name in ("m", "m (f) #2"))
    names = [one.name for one in name_runs([run, run, other])]
    assert len(set(names)) == 3


@pytest.mark.parametrize(
    "names", [("task", "prompt"), ("threshold", "retries"), ("=x", "'=x"), ("task #2", "task")]
)
def test_models_may_have_the_names_of_columns(names: tuple[str, str], tmp_path: Path) -> None:
    runs = [new_run(name, {"Visit": (3, 1)}) for name in names]
    for section in sections(runs):
        for part in section.parts:
            if isinstance(part, Sheet):
                write_csv(part, tmp_path)
    with (tmp_path / "prompts.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert len(set(head)) == len(head) == 4
    assert rows[0] == ["Visit", "0", "0.3", "0.3"]


def test_csv_has_all_digits_and_escapes_formulas(tmp_path: Path) -> None:
    columns = [Column("name"), Column("share", "share"), Column("=n", "count")]
    table = Sheet("t", columns, [["=1+1", 1 / 3, 4], [HOSTILE, None, None]])
    write_csv(table, tmp_path)
    with (tmp_path / "t.csv").open(newline="") as file:
        head, first, second = csv.reader(file)
    assert head == ["name", "share", "'=n"]
    assert first == ["'=1+1", str(1 / 3), "4"]
    assert second[1:] == ["", ""]
    assert "<script>" in second[0]


def test_cells_are_formatted_for_people() -> None:
    assert [
        format_cell(None, "share"),
        format_cell(0.12345, "share"),
        format_cell(0.1, "difference"),
        format_cell(-0.1, "difference"),
    ] == [
        "-",
        "0.123",
        "+0.100",
        "-0.100",
    ]
    assert (format_cell("PythonError", "class"), format_cell("PythonError", "text")) == (
        "Python error",
        "PythonError",
    )
    assert [
        format_cell(1e-17, "difference"),
        format_cell(1234, "count"),
        format_cell(1234.5678, "number"),
    ] == [
        "0.000",
        "1,234",
        "1,235",
    ]


def test_all_sections_and_tables_are_described() -> None:
    found = sections(usual(), with_published=True)
    assert {section.name for section in found} <= {*page_words()["sections"]}
    for part in (part for section in found for part in section.parts):
        if isinstance(part, Sheet):
            assert page_text("tables", part.name)["title"]
            assert all(len(row) == len(part.columns) for row in part.rows), part.name
