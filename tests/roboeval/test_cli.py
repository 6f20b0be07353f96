"""The command line as a person meets it: results on stdout, one sentence and status 2 for what is wrong."""

import csv
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

GREETS = 'def task_program():\n    say("good day")\n'


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    out: str
    err: str


def roboeval(*arguments: str | Path, cwd: Path | None = None) -> Ended:
    environment = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}
    ended = subprocess.run(
        [sys.executable, "-m", "roboeval.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=environment,
    )
    return Ended(ended.returncode, ended.stdout, ended.stderr)


def row(index: int = 0, program: object = GREETS, task: str = "SayGoodDay", prompt: object = 0) -> str:
    return json.dumps({"task": task, "prompt": prompt, "index": index, "program": program}) + "\n"


def refused(*arguments: str | Path, cwd: Path | None = None) -> str:
    """The one sentence with which a command refuses; nothing but it is printed."""
    ended = roboeval(*arguments, cwd=cwd)
    assert ended.status == 2, ended
    assert ended.out == ""
    assert ended.err.startswith("roboeval: ")
    assert ended.err.count("\n") == 1
    return ended.err.removeprefix("roboeval: ").rstrip("\n")


# --- bad input


def test_a_missing_file(tmp_path: Path) -> None:
    assert refused("evaluate", tmp_path / "no.jsonl").endswith(
        "no.jsonl: there is no such file or folder; name a run, a .jsonl, or a folder or zip of .py"
    )


def test_an_empty_file(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text("")
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == "a.jsonl: there is no completion in it"


def test_a_line_that_is_no_json(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + "{oops\n" + row(1))
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == "a.jsonl, line 2: this line is no JSON"


def test_a_last_line_that_is_no_json_and_has_no_end(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + '{"task": "SayGoodDay", "program": "x')
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == "a.jsonl, line 2: this line is no JSON"


def test_a_zip_with_a_damaged_member(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SayGoodDay_0_0.py", "completion = ''" * 100)
    data = bytearray((tmp_path / "a.zip").read_bytes())
    data[50:60] = b"\xff" * 10
    (tmp_path / "a.zip").write_bytes(data)
    assert refused("evaluate", "a.zip", cwd=tmp_path).startswith("a.zip: is no readable zip")


def test_a_line_that_is_no_object(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + "[]\n")
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == "a.jsonl, line 2: this line is no JSON object"


def test_an_unknown_task(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(task="SayGoodNight"))
    sentence = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert sentence.startswith(
        'a.jsonl, line 2: the suite has no task "SayGoodNight"; its tasks are CountSavory,'
    )


@pytest.mark.parametrize("prompt", [5, 10**30])
def test_a_prompt_out_of_range(tmp_path: Path, prompt: int) -> None:
    (tmp_path / "a.jsonl").write_text(row(prompt=prompt))
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == (
        f"a.jsonl, line 1: SayGoodDay/{prompt}/0: the task has prompts 0 to 4"
    )


@pytest.mark.parametrize(
    ("prompt", "problem"),
    [(-1, "should be greater than or equal to 0"), ("0", "valid integer"), (True, "valid integer")],
)
def test_a_prompt_that_is_no_number(tmp_path: Path, prompt: object, problem: str) -> None:
    (tmp_path / "a.jsonl").write_text(row(prompt=prompt))
    sentence = refused("evaluate", "a.jsonl", cwd=tmp_path)
    assert sentence.startswith('a.jsonl, line 1: "prompt" is wrong: ')
    assert problem in sentence


def test_a_program_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1, program=["x"]))
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == (
        'a.jsonl, line 2: "program" is wrong: input should be a valid string'
    )


def test_a_row_that_lacks_a_program(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text('{"task": "SayGoodDay", "prompt": 0, "index": 0}\n')
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == 'a.jsonl, line 1: "program" is missing'


def test_a_row_that_repeats_another(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1) + row())
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == (
        "a.jsonl, line 3: SayGoodDay/0/0 stands here again; it stood in line 1 already"
    )


def test_a_row_of_ten_megabytes(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(1, program="#" * 10_000_000))
    assert refused("evaluate", "a.jsonl", cwd=tmp_path) == (
        "a.jsonl, line 2: this row is longer than 5,000,000 bytes"
    )


@pytest.mark.parametrize("name", ["../SayGoodDay_0_0.py", "/SayGoodDay_0_0.py", "a/../../SayGoodDay_0_0.py"])
def test_a_zip_that_names_a_file_outside(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr(name, "completion = ''")
    assert (
        refused("evaluate", "a.zip", cwd=tmp_path) == f'a.zip: the zip names a file outside itself, "{name}"'
    )


def test_a_zip_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_text("hello")
    assert refused("evaluate", "a.zip", cwd=tmp_path).startswith("a.zip: is no readable zip")


def test_a_file_that_swells_in_a_zip(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SayGoodDay_0_0.py", " " * 50_000_000)
    assert "is larger than 5,000,000 bytes" in refused("evaluate", "a.zip", cwd=tmp_path)


def test_a_published_file_that_is_not_assignments_of_texts(tmp_path: Path) -> None:
    folder = tmp_path / "py"
    folder.mkdir()
    marker = tmp_path / "imported"
    (folder / "SayGoodDay_0_0.py").write_text(
        f"completion = open({str(marker)!r}, 'w').write('x') and 'program'\n"
    )
    assert "cannot be read as assignments of texts" in refused("evaluate", folder)
    assert not marker.exists()


def test_a_run_that_another_process_writes(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    script = (
        "import pathlib, sys\nfrom roboeval.run import Run\n"
        f"with Run(pathlib.Path({str(tmp_path / 'run')!r})).writing():\n"
        "    print('on', flush=True)\n    sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        sentence = refused("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path)
        assert sentence == "run: another process is writing this run; wait until it has ended"
        process.kill()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--engine", "ray"], "--engine ray is not there yet; leave it out"),
        (["--worlds", "7"], "--worlds is not there yet; leave it out"),
        (["--suite", "plus"], 'the suite "plus" is not there yet; leave --suite out'),
        (["--suite", "nonsense"], 'there is no suite "nonsense"'),
        (["--tasks", "SayGoodDay,Nonsense"], 'the suite "paper" has no task "Nonsense"'),
        (["--tasks", "SayGoodDay", "--ablation"], "none of SayGoodDay has an ablation"),
        (["--tasks", "LunchTime"], "a.jsonl: there is no completion of LunchTime in it"),
    ],
)
def test_an_option_that_cannot_be_followed(tmp_path: Path, options: list[str], sentence: str) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    assert refused("evaluate", "a.jsonl", *options, cwd=tmp_path).startswith(sentence)


def test_nothing_is_half_written_when_a_row_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + "{oops\n" + row(1))
    refused("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path)
    assert not (tmp_path / "run" / "completions.jsonl").exists()


def test_a_run_that_was_not_judged(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    assert roboeval("import", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    assert refused("show", "run", cwd=tmp_path) == "run: has not been judged; `roboeval evaluate run` does it"
    assert refused("show", "nothing", cwd=tmp_path) == "nothing: is no run: it holds no completions.jsonl"


# --- what it is for


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("judged")
    (folder / "a.jsonl").write_text(row() + row(1, program="go_to('nowhere')") + row(2))
    ended = roboeval("evaluate", "a.jsonl", "--out", "run", cwd=folder)
    assert ended.status == 0, ended
    assert "SayGoodDay" in ended.out
    assert "verdicts are in run" in ended.err
    return folder / "run"


def test_json_is_for_machines_alone(run: Path) -> None:
    for arguments in (
        ("show", run),
        ("show", run, "SayGoodDay"),
        ("show", run, "SayGoodDay/0/1"),
        ("tasks",),
    ):
        ended = roboeval(*arguments, "--json")
        assert ended.err == ""
        json.loads(ended.out)


def test_show_says_why(run: Path) -> None:
    assert "GoToInvalidLocation" in roboeval("show", run, "SayGoodDay").out
    one = roboeval("show", run, "SayGoodDay/0/1").out
    assert "instruction not recorded" in one
    assert 'there is no room "nowhere"' in one
    other = roboeval("show", run, "SayGoodDay/0/0").out
    assert "the robot never went to" in other


def test_show_gives_pass_at_any_k_that_the_run_can_estimate(run: Path) -> None:
    assert "pass@3" in roboeval("show", run, "--k", "3").out
    assert "4" in refused("show", run, "--k", "4")


def test_a_row_that_is_none_gets_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row())
    assert roboeval("evaluate", "a.jsonl", "--out", "run", cwd=tmp_path).status == 0
    (tmp_path / "run" / "evaluations" / "paper.jsonl").write_text('{"task": "SayGoodDay"}\n')
    expected = "run/evaluations/paper.jsonl, line 1: this line is no row of an evaluation; --redo starts over"
    assert refused("show", "run", cwd=tmp_path) == expected
    assert refused("evaluate", "run", cwd=tmp_path) == expected


def test_export_writes_a_row_for_each_completion_and_world(run: Path) -> None:
    assert roboeval("export", run).status == 0
    rows = list(csv.DictReader((run / "evaluations" / "paper.csv").read_text().splitlines()))
    assert len(rows) == 3 * 4
    assert {row["status"] for row in rows} == {"finished", "robot-error"}
    assert roboeval("export", run, "--format", "parquet", "--out", run / "t.parquet").status == 0
    assert (run / "t.parquet").read_bytes().startswith(b"PAR1")


def test_an_evaluation_goes_on_without_judging_again(run: Path) -> None:
    before = (run / "evaluations" / "paper.jsonl").read_bytes()
    ended = roboeval("evaluate", run)
    assert ended.status == 0
    assert (run / "evaluations" / "paper.jsonl").read_bytes() == before


def test_ablation_names_the_tasks_that_have_none(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(row() + row(task="LunchTime"))
    ended = roboeval("evaluate", "a.jsonl", "--ablation", "--out", "run", cwd=tmp_path)
    assert ended.status == 0
    assert "without ablation, and so not judged: ElevatorTour, " in ended.err
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
    assert refused("tasks", "Nonsense").startswith('the suite "paper" has no task "Nonsense"')


def test_help_costs_little() -> None:
    script = (
        "import resource, subprocess, sys\n"
        "subprocess.run([sys.executable, '-m', 'roboeval.cli', '--help'], check=True, stdout=-3)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(used.ru_utime + used.ru_stime)\n"
    )
    best = min(
        float(
            subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
        )
        for _ in range(3)
    )
    bare = "import sys, typer; print('pydantic' in sys.modules or 'yaml' in sys.modules)"
    assert best < 3.0  # a figure for machines far slower than ours; what it costs here stands in the benches
    assert subprocess.run(
        [sys.executable, "-c", bare], capture_output=True, text=True, check=True
    ).stdout == ("False\n")
