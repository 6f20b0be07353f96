"""The command `roboeval report`."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import ENVIRONMENT, refused, roboeval
from forked import Forked
from seals import unseal


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two small judged runs, of hasty and of careful programs."""
    folder = tmp_path_factory.mktemp("runs")
    for name in ("hasty", "careful"):
        made = roboeval(
            *("run", "--model", f"recorded:{name}", "--tasks", "LunchTime,SayGoodDay"),
            *("--num-completions", "4", "--out", name, "--no-report"),
            cwd=folder,
        )
        assert made.status == 0, made
    return folder


@pytest.mark.slow
def test_a_report_of_two_runs(runs: Path) -> None:
    label = ("--label", "hasty=Base model")
    made = roboeval("report", "hasty", "careful", "--out", "report", *label, cwd=runs)
    assert made.status == 0, made
    assert made.out == ""
    assert made.err.endswith("the report is in report/index.html\n")
    text = (runs / "report" / "index.html").read_text()
    assert "recorded:careful" in text
    assert "<h3>Base model</h3>" in text
    assert "--label &#x27;hasty=Base model&#x27;" in text
    for kind in ("png", "pdf"):
        names = {path.stem for path in (runs / "report" / "figures").glob(f"*.{kind}")}
        assert names == {"overall", "tasks", "thresholds", "causes", "rejection-sampling", "accepted"}
    (runs / "first").mkdir()
    (runs / "report").rename(runs / "first" / "report")
    again = roboeval("report", "hasty", "careful", "--out", "report", *label, cwd=runs)
    assert again.status == 0
    files = [path.relative_to(runs / "first") for path in (runs / "first").rglob("*") if path.is_file()]
    assert len(files) > 20
    for file in files:
        assert (runs / file).read_bytes() == (runs / "first" / file).read_bytes(), file


COUNTING = """
import sys
from collections import Counter
from roboeval.cli.app import main

opened = Counter()
sys.addaudithook(lambda event, told: event == "open" and opened.update([str(told[0]).rpartition("/")[2]]))
try:
    main()
finally:
    print([opened[name] for name in ("completions.jsonl", "run.json")], file=sys.stderr)
"""


@pytest.fixture(scope="module")
def judged_thrice(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run that has three evaluations."""
    folder = tmp_path_factory.mktemp("thrice")
    shutil.copytree(runs / "hasty", folder / "run")
    for other in (("--ablation",), ("--suite", "plus")):
        assert roboeval("evaluate", "run", *other, cwd=folder).status == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", ["report run --out report --beside plus", "compare run --suites paper,plus", "show run"]
)
def test_completions_are_read_once_for_all_evaluations(command: str, judged_thrice: Path) -> None:
    process = Forked("-c", COUNTING, *command.split(), cwd=judged_thrice, environment=ENVIRONMENT)
    _, err = process.communicate()
    assert (process.returncode, err.splitlines()[-1]) == (0, "[1, 1]"), err


@pytest.mark.slow
def test_an_unfinished_run_is_reported_with_its_counts(runs: Path) -> None:
    shutil.copytree(runs / "careful", runs / "part", ignore=shutil.ignore_patterns("checks"))
    rows = runs / "part" / "evaluations" / "paper.jsonl"
    lines = rows.read_text().splitlines(keepends=True)
    rows.write_text("".join(lines[:-3]))
    unseal(runs / "part")
    price = ("--price", "recorded:careful=1/2")
    made = roboeval("report", "part", "--out", "partly", *price, "--no-check", cwd=runs)
    assert made.status == 0, made
    assert "37 of 40 completions" in made.err
    text = (runs / "partly" / "index.html").read_text()
    assert "37 of 40 completions" in text
    assert "roboeval report part --out partly --no-check --price recorded:careful=1/2" in text
    assert not (runs / "partly" / "figures" / "accepted.png").exists()
    assert not (runs / "part" / "checks").exists()
    rows.write_text("")
    nothing = roboeval("report", "part", "--out", "none", "--no-check", cwd=runs)
    assert nothing.status == 2
    assert "0 of 40 completions" in nothing.err


def test_wrong_prices_are_refused(runs: Path) -> None:
    refusal = refused("report", runs / "careful", "--out", runs / "x", "--price", "careful", "--no-check")
    assert '"careful"' in refusal.sentence
    assert "MODEL=INPUT/OUTPUT" in refusal.sentence
    assert not (runs / "x").exists()


def test_labels_of_unknown_runs_are_refused(runs: Path) -> None:
    refusal = refused("report", runs / "careful", "--out", runs / "x", "--label", "other=A", "--no-check")
    assert '"other"' in refusal.sentence
    assert not (runs / "x").exists()


def test_wrong_folders_are_refused(runs: Path, tmp_path: Path) -> None:
    refusal = refused("report", tmp_path, "--out", tmp_path / "r")
    assert refusal.at == (str(tmp_path), None)
    assert "completions.jsonl" in refusal.sentence
    (tmp_path / "file").write_text("")
    refusal = refused("report", runs / "careful", "--out", tmp_path / "file", "--no-check")
    assert refusal.at == (str(tmp_path / "file" / "tables"), None)
    assert "Not a directory" in refusal.sentence
    assert refused("report", runs / "careful", "--out", "").sentence.endswith("a folder")


def test_a_folder_with_other_files_cannot_become_a_report(runs: Path, tmp_path: Path) -> None:
    mine = tmp_path / "figures" / "tasks.pdf"
    mine.parent.mkdir()
    mine.write_text("mine")
    said = refused("report", runs / "careful", "--out", tmp_path, "--no-check")
    assert said.at == (str(tmp_path), None)
    assert '"figures"' in said.sentence
    (tmp_path / "index.html").write_text("my own page")
    assert refused("report", runs / "careful", "--out", tmp_path, "--no-check") == said
    assert (mine.read_text(), (tmp_path / "index.html").read_text()) == ("mine", "my own page")


def test_runs_of_different_suites_are_not_compared(runs: Path) -> None:
    head = runs / "careful" / "evaluations" / "paper.json"
    kept = head.read_text()
    head.write_text(json.dumps(json.loads(kept) | {"digest": "f" * 64}))
    ended = roboeval("report", "hasty", "careful", "--out", "mixed", cwd=runs)
    head.write_text(kept)
    assert ended.status == 2
    assert "another version of the suite" in ended.err, ended
    assert "`roboeval evaluate careful --tasks LunchTime,SayGoodDay --redo`" in ended.err
    assert not (runs / "mixed").exists()


def test_help_imports_no_heavy_library() -> None:
    code = "import sys, roboeval.cli.app\n"
    code += "print([m for m in ('matplotlib', 'numpy', 'polars') if m in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "[]\n"
