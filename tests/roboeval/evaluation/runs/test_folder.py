"""A run survives interruptions, refuses changed files, and gives the same bytes each time."""

import hashlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from typer.testing import CliRunner

from codebotler.core.errors import UserError
from codebotler.core.files import read_rows, to_line
from forked import Forked
from roboeval.cli.app import app
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.judging.time_limit import TimeLimitExceeded, time_limit
from roboeval.evaluation.runs.completions import Completion, read_completions
from roboeval.evaluation.runs.folder import RunFolder, tasks_to_judge
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.source import open_source, recorded_completions
from roboeval.suites.load import Suite, load_suite
from seals import unseal

GREETS = 'def task_program():\n    say("good day")\n'
ADDRESS = "def task_program():\n    say(str(object()))\n    say(str(id([])))\n    say(str({'a', 'b', 'c'}))\n"


def make_run(path: Path, programs: list[str], task: str = "SayGoodDay") -> RunFolder:
    path.mkdir(parents=True)
    rows = [
        {"task": task, "prompt": 0, "index": index, "program": program}
        for index, program in enumerate(programs)
    ]
    run = RunFolder(path)
    run.completions.write_bytes(b"".join(map(to_line, rows)))
    return run


def judge_run(run: RunFolder, suite: Suite, *, redo: bool = False) -> list[Row]:
    return list(evaluate_run(run, suite, ablated=False, tasks=None, redo=redo, workers=2))


def careful_run(path: Path, suite: Suite) -> RunFolder:
    run = RunFolder(path)
    run.import_completions([*recorded_completions("recorded:careful", suite)])
    return run


def test_an_evaluation_has_the_documented_files_and_rows(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS, "go_to('nowhere')\n"])
    judge_run(run, paper)
    about = json.loads(run.manifest("paper").read_text())
    assert about["suite"] == "paper"
    assert about["digest"] == paper.digest
    assert about["rules"]["literals"] == "lowercase"
    rows = [row for _, row in read_rows(run.rows("paper"))]
    assert rows[0] == {
        "task": "SayGoodDay",
        "prompt": 0,
        "index": 0,
        "program_sha256": hashlib.sha256(GREETS.encode()).hexdigest(),
        "passed": False,
        "failure": {
            "class": "TaskCompletionError",
            "kind": "ExhaustiveSearch",
            "world": 0,
            "check": "visits_every_lab",
        },
        "verdicts": rows[0]["verdicts"],
    }
    assert rows[1]["failure"] == {
        "class": "RobotExecutionError",
        "kind": "GoToInvalidLocation",
        "world": 0,
        "check": None,
    }
    assert rows[1]["verdicts"][0] == {
        "world": "sam and amy are both in",
        "satisfied": False,
        "status": "robot-error",
        "error": {"kind": "GoToInvalidLocation", "message": 'there is no room "nowhere"'},
        "line": 1,
        "failed_checks": [],
        "trace": [["goto", "nowhere"]],
        "places": [[1, "start_loc"]],
        "destinations": [[1, None]],
    }


@pytest.mark.slow
def test_workers_and_processes_do_not_change_the_bytes(tmp_path: Path) -> None:
    programs = [
        ADDRESS,
        *[f"{GREETS}\n# {n}\n" + "x = [0] * " + str(n * 1000) for n in range(20)],
        ADDRESS + "#",
    ]
    results = []
    for workers in (1, 4):
        run = make_run(tmp_path / f"run{workers}", programs)
        script = (
            "import sys, pathlib\n"
            "from roboeval.evaluation.evaluate import evaluate_run\n"
            "from roboeval.evaluation.runs.folder import RunFolder\n"
            "from roboeval.suites.load import load_suite\n"
            f"run = RunFolder(pathlib.Path({str(run.path)!r}))\n"
            "for row in evaluate_run(run, load_suite(), ablated=False, tasks=None, redo=False, "
            f"workers={workers}): pass\n"
        )
        subprocess.run([sys.executable, "-c", script], check=True)
        results.append(run.rows("paper").read_bytes())
    assert results[0] == results[1]
    said = [event[1] for event in json.loads(results[0].splitlines()[0])["verdicts"][0]["trace"]]
    assert said[0].startswith("<object object at 0x")


@pytest.mark.slow
def test_kill_minus_nine_neither_loses_nor_repeats_rows(tmp_path: Path, paper: Suite) -> None:
    whole = careful_run(tmp_path / "whole", paper)
    judge_run(whole, paper)
    run = careful_run(tmp_path / "killed", paper)
    script = (
        "import pathlib\n"
        "from roboeval.evaluation.evaluate import evaluate_run\n"
        "from roboeval.evaluation.runs.folder import RunFolder\n"
        "from roboeval.suites.load import load_suite\n"
        f"run = RunFolder(pathlib.Path({str(run.path)!r}))\n"
        "print('on', flush=True)\n"
        "for row in evaluate_run(run, load_suite(), ablated=False, tasks=None, redo=False, workers=2): pass\n"
    )
    chance = random.Random(7)
    kills = 0
    for _ in range(6):
        process = Forked("-c", script, cwd=tmp_path, environment=os.environ)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(chance.uniform(0.1, 1.2))
        process.kill()
        kills += process.wait() == -signal.SIGKILL
        process.communicate()
    assert kills >= 3
    rows = judge_run(run, paper)
    assert run.rows("paper").read_bytes() == whole.rows("paper").read_bytes()
    assert run.manifest("paper").read_bytes() == whole.manifest("paper").read_bytes()
    assert len(rows) == sum(1 for _ in read_completions(run.completions))


@pytest.mark.parametrize("cut", [1, 10, 200])
def test_a_torn_last_row_is_judged_again(tmp_path: Path, paper: Suite, cut: int) -> None:
    run = make_run(tmp_path / "run", [GREETS, GREETS + "#1", GREETS + "#2"])
    judge_run(run, paper)
    whole = run.rows("paper").read_bytes()
    run.rows("paper").write_bytes(whole[:-cut])
    unseal(run.path)
    judge_run(run, paper)
    assert run.rows("paper").read_bytes() == whole


def test_a_program_that_was_changed_is_refused_unless_all_is_redone(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS, GREETS + "#1", GREETS + "#2"])
    judge_run(run, paper)
    kept = run.completions.read_bytes()
    run.completions.write_bytes(kept.replace(b"#1", b"#one"))
    before = run.rows("paper").read_bytes()
    with pytest.raises(UserError, match=r"SayGoodDay/0/1 .* --redo") as error:
        judge_run(run, paper)
    assert (error.value.file, error.value.line) == (run.rows("paper"), 2)
    assert run.rows("paper").read_bytes() == before
    run.completions.write_bytes(kept)
    assert len(judge_run(run, paper)) == 3
    run.completions.write_bytes(kept.replace(b"#1", b"#one"))
    judge_run(run, paper, redo=True)
    assert len(judge_run(run, paper)) == 3


def test_a_program_that_changes_before_it_is_judged_is_refused_later(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [f"{GREETS}# {n:03}" for n in range(300)])
    kept = run.completions.read_bytes()
    rows = evaluate_run(run, paper, ablated=False, tasks=None, redo=False, workers=1)
    next(rows)
    run.completions.write_bytes(kept.replace(b"# 299", b"# abc"))
    assert len(list(rows)) == 299
    with pytest.raises(UserError, match="SayGoodDay/0/299 "):
        judge_run(run, paper)
    run.completions.write_bytes(kept)
    assert len(judge_run(run, paper)) == 300


def test_a_finished_evaluation_runs_nothing_again(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    judge_run(run, paper)
    before = run.rows("paper").stat().st_mtime_ns
    assert len(judge_run(run, paper)) == 1
    assert run.rows("paper").stat().st_mtime_ns == before


def test_completions_added_later_are_judged(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    judge_run(run, paper)
    with run.completions.open("ab") as file:
        file.write(to_line({"task": "SayGoodDay", "prompt": 1, "index": 0, "program": GREETS}))
    assert [row["prompt"] for row in judge_run(run, paper)] == [0, 1]


@pytest.mark.slow
def test_a_run_that_another_process_writes_is_refused(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    script = (
        "import pathlib, sys, time\n"
        "from roboeval.evaluation.runs.folder import RunFolder\n"
        f"with RunFolder(pathlib.Path({str(run.path)!r})).writing():\n"
        "    print('on', flush=True)\n"
        "    sys.stdin.read()\n"
    )
    with Forked("-c", script, cwd=tmp_path, environment=os.environ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(UserError, match="another process"):
            judge_run(run, paper)
        process.kill()
    assert len(judge_run(run, paper)) == 1


@pytest.mark.parametrize(
    ("name", "value", "what"),
    [
        ("digest", "0" * 64, '"digest" was'),
        ("python", "2.7", '"python" was "2.7" and is now "3.'),
        ("codebotler", "0.0.1", '"codebotler" was "0.0.1" and is now '),
        ("ablation", True, '"ablation" was true and is now false'),
    ],
)
def test_an_evaluation_by_other_versions_is_refused_unless_redone(
    tmp_path: Path, paper: Suite, name: str, value: object, what: str
) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    judge_run(run, paper)
    about = json.loads(run.manifest("paper").read_text())
    run.manifest("paper").write_text(json.dumps(about | {name: value}))
    with pytest.raises(UserError, match=rf"{re.escape(what)}.* --redo"):
        judge_run(run, paper)
    assert len(judge_run(run, paper, redo=True)) == 1
    assert json.loads(run.manifest("paper").read_text()) == about


def test_a_source_reads_only_the_named_tasks(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    with run.completions.open("ab") as file:
        file.write(to_line({"task": "LunchTime", "prompt": 0, "index": 0, "program": GREETS}))
    source = open_source(str(run.path), paper)
    assert [c.task for c in source.of(frozenset({"LunchTime"}))] == ["LunchTime"]
    assert [c.task for c in source.of(None)] == ["SayGoodDay", "LunchTime"]


def test_rows_of_other_completions_are_refused(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS, GREETS + "#"])
    judge_run(run, paper)
    rows = run.completions.read_bytes().splitlines(keepends=True)
    run.completions.write_bytes(rows[1] + rows[0])  # The order does not matter.
    assert len(judge_run(run, paper)) == 2
    run.completions.write_bytes(rows[0])
    with pytest.raises(UserError, match="SayGoodDay/0/1"):
        judge_run(run, paper)


def test_rows_that_judge_a_completion_again_are_refused(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    judge_run(run, paper)
    path = run.rows("paper")
    path.write_bytes(2 * path.read_bytes())
    with pytest.raises(UserError, match="an earlier row judges") as error:
        judge_run(run, paper)
    assert (error.value.file, error.value.line) == (path, 2)


def test_further_tasks_are_added_to_an_evaluation(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS, GREETS + "#"])
    other = to_line({"task": "LunchTime", "prompt": 0, "index": 0, "program": GREETS})
    first, second = run.completions.read_bytes().splitlines(keepends=True)
    run.completions.write_bytes(first + other + second)

    def judge_tasks(*tasks: str) -> list[str]:
        rows = evaluate_run(run, paper, ablated=False, tasks=frozenset(tasks) or None, redo=False)
        return [row["task"] for row in rows]

    assert judge_tasks("SayGoodDay") == ["SayGoodDay"] * 2
    before = run.rows("paper").read_bytes()
    assert judge_tasks("LunchTime", "SayGoodDay") == ["SayGoodDay", "SayGoodDay", "LunchTime"]
    assert run.rows("paper").read_bytes().startswith(before)
    whole = run.rows("paper").read_bytes(), run.manifest("paper").read_bytes()
    assert json.loads(whole[1])["tasks"] == ["LunchTime", "SayGoodDay"]
    assert judge_tasks("LunchTime") == ["LunchTime"]
    assert (run.rows("paper").read_bytes(), run.manifest("paper").read_bytes()) == whole
    assert len(judge_tasks()) == 3
    assert json.loads(run.manifest("paper").read_text())["tasks"] is None


def test_other_completions_are_not_overwritten(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    before = run.completions.read_bytes()
    with pytest.raises(UserError, match="different completions"):
        careful_run(run.path, paper)
    assert run.completions.read_bytes() == before


@pytest.mark.parametrize("more", [GREETS, None])
def test_more_or_fewer_completions_are_others(tmp_path: Path, paper: Suite, more: str | None) -> None:
    run = make_run(tmp_path / "run", [GREETS, "#"])
    other = make_run(tmp_path / "other", [GREETS, "#", more] if more else [GREETS])
    with pytest.raises(UserError, match="different completions"):
        run.import_completions(open_source(str(other.path), paper).completions)
    run.import_completions(open_source(str(run.path), paper).completions)


def test_an_interrupted_copy_leaves_no_run(tmp_path: Path) -> None:
    class Interrupted(list[Completion]):
        times = 0

        def __iter__(self) -> Iterator[Completion]:
            yield from super().__iter__()
            self.times += 1
            if self.times > 1:
                raise KeyboardInterrupt

    (tmp_path / "there").mkdir()
    for path in (tmp_path / "there" / "run", tmp_path / "new" / "run", tmp_path / "there"):
        one = Completion(task="SayGoodDay", prompt=0, index=0, program=GREETS)
        with pytest.raises(KeyboardInterrupt):
            RunFolder(path).import_completions(Interrupted([one]))
    assert sorted(path.name for path in tmp_path.rglob("*")) == [".lock", "there"]


def test_a_source_can_be_a_run_a_file_a_folder_or_a_recorded_model(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS])
    assert open_source(str(run.path), paper).run == run
    assert open_source(str(run.completions), paper).run is None
    folder = tmp_path / "published"
    folder.mkdir()
    (folder / "SayGoodDay_0_3.py").write_text(f"name = 'x'\nprompt = 'p'\ncompletion = {GREETS!r}\n")
    assert [c.key for c in open_source(str(folder), paper).completions] == [("SayGoodDay", 0, 3)]
    assert len(open_source("recorded:hasty", paper).completions) >= 160
    with pytest.raises(UserError, match="does not exist") as error:
        open_source(str(tmp_path / "nothing"), paper)
    assert str(error.value.file) == str(tmp_path / "nothing")


def test_only_tasks_with_an_ablation_are_ablated(paper: Suite) -> None:
    kept, left = tasks_to_judge(paper, "LunchTime,SayGoodDay", ablated=True)
    assert kept == frozenset({"LunchTime"})
    assert left == ("SayGoodDay",)
    with pytest.raises(UserError, match=r"SayGoodDay .* ablation"):
        tasks_to_judge(paper, "SayGoodDay", ablated=True)
    with pytest.raises(UserError, match='"Nonsense"'):
        tasks_to_judge(paper, "Nonsense", ablated=False)


@pytest.mark.slow
def test_a_full_disk_leaves_only_whole_rows(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", [GREETS, GREETS + "#"])
    script = (
        "import pathlib, resource, signal\n"
        "from roboeval.evaluation.evaluate import evaluate_run\n"
        "from roboeval.evaluation.runs.folder import RunFolder\n"
        "from roboeval.suites.load import load_suite\n"
        f"run = RunFolder(pathlib.Path({str(run.path)!r}))\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "rows = evaluate_run(run, load_suite(), ablated=False, tasks=None, redo=False, workers=1)\n"
        "next(rows)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))\n"
        "list(rows)\n"
    )
    with Forked("-c", script, cwd=tmp_path, environment=os.environ) as ended:
        _, err = ended.communicate()
    assert ended.returncode == 1
    assert "File too large" in err
    assert run.rows("paper").read_bytes().endswith(b"\n")
    assert len(judge_run(run, paper)) == 2


def test_a_completion_keeps_fields_of_other_tools(tmp_path: Path, paper: Suite) -> None:
    row = {"task": "SayGoodDay", "prompt": 0, "index": 0, "program": GREETS, "usage": {"output": 7}}
    path = tmp_path / "rows.jsonl"
    path.write_bytes(to_line(row))
    run = RunFolder(tmp_path / "run")
    run.import_completions(open_source(str(path), paper).completions)
    assert [c.row for c in read_completions(run.completions)] == [row]
    assert Completion.of(row).key == ("SayGoodDay", 0, 0)


def test_rows_without_their_manifest_are_refused(tmp_path: Path, paper: Suite) -> None:
    run = make_run(tmp_path / "run", ["def task_program(): pass\n"])
    judge_run(run, paper)
    run.manifest("paper").unlink()
    with pytest.raises(UserError, match="--redo") as error:
        judge_run(run, paper)
    assert error.value.file == run.manifest("paper")


def test_a_completion_that_takes_too_long_is_skipped_and_retried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "suite" / "tasks").mkdir(parents=True)
    (tmp_path / "suite" / "suite.yaml").write_text("name: slow\nversion: 1\n")
    (tmp_path / "suite" / "tasks" / "Slow.yaml").write_text(
        "name: Slow\nsummary: Speak.\nprompts: [Speak.]\n"
        "checks: {speaks: {category: SayAtLocation, rtl: 'tr.Exists(say(\"^(a+)+b\"))'}}\n"
        "worlds: [{about: a, robot: hall, rooms: [hall], require: [speaks]}]\n"
    )
    suite = load_suite(str(tmp_path / "suite"))
    slow, quick = (f"def task_program(): say({'a' * n!r})\n" for n in (22, 3))
    run = make_run(tmp_path / "run", [slow, quick, slow, quick], "Slow")

    monkeypatch.setattr("roboeval.evaluation.judging.judge.BUDGET", 0.001)
    assert [row["index"] for row in judge_run(run, suite)] == [1, 3]
    assert [
        record.getMessage().split()[0]
        for record in caplog.records
        if record.name == "roboeval.evaluation.judging.judge"
    ] == ["Slow/0/0", "Slow/0/2"]
    result = CliRunner().invoke(app, ["evaluate", str(run.path), "--suite", str(tmp_path / "suite")])
    assert result.exit_code == 1

    monkeypatch.undo()
    assert [row["index"] for row in judge_run(run, suite)] == [1, 3, 0, 2]
    assert [row["index"] for row in judge_run(run, suite)] == [1, 3, 0, 2]


def test_the_time_limit_applies_only_to_the_main_thread() -> None:
    def work() -> bool:
        with time_limit(0.01):
            return sum(range(100_000)) > 0

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(work).result()
    with pytest.raises(TimeLimitExceeded), time_limit(0.01):
        re.search("(a+)+b", "a" * 26)
