"""The command line: results on stdout, and one sentence and status 2 for bad input."""

import csv
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import polars as pl
import pytest

import shared_workers
from codebotler.simulator.worker import Worker
from command_line import ENVIRONMENT, Ended, forked, refused, roboeval
from forked import Forked
from roboeval import load_results
from roboeval.analysis.counting import counts
from roboeval.cli.output import show_progress
from roboeval.evaluation.runs.rows import Row
from seals import unseal

GREETS = 'def task_program():\n    say("good day")\n'


def row(index: int = 0, program: object = GREETS, task: str = "SayGoodDay", prompt: object = 0) -> str:
    return json.dumps({"task": task, "prompt": prompt, "index": index, "program": program}) + "\n"


# --- bad input


def test_a_missing_file(tmp_path: Path) -> None:
    refusal = refused("evaluate", tmp_path / "no.jsonl")
    assert refusal.at == (str(tmp_path / "no.jsonl"), None)
    assert {".jsonl", ".py"} <= {*re.findall(r"\.\w+", refusal.sentence)}


def test_an_empty_name() -> None:
    for verb in (("evaluate",), ("import", "--out", "run")):
        assert "a run, a .jsonl file, or a folder or zip of .py files" in refused(*verb, "").sentence
    for words in (("show",), ("export",), ("import", "a.jsonl", "--out"), ("evaluate", "a.jsonl", "--out")):
        assert refused(*words, "").sentence.endswith("a run")
    assert refused("export", "run", "--out", "").sentence.endswith("a file")


def test_an_empty_file(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("")
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", None)
    assert "no completion" in refusal.sentence


def test_a_line_that_is_not_json(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + "{oops\n" + row(1))
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 2)
    assert "not JSON;" in refusal.sentence
    example = json.loads(refusal.sentence[refusal.sentence.index("{") :])
    assert example.keys() == {"task", "prompt", "index", "program"}


def test_an_unfinished_last_line(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + '{"task": "SayGoodDay", "program": "x')
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 2)
    assert "not JSON;" in refusal.sentence


def test_a_program_is_not_a_file_of_completions(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(GREETS)
    refusal = refused("evaluate", "program.py", cwd=tmp_path)
    assert refusal.at == ("program.py", None)
    assert ".jsonl" in refusal.sentence
    assert json.loads(refusal.sentence[refusal.sentence.index("{") :])["program"]


@pytest.mark.parametrize("verb", ["evaluate", "import"])
def test_a_file_is_not_a_run(tmp_path: Path, verb: str) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    (tmp_path / "verdicts").write_text("mine")
    refusal = refused(verb, "a.jsonl", "--out", "verdicts", cwd=tmp_path)
    assert refusal.at == ("verdicts", None)
    assert "is a file" in refusal.sentence
    assert (tmp_path / "verdicts").read_text() == "mine"


@pytest.mark.parametrize("command", [("evaluate",), ("import", "--out", "run")])
@pytest.mark.parametrize("source", ["py", "py.zip"])
def test_misnamed_python_files_are_refused(tmp_path: Path, command: tuple[str, ...], source: str) -> None:
    names = ["SayGoodDay_0_0.py", "SayGoodDay_1.py", "notes.txt", "x.py"]
    (tmp_path / "py").mkdir()
    for name in names:
        (tmp_path / "py" / name).write_text("completion = ''")
    if source.endswith(".zip"):
        with zipfile.ZipFile(tmp_path / source, "w") as archive:
            for name in names:
                archive.write(tmp_path / "py" / name, name)
    refusal = refused(*command, source, cwd=tmp_path)
    assert refusal.at == (f"{source}/SayGoodDay_1.py", None)
    assert "TASK_PROMPT_INDEX.py" in refusal.sentence


def test_hidden_and_other_files_among_programs_are_ignored(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("SayGoodDay_0_0.py", "notes.txt", "__MACOSX/._SayGoodDay_0_0.py"):
            archive.writestr(name, "completion = ''")
    assert roboeval("evaluate", tmp_path / "a.zip").status == 0


def test_a_zip_with_a_damaged_member(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SayGoodDay_0_0.py", "completion = ''" * 100)
    data = bytearray((tmp_path / "a.zip").read_bytes())
    data[50:60] = b"\xff" * 10
    (tmp_path / "a.zip").write_bytes(data)
    refusal = refused("evaluate", "a.zip", cwd=tmp_path)
    assert refusal.at == ("a.zip", None)
    assert "not a readable zip" in refusal.sentence


def test_a_line_that_is_not_an_object(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + "[]\n")
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 2)
    assert "JSON object" in refusal.sentence


def test_an_unknown_task(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(task="SayGoodNight"))
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 2)
    for name in ('"paper"', '"SayGoodNight"', "CountSavory"):
        assert name in refusal.sentence


@pytest.mark.parametrize("prompt", [5, 10**9 - 1])
def test_a_prompt_out_of_range(tmp_path: Path, prompt: int) -> None:
    (tmp_path / "a.jsonl").write_text(row(prompt=prompt))
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 1)
    assert f'"SayGoodDay" has no prompt {prompt}' in refusal.sentence
    assert "0 to 4" in refusal.sentence


def test_an_unknown_task_of_a_published_file(tmp_path: Path) -> None:
    (tmp_path / "py").mkdir()
    (tmp_path / "py" / "SayGoodNight_0_0.py").write_text("completion = ''")
    refusal = refused("evaluate", "py", cwd=tmp_path)
    assert refusal.at == ("py/SayGoodNight_0_0.py", None)
    for name in ('"paper"', '"SayGoodNight"', "CountSavory"):
        assert name in refusal.sentence


@pytest.mark.parametrize(
    ("prompt", "value", "expected"),
    [
        (-1, "-1", "from 0"),
        ("0", "'0'", "whole number"),
        (True, "True", "whole number"),
    ],
)
def test_a_prompt_that_is_not_an_integer(tmp_path: Path, prompt: object, value: str, expected: str) -> None:
    (tmp_path / "a.jsonl").write_text(row(prompt=prompt))
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 1)
    for said in ("prompt", value, expected):
        assert said in refusal.sentence


def test_a_program_that_is_not_a_string(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1, program=["x"]))
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 2)
    for said in ("program", "['x']", "a string"):
        assert said in refusal.sentence


def test_a_row_that_lacks_a_program(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text('{"task": "SayGoodDay", "prompt": 0, "index": 0}\n')
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 1)
    assert '"program"' in refusal.sentence
    assert "missing" in refusal.sentence


def test_a_row_that_repeats_another(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1) + row())
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 3)
    assert "SayGoodDay/0/0" in refusal.sentence
    assert "line 1" in refusal.sentence


def test_a_row_of_ten_megabytes(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1, program="#" * 10_000_000))
    refusal = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", 2)
    assert "5,000,000 bytes" in refusal.sentence


def test_a_zip_that_is_not_a_zip(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_text("hello")
    refusal = refused("evaluate", "a.zip", cwd=tmp_path)
    assert refusal.at == ("a.zip", None)
    assert "not a readable zip" in refusal.sentence


def test_a_zip_member_that_is_too_large(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SayGoodDay_0_0.py", " " * 5_000_001)
    refusal = refused("evaluate", "a.zip", cwd=tmp_path)
    assert refusal.at == ("a.zip/SayGoodDay_0_0.py", None)
    assert "5,000,000 bytes" in refusal.sentence


def test_a_published_file_with_code_is_refused_and_not_run(tmp_path: Path) -> None:
    folder = tmp_path / "py"
    folder.mkdir()
    marker = tmp_path / "imported"
    (folder / "SayGoodDay_0_0.py").write_text(
        f"completion = open({str(marker)!r}, 'w').write('x') and 'program'\n"
    )
    refusal = refused("evaluate", folder)
    assert refusal.at == (str(folder / "SayGoodDay_0_0.py"), 1)
    assert refusal.commands == ["completion"]
    assert not marker.exists()


@pytest.mark.slow
def test_a_run_that_another_process_writes_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    script = (
        "import pathlib, sys\nfrom roboeval.evaluation.runs.folder import RunFolder\n"
        f"with RunFolder(pathlib.Path({str(tmp_path / 'run')!r})).writing():\n"
        "    print('on', flush=True)\n    sys.stdin.read()\n"
    )
    with Forked("-c", script, cwd=tmp_path, environment=ENVIRONMENT) as process:
        assert process.stdout is not None
        process.stdout.readline()
        refusal = refused("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path)
        assert refusal.at == ("run", None)
        assert "another process" in refusal.sentence
        process.kill()


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--engine", "steam"], ["'steam'", "local", "ray"]),
        (["--workers", "0"], ["invalid value", "'--workers'"]),
        (["--workers", "many"], ["invalid value", "'--workers'"]),
        (["--frobnicate"], ["--frobnicate"]),
        (["--worlds", "7"], ["worlds", '"paper"', "by hand"]),
        (["--seed", "7"], ["worlds", '"paper"', "by hand"]),
        (["--suite", "plus", "--worlds", "0"], ["invalid value", "'--worlds'"]),
        (["--suite", "plus", "--worlds", "1000000000"], ["invalid value", "'--worlds'", "10000"]),
        (["--suite", "plus", "--ablation"], ["none of CountSavory, ", "ablation"]),
        (["--suite", "nonsense"], ['"nonsense"', "paper", "plus"]),
        (["--tasks", "SayGoodDay,Nonsense"], ['"paper"', '"Nonsense"']),
        (["--tasks", "SayGoodDay", "--ablation"], ["SayGoodDay", "ablation"]),
    ],
)
def test_wrong_options_are_refused(tmp_path: Path, options: list[str], named: list[str]) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    refusal = refused("evaluate", "a.jsonl", *options, cwd=tmp_path)
    assert all(name in refusal.sentence for name in named), refusal


def test_a_task_without_completions(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    refusal = refused("evaluate", "a.jsonl", "--tasks", "LunchTime", cwd=tmp_path)
    assert refusal.at == ("a.jsonl", None)
    assert "LunchTime" in refusal.sentence


@pytest.mark.parametrize("arguments", [(), ("evaluate",), ("show", "a", "b", "c"), ("dance",), ("--frob",)])
def test_missing_and_unknown_commands(arguments: tuple[str, ...]) -> None:
    if arguments:
        command = "roboeval evaluate" if arguments == ("evaluate",) else "roboeval"
        assert any(each.startswith(command) for each in refused(*arguments).commands)
    else:
        ended = roboeval()
        assert (ended.status, ended.err) == (0, "")
        assert "evaluate" in ended.out


def test_a_suggestion_ends_with_a_question_mark() -> None:
    refusal = refused("generat")
    assert "generate" in refusal.sentence
    assert "? See `" in refusal.sentence
    assert refusal.commands == ["roboeval --help"]


@pytest.mark.slow
def test_worlds_of_another_seed_are_judged_shown_and_continued(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    drawn = ("--suite", "plus", "--worlds", "33", "--seed", "9")
    ended = roboeval("evaluate", "a.jsonl", "--out", "run", *drawn, cwd=tmp_path)
    assert ended.status == 0, ended.err
    found = json.loads((tmp_path / "run" / "evaluations" / "plus.json").read_text())
    assert (found["worlds"], found["seed"], found["rules"]["events"]) == (33, 9, "as-happened")
    (judged,) = (tmp_path / "run" / "evaluations" / "plus.jsonl").read_text().splitlines()
    assert len(json.loads(judged)["verdicts"]) >= 33
    shown = roboeval("show", "run", "SayGoodDay/0/0", "--suite", "plus", cwd=tmp_path)
    assert shown.status == 0
    assert "the suite has changed" not in shown.err
    assert "World 9 of 33: " in shown.out
    assert "World 9 of 33: 9: " not in shown.out
    failed = load_results(tmp_path / "run", suite="plus").filter(pl.col("failed_checks") != "")
    assert failed.height
    assert failed["category"].null_count() == 0
    assert "--redo" in refused("evaluate", "run", "--suite", "plus", cwd=tmp_path).sentence
    assert roboeval("evaluate", "run", *drawn, cwd=tmp_path).status == 0


@pytest.mark.parametrize("verb", ["evaluate", "import"])
@pytest.mark.parametrize("out", ["run", "some/new/run"])
def test_a_wrong_row_leaves_no_files(tmp_path: Path, verb: str, out: str) -> None:
    (tmp_path / "a.jsonl").write_text(row() + "{oops\n" + row(1))
    refused(verb, "a.jsonl", "--out", out, cwd=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a.jsonl"]


# --- limits of the machine


FULL = r"[^\n]*: File too large; [^\n]*\n"
SMALL_DISK = 900  # The limit of the size of a file, in KiB.
LONG = 'def task_program(): say("good day " * 1000)\n'
ON_A_DISK = """
import resource, sys
from roboeval.cli.app import main
sys.argv[0] = "roboeval"
size = int(sys.argv.pop(1)) * 1024
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
main()
"""


def roboeval_on_a_disk(size: int, *words: str, cwd: Path) -> Ended:
    """Run a command in a process of its own, which writes no file of more than so many KiB."""
    return forked("-c", ON_A_DISK, str(size), *words, cwd=cwd)


@pytest.mark.slow
def test_an_evaluation_continues_after_a_full_disk(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("".join(row(index, f"{LONG}# {index}") for index in range(30)))
    assert roboeval("import", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    ended = roboeval_on_a_disk(SMALL_DISK, "evaluate", "run", cwd=tmp_path)
    assert (ended.status, ended.out) == (1, "")
    assert re.fullmatch(r"roboeval: run/evaluations/paper\.jsonl" + FULL, ended.err)
    rows = (tmp_path / "run" / "evaluations" / "paper.jsonl").read_bytes()
    assert 1 <= rows.count(b"\n") < 30
    assert rows.endswith(b"}\n")
    assert roboeval("evaluate", "run", cwd=tmp_path).status == 0
    assert (tmp_path / "run" / "evaluations" / "paper.jsonl").read_bytes().startswith(rows)


@pytest.mark.slow
def test_a_full_disk_leaves_no_incomplete_run(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("".join(row(index, "#" * 100_000) for index in range(12)))
    ended = roboeval_on_a_disk(SMALL_DISK, "import", "a.jsonl", "--out", "new/run", cwd=tmp_path)
    assert (ended.status, ended.out) == (1, "")
    assert re.fullmatch(r"roboeval: new/run/completions\.jsonl" + FULL, ended.err)
    assert [path.name for path in tmp_path.iterdir()] == ["a.jsonl"]


@pytest.mark.slow
def test_a_full_disk_leaves_an_exported_table_unchanged(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("".join(map(row, range(12))))
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    for kind in ("csv", "parquet"):
        assert roboeval("export", "run", "--format", kind, "--out", "table", cwd=tmp_path).status == 0
        as_it_was = (tmp_path / "table").read_bytes()
        ended = roboeval_on_a_disk(1, "export", "run", "--format", kind, "--out", "table", cwd=tmp_path)
        assert ended.status == 1, ended
        assert re.fullmatch("roboeval: table" + FULL, ended.err)
        assert (tmp_path / "table").read_bytes() == as_it_was
        assert not (tmp_path / "table.new").exists()


def test_a_table_replaces_only_tables(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row(task="LunchTime"))
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    for file in ("a.jsonl", "run/completions.jsonl"):
        before = (tmp_path / file).read_bytes()
        refusal = refused("export", "run", "--out", file, cwd=tmp_path)
        assert refusal.at == (file, None)
        assert "unexpected content" in refusal.sentence
        assert (tmp_path / file).read_bytes() == before
    for name in ("table.csv", "table.csv", "table.parquet", "table.parquet"):
        assert roboeval("export", "run", "--out", name, cwd=tmp_path).status == 0


@pytest.mark.parametrize("verb", ["evaluate", "import"])
def test_a_folder_with_other_files_cannot_become_a_run(tmp_path: Path, verb: str) -> None:
    (tmp_path / "a.jsonl").write_text(row(task="LunchTime"))
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "mine.md").write_text("mine")
    refusal = refused(verb, "a.jsonl", "--out", "docs", cwd=tmp_path)
    assert refusal.at == ("docs", None)
    assert '"mine.md"' in refusal.sentence
    assert [path.name for path in (tmp_path / "docs").iterdir()] == ["mine.md"]


@pytest.mark.parametrize("columns", ["0", "000", ""])
def test_a_terminal_with_no_columns_has_an_unknown_width(columns: str) -> None:
    unknown = {name: value for name, value in ENVIRONMENT.items() if name != "COLUMNS"}
    found = roboeval("tasks", environment=unknown | {"COLUMNS": columns}).out
    assert found == roboeval("tasks", environment=unknown).out
    assert "LunchTime" in found


@pytest.mark.slow
def test_a_full_or_closed_output() -> None:
    ended = roboeval("tasks", "LunchTime", after="> /dev/full")
    assert ended.status == 1
    assert re.fullmatch(r"roboeval: [^\n]*: No space left on device; [^\n]*\n", ended.err)
    assert roboeval("tasks", "LunchTime", after="| head -c 1").err == ""


def test_progress_counts_consumed_items(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("roboeval.cli.output.QUIET_S", 0.0)
    items = show_progress("ab", "judging", 2)
    assert (next(items), capsys.readouterr().err) == ("a", "")
    assert (next(items), capsys.readouterr().err[:15]) == ("b", "judging: 1 of 2")


# --- Ctrl-C


SLOW = "def task_program():\n    for i in range(150000): pass\n# {}\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "options", "kept"),
    [
        (["a.jsonl", "--out", "run"], [], True),
        (["kept"], [], True),
        (["kept", "--redo"], ["--redo"], True),
        (["a.jsonl"], ["--out"], False),
    ],
)
def test_ctrl_c_ends_with_a_sentence_about_the_kept_rows(
    tmp_path: Path, arguments: list[str], options: list[str], *, kept: bool
) -> None:
    (tmp_path / "a.jsonl").write_text("".join(row(i, SLOW.format(i)) for i in range(400)))
    assert roboeval("import", "a.jsonl", "--out", "kept", cwd=tmp_path).status == 0
    words = ("evaluate", "--workers", "1", *arguments)
    process = Forked("roboeval", *words, cwd=tmp_path, environment=ENVIRONMENT)
    assert process.stderr is not None
    said = process.stderr.readline()
    assert said.startswith("judging: ")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert (process.returncode, out) == (130, ""), err
    assert err.splitlines()[-1].startswith("roboeval: stopped; ")
    assert re.findall("--[a-z]+", err.splitlines()[-1]) == options
    assert "Traceback" not in err
    assert any(tmp_path.glob("*/evaluations/paper.jsonl")) == kept


def test_a_run_that_was_not_judged(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    assert roboeval("import", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    refusal = refused("show", "run", cwd=tmp_path)
    assert refusal.at == ("run", None)
    assert refusal.commands == ["roboeval evaluate run"]
    refusal = refused("show", "nothing", cwd=tmp_path)
    assert refusal.at == ("nothing", None)
    assert "completions.jsonl" in refusal.sentence


def test_changed_completions_are_refused_with_two_suggestions(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    changed = row().replace("task_program", "task_program ")
    (tmp_path / "a.jsonl").write_text(changed)
    said = refused("evaluate", "a.jsonl", "--out", "run", "--redo", cwd=tmp_path).sentence
    assert "another folder" in said
    (again,) = re.findall("`(.*)`", said)
    (tmp_path / "run" / "completions.jsonl").write_text(changed)
    assert roboeval(*shlex.split(again)[1:], cwd=tmp_path).status == 0


def test_a_run_that_another_suite_judged(tmp_path: Path) -> None:
    roboeval("tasks", "--new", "MakeTea", "--suite", "mine", cwd=tmp_path)
    (tmp_path / "a.jsonl").write_text(row(task="MakeTea"))
    assert roboeval("evaluate", "a.jsonl", "--out", "run", "--suite", "mine", cwd=tmp_path).status == 0
    for asked in (("export", "run"), ("show", "run", "--ablation"), ("show", "run", "MakeTea")):
        refusal = refused(*asked, cwd=tmp_path)
        assert refusal.at == ("run", None)
        for name in ("mine", '"paper', "--suite"):
            assert name in refusal.sentence
    assert roboeval("show", "run", "--suite", "mine", cwd=tmp_path).status == 0


# --- normal use


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("judged")
    (folder / "a.jsonl").write_text(row() + row(1, program="go_to('nowhere')") + row(2))
    ended = roboeval("evaluate", "a.jsonl", "--out", "run", cwd=folder)
    assert ended.status == 0, ended
    assert "SayGoodDay" in ended.out
    assert "verdicts are in run" in ended.err
    return folder / "run"


def test_json_output_comes_without_messages(run: Path) -> None:
    for arguments in (
        ("show", run),
        ("show", run, "SayGoodDay"),
        ("show", run, "SayGoodDay/0/1"),
    ):
        ended = roboeval(*arguments, "--json")
        assert ended.err == ""
        json.loads(ended.out)


@pytest.mark.slow
def test_completions_can_come_from_a_pipe(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1, "go_to('nowhere')"))
    ended = roboeval("evaluate", "--json", cwd=tmp_path, after="<(cat a.jsonl)")
    assert json.loads(ended.out)["completions"] == 2
    end, given = os.pipe()
    os.write(given, (tmp_path / "a.jsonl").read_bytes() + b"oops\n")
    os.close(given)
    wrong = refused("evaluate", f"/dev/fd/{end}", cwd=tmp_path)
    os.close(end)
    assert wrong.at == (f"/dev/fd/{end}", 3)
    assert "JSON; " in wrong.sentence


def test_the_version_is_printed() -> None:
    assert re.fullmatch(r"roboeval \d+\.\d+\.\d+\n", roboeval("--version").out)


def run_named_command(sentence: str, cwd: Path) -> Ended:
    """Run the command that a sentence names."""
    (command,) = re.findall("`([^`]+)`", sentence)
    name, *arguments = shlex.split(command)
    assert name == "roboeval"
    return roboeval(*arguments, cwd=cwd)


def test_commands_in_sentences_can_be_pasted(tmp_path: Path) -> None:
    roboeval("tasks", "--new", "MakeTea", "--suite", "my suite", cwd=tmp_path)
    (tmp_path / "a.jsonl").write_text(row(task="MakeTea"))
    imported = roboeval("import", "a.jsonl", "--out", "my run", "--suite", "my suite", cwd=tmp_path)
    unjudged = refused("show", "my run", "--suite", "my suite", cwd=tmp_path)
    assert run_named_command(unjudged.sentence, tmp_path).status == 0
    judged = run_named_command(imported.err, tmp_path)
    assert judged.status == 0
    shown = run_named_command(judged.err, tmp_path)
    assert shown.out.startswith("MakeTea/0/0  failed check")


def test_commands_in_sentences_keep_the_ablation(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row(task="LunchTime"))
    imported = roboeval("import", "a.jsonl", "--out", "run", cwd=tmp_path)
    assert "run has 1 completion" in imported.err
    unjudged = refused("show", "run", "--ablation", cwd=tmp_path)
    assert unjudged.commands == ["roboeval evaluate run --ablation"]
    judged = run_named_command(unjudged.sentence, tmp_path)
    assert run_named_command(judged.err.splitlines()[-1], tmp_path).out.startswith("LunchTime/0/0")


def test_an_unfinished_evaluation_says_so(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(
        "".join(map(row, range(3))) + row(task="LunchTime") + row(task="GetDrink")
    )
    options = ("--tasks", "LunchTime,SayGoodDay")
    assert roboeval("evaluate", "a.jsonl", "--out", "run", *options, cwd=tmp_path).status == 0
    rows = tmp_path / "run" / "evaluations" / "paper.jsonl"
    rows.write_bytes(b"".join(rows.read_bytes().splitlines(keepends=True)[:2]))
    unseal(tmp_path / "run")
    shown = roboeval("show", "run", cwd=tmp_path)
    assert "\n2 of 4 completions (2 not judged), 1 prompt of 1 task\n" in shown.out
    assert "no results for 15 tasks\n" in shown.out
    assert "2 of 4 completions" in shown.err
    assert "`roboeval evaluate run --tasks LunchTime,SayGoodDay`" in shown.err
    data = json.loads(roboeval("show", "run", "--json", cwd=tmp_path).out)
    assert (data["judged"], data["to_judge"]) == (2, 4)
    assert {"LunchTime", "GetDrink"} <= {*data["missing"]}
    exported = roboeval("export", "run", cwd=tmp_path).err
    assert exported.startswith("only judged completions count: 2 of 4 completions")
    assert run_named_command(shown.err, tmp_path).status == 0
    assert roboeval("show", "run", cwd=tmp_path).err == ""


def test_a_program_that_was_changed_since_it_was_judged_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("".join(map(row, range(3))))
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    (tmp_path / "run" / "completions.jsonl").write_text(row() + row(1, "say('other')") + row(2, "say('one')"))
    for words in (("evaluate",), ("show",), ("show", "SayGoodDay/0/1"), ("export",)):
        verb, *what = words
        refusal = refused(verb, "run", *what, cwd=tmp_path)
        assert refusal.at == ("run/evaluations/paper.jsonl", 2)
        assert "SayGoodDay/0/1" in refusal.sentence
        assert "--redo" in refusal.sentence
    assert roboeval("evaluate", "run", "--redo", cwd=tmp_path).status == 0
    assert roboeval("show", "run", cwd=tmp_path).err == ""


@pytest.mark.parametrize(
    ("models", "label"),
    [
        (["recorded:hasty", "recorded:careful"], "(programs written by hand)"),
        (["recorded:hasty", "gpt"], "(some programs written by hand)"),
        (["gpt", None], ""),
    ],
)
def test_programs_written_by_hand_are_labelled_by_who_wrote_them(
    tmp_path: Path, models: list[str | None], label: str
) -> None:
    rows = [{**json.loads(row(index)), "model": model} for index, model in enumerate(models)]
    (tmp_path / "recorded.jsonl").write_text("".join(json.dumps(each) + "\n" for each in rows))
    judged = roboeval("evaluate", "recorded.jsonl", "--out", "run", cwd=tmp_path)
    assert judged.out.splitlines()[0] == f"recorded.jsonl {label}".rstrip()
    assert roboeval("show", "run", cwd=tmp_path).out.splitlines()[0] == f"run {label}".rstrip()
    for what in ("SayGoodDay", "SayGoodDay/0"):
        assert roboeval("show", "run", what, cwd=tmp_path).out.splitlines()[0].endswith(label)


def test_show_says_why(run: Path) -> None:
    assert "GoToInvalidLocation" in roboeval("show", run, "SayGoodDay").out
    one = roboeval("show", run, "SayGoodDay/0/1").out
    assert "instruction not recorded" in one
    assert '"nowhere"' in one
    other = roboeval("show", run, "SayGoodDay/0/0").out
    assert "the robot never went to" in other


def test_show_gives_pass_at_any_k_that_the_run_can_estimate(run: Path) -> None:
    assert "pass@3" in roboeval("show", run, "--k", "3").out
    refusal = refused("show", run, "--k", "4").sentence
    assert re.search(r"\b4\b.* 1 to 3", refusal)


def test_a_damaged_row_is_named_by_its_line(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    rows = tmp_path / "run" / "evaluations" / "paper.jsonl"
    for line, fault in [
        ('{"task": "SayGoodDay"}', "evaluation row"),
        ("?", "JSON is malformed"),
        ("[]", "Expected `object`"),
    ]:
        rows.write_text(f"{line}\n")
        refusal = refused("show", "run", cwd=tmp_path)
        assert refusal.at == ("run/evaluations/paper.jsonl", 1)
        assert fault in refusal.sentence
        assert "--redo" in refusal.sentence
        assert refused("evaluate", "run", cwd=tmp_path) == refusal


def test_export_writes_a_row_for_each_completion_and_world(run: Path) -> None:
    assert roboeval("export", run).status == 0
    rows = list(csv.DictReader((run / "evaluations" / "paper.csv").read_text().splitlines()))
    assert len(rows) == 3 * 4
    assert {row["status"] for row in rows} == {"finished", "robot-error"}
    assert roboeval("export", run, "--format", "parquet", "--out", run / "t.parquet").status == 0
    assert (run / "t.parquet").read_bytes().startswith(b"PAR1")


def test_a_table_with_costs(tmp_path: Path) -> None:
    usage = {"input_tokens": 1_000, "output_tokens": 100}
    (tmp_path / "a.jsonl").write_text(json.dumps({**json.loads(row()), "usage": usage}) + "\n" + row(index=1))
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    assert roboeval("export", "run", "--price", "3/15", "--out", "t.csv", cwd=tmp_path).status == 0
    costs = {
        one["index"]: one["cost"] for one in csv.DictReader((tmp_path / "t.csv").read_text().splitlines())
    }
    assert costs == {"0": "0.0045", "1": ""}
    for price in ("3", "3/15/1", "a/b", "-1/2", "nan/1", "1/1000000"):
        assert price in refused("export", "run", "--price", price, cwd=tmp_path).sentence


def test_a_finished_evaluation_judges_nothing_again(run: Path) -> None:
    rows = run / "evaluations" / "paper.jsonl"
    before = rows.read_bytes(), rows.stat().st_mtime_ns
    assert roboeval("evaluate", run).status == 0
    assert (rows.read_bytes(), rows.stat().st_mtime_ns) == before


def test_ablation_names_the_tasks_that_have_none(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(task="LunchTime"))
    ended = roboeval("evaluate", "a.jsonl", "--ablation", "--out", "run", cwd=tmp_path)
    assert ended.status == 0
    assert "ablation" in ended.err
    assert ": ElevatorTour, " in ended.err
    rows = (tmp_path / "run" / "evaluations" / "paper-ablation.jsonl").read_text().splitlines()
    assert [json.loads(line)["task"] for line in rows] == ["LunchTime"]


def test_published_completions_become_a_run(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for index in (10, 2):
            archive.writestr(
                f"all/SayGoodDay_1_{index}.py", f"name = 'n'\nprompt = 'p {index}'\ncompletion = {GREETS!r}\n"
            )
    assert roboeval("import", "a.zip", "--out", "run", cwd=tmp_path).status == 0
    rows = [json.loads(line) for line in (tmp_path / "run" / "completions.jsonl").read_text().splitlines()]
    assert [(r["prompt"], r["index"], r["instruction"]) for r in rows] == [(1, 2, "p 2"), (1, 10, "p 10")]


def test_tasks_are_listed_and_shown() -> None:
    listed = roboeval("tasks").out
    assert "WeatherPoll" in listed
    shown = roboeval("tasks", "LunchBreak").out
    assert "requires not tells_after_asking" in shown
    assert '"Nonsense"' in refused("tasks", "Nonsense").sentence


@pytest.mark.slow
def test_accepted_findings_are_shown_with_their_reasons() -> None:
    linted = roboeval("tasks", "HalloweenShopping", "--lint")
    assert linted.status == 0
    assert re.search(r"\b1 accepted finding\b.* --accepted\b", linted.out)
    shown = roboeval("tasks", "HalloweenShopping", "--lint", "--accepted")
    assert shown.status == 0
    assert re.search(r"HalloweenShopping.yaml:\d+: accepted: .* \[same-worlds: 4 and 5\]: \w+", shown.out)
    assert "--lint" in refused("tasks", "--accepted").sentence


def test_help_costs_little() -> None:
    script = (
        "import resource, subprocess, sys\n"
        "subprocess.run([sys.executable, '-m', 'roboeval.cli.app', '--help'], check=True, stdout=-3)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(used.ru_utime + used.ru_stime)\n"
    )
    used = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    heavy = "{'pydantic', 'yaml', 'rich', 'polars'}"
    bare = f"import sys, roboeval.cli.app; print(bool({heavy} & sys.modules.keys()))"
    assert float(used) < 3.0  # Slow machines need the time; the benches measure the real costs.
    assert subprocess.run(
        [sys.executable, "-c", bare], capture_output=True, text=True, check=True
    ).stdout == ("False\n")


def test_ctrl_c_while_a_row_is_counted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())

    def interrupt(_: Row) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(counts, "outcome_of", interrupt)
    ended = roboeval("evaluate", "a.jsonl", cwd=tmp_path)
    assert (ended.status, ended.out) == (130, "")
    assert ended.err.splitlines()[-1].startswith("roboeval: stopped; ")


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "evaluate recorded:careful --tasks SayGoodDay",
        "run --model recorded:careful --tasks SayGoodDay --num-completions 1 --no-report --out judged",
        "resample judged",
        "mutate SayGoodDay --mutants 3",
    ],
)
def test_each_run_can_have_a_process_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, command: str
) -> None:
    alone: list[bool] = []
    start = Worker.__init__

    def note_start(self: Worker, *, one_process_per_run: bool = False) -> None:
        alone.append(one_process_per_run)
        start(self, one_process_per_run=one_process_per_run)

    if command.startswith("resample"):
        (tmp_path / "a.jsonl").write_text(row())
        assert roboeval("evaluate", "a.jsonl", "--out", "judged", cwd=tmp_path).status == 0
    shared_workers.end_all()
    monkeypatch.setattr(Worker, "__init__", note_start)
    ended = roboeval(*command.split(), "--one-process-per-run", cwd=tmp_path)
    assert (ended.status, alone[0], all(alone)) == (0, True, True), ended.err
