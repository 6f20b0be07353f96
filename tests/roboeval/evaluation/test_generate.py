"""A run gets exactly the requested completions, each once, despite failures and interruptions."""

import json
import os
import random
import re
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import Appender, read_rows, to_line
from codebotler.models.base import ModelError
from codebotler.models.sampling import SamplingSettings
from forked import Forked
from roboeval.evaluation.generating.generate import GenerationProgress, Pace, generate_run
from roboeval.evaluation.generating.requests import GenerationPlan, RequestLog
from roboeval.evaluation.runs.completions import read_completions
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.load import Suite
from scripted_model import Scripted

SMALL = frozenset({"LunchTime", "SayGoodDay"})
CUT = ModelError("the connection was cut", is_temporary=True)
REFUSED = ModelError("the key in SCRIPTED_API_KEY is refused", is_temporary=False)


def generate(
    run: RunFolder,
    suite: Suite,
    model: Scripted,
    *,
    count: int = 3,
    pace: Pace | None = None,
    on_progress: Callable[[GenerationProgress], None] = lambda _: None,
) -> GenerationProgress:
    plan = GenerationPlan(suite, SMALL, count)
    return generate_run(run, plan, model, pace or Pace(), on_progress=on_progress)


def rows(run: RunFolder) -> list[dict[str, Any]]:
    return [row for _, row in read_rows(run.completions)]


def keys(run: RunFolder) -> list[tuple[str, int, int]]:
    return sorted((row["task"], row["prompt"], row["index"]) for row in rows(run))


def expected(count: int) -> list[tuple[str, int, int]]:
    return sorted((task, prompt, index) for task in SMALL for prompt in range(5) for index in range(count))


def about(run: RunFolder) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(run.about.read_text())
    return data


def test_a_run_has_the_documented_files_and_rows(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "runs" / "one")
    sent = SamplingSettings(temperature=0.7, seed=5, base_url="http://a/v1")
    model = Scripted(settings=sent)
    progress = generate(run, paper, model)
    assert (progress.done, progress.total, progress.missing, progress.interrupted) == (30, 30, None, 0)
    assert model.closed
    assert keys(run) == expected(3)
    row = next(row for row in rows(run) if (row["task"], row["prompt"], row["index"]) == ("LunchTime", 4, 2))
    assert row == {
        "task": "LunchTime",
        "prompt": 4,
        "index": 2,
        "instruction": paper.tasks["LunchTime"].prompts[4],
        "model": "scripted:one",
        "program": 'def task_program():\n    say("2")\n',
        "no_program": None,
        "finish_reason": "stop",
        "usage": {"input_tokens": 100, "output_tokens": 10, "reasoning_tokens": None},
        "latency_s": 0.0,
        "raw_reply": 'def task_program():\n    say("2")\n',
        "reasoning": "",
    }
    metadata = about(run)
    assert metadata["model"] == "scripted:one"
    assert metadata["settings"] == {"temperature": 0.7, "top_p": 0.95, "max_tokens": None, "seed": 5}
    [batch] = metadata["batches"]
    assert (batch["tasks"], batch["num_completions"]) == (sorted(SMALL), 3)
    assert batch["settings"] == asdict(sent)
    assert re.fullmatch("[0-9a-f]{64}", metadata["template"])
    assert batch["started"]
    assert metadata["possibly_paid_twice"] == 0
    assert sorted(path.name for path in run.path.iterdir()) == [".lock", "completions.jsonl", "run.json"]


def test_first_completions_of_all_prompts_come_first(tmp_path: Path, paper: Suite) -> None:
    model = Scripted()
    generate(RunFolder(tmp_path / "run"), paper, model, count=2, pace=Pace(concurrency=1))
    assert [number for _, number in model.asked] == [0] * 10 + [1] * 10


def test_a_completed_run_requests_nothing_and_stays_the_same(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted())
    before = run.completions.read_bytes(), run.about.read_bytes()
    model = Scripted()
    assert generate(run, paper, model).found == 30
    assert model.asked == []
    assert (run.completions.read_bytes(), run.about.read_bytes()) == before


def test_a_run_can_grow_but_not_shrink(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted(), count=1)
    model = Scripted()
    progress = generate(run, paper, model, count=3)
    assert (progress.found, len(model.asked)) == (10, 20)
    assert keys(run) == expected(3)
    assert generate(run, paper, Scripted(), count=2).missing is None
    assert keys(run) == expected(3)


def test_each_batch_of_requests_keeps_its_settings(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    first, second = (SamplingSettings(timeout=seconds) for seconds in (5.0, 6.0))
    generate_run(run, GenerationPlan(paper, frozenset({"LunchTime"}), 2), Scripted(settings=first), Pace())
    model = Scripted(settings=second)
    generate_run(run, GenerationPlan(paper, SMALL, 2), model, Pace())
    assert len(model.asked) == 10
    before = run.about.read_bytes()
    generate_run(run, GenerationPlan(paper, frozenset({"SayGoodDay"}), 1), Scripted(settings=first), Pace())
    assert run.about.read_bytes() == before  # It requested nothing.
    batches = about(run)["batches"]
    assert [(one["tasks"], one["settings"]["timeout"]) for one in batches] == [
        (["LunchTime"], 5.0),
        (sorted(SMALL), 6.0),
    ]


def test_concurrency_limits_simultaneous_requests(tmp_path: Path, paper: Suite) -> None:
    model = Scripted(seconds=0.002)
    generate(RunFolder(tmp_path / "run"), paper, model, count=5, pace=Pace(concurrency=3))
    assert model.most == 3


def test_each_completion_is_in_the_file_before_it_counts(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    done: list[int] = []

    def count(progress: GenerationProgress) -> None:
        done.append(progress.done)
        assert len(rows(run)) >= progress.done

    generate(run, paper, Scripted(seconds=0.001), on_progress=count)
    assert done == list(range(31))


def test_a_completion_counts_only_after_its_sync(
    tmp_path: Path, paper: Suite, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = RunFolder(tmp_path / "run")
    on_disk = [0]
    sync = Appender.sync

    def note_sync(file: Appender) -> None:
        lines = file.path.read_bytes().count(b"\n")
        sync(file)
        if file.path == run.completions:
            on_disk[0] = max(on_disk[0], lines)

    def check(progress: GenerationProgress) -> None:
        assert on_disk[0] >= progress.done

    monkeypatch.setattr(Appender, "sync", note_sync)
    assert generate(run, paper, Scripted(seconds=0.001), on_progress=check).missing is None


# --- continuing a run


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        (SamplingSettings(temperature=0.7), "temperature (0.2, now 0.7)"),
        (SamplingSettings(top_p=0.5), "top-p (0.95, now 0.5)"),
        (SamplingSettings(max_tokens=100), "max-tokens (none, now 100)"),
        (SamplingSettings(seed=1), "seed (none, now 1)"),
    ],
)
def test_other_settings_are_refused(
    tmp_path: Path, paper: Suite, settings: SamplingSettings, what: str
) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted())
    before = run.completions.read_bytes(), run.about.read_bytes()
    with pytest.raises(UserError, match=re.escape(what)) as error:
        generate(run, paper, Scripted(settings=settings))
    assert error.value.file == run.about
    assert (run.completions.read_bytes(), run.about.read_bytes()) == before


def test_another_model_or_template_is_refused(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted())
    with pytest.raises(UserError, match=r"\(scripted:one, now scripted:two\)"):
        generate(run, paper, Scripted(name="scripted:two"))
    run.about.write_text(json.dumps(about(run) | {"template": "0" * 64}))
    with pytest.raises(UserError, match=r"template \(0{23}…, now "):
        generate(run, paper, Scripted())


def test_another_timeout_or_address_is_accepted(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted(), count=1)
    moved = SamplingSettings(timeout=5, base_url="http://other/v1")
    generate(run, paper, Scripted(settings=moved), count=2)
    assert keys(run) == expected(2)


def test_a_run_of_other_completions_is_refused(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    run.path.mkdir()
    run.completions.write_bytes(to_line({"task": "LunchTime", "prompt": 0, "index": 0, "program": ""}))
    with pytest.raises(UserError, match="missing") as error:
        generate(run, paper, Scripted())
    assert error.value.file == run.about
    run.about.write_text('{"model": null}')
    with pytest.raises(UserError, match="imported"):
        generate(run, paper, Scripted())


def test_completions_of_another_instruction_are_refused(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted())
    first, *others = rows(run)
    changed = [first | {"instruction": "Do something else."}, *others]
    run.completions.write_bytes(b"".join(map(to_line, changed)))
    with pytest.raises(UserError, match=r"/0/0 .* instruction"):
        generate(run, paper, Scripted())


def test_a_run_that_another_process_writes_is_refused(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    with run.writing(), pytest.raises(UserError, match="another process"):
        generate(run, paper, Scripted())


# --- failures


@pytest.mark.parametrize("cut", [1, 10, 200])
def test_a_torn_last_line_is_requested_again(tmp_path: Path, paper: Suite, cut: int) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted())
    run.completions.write_bytes(run.completions.read_bytes()[:-cut])
    model = Scripted()
    generate(run, paper, model)
    assert len(model.asked) == 1
    assert keys(run) == expected(3)


def test_failed_requests_are_missing_and_repeated_later(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    refusing = Scripted(fails=lambda number: REFUSED if number in {3, 7} else None)
    progress = generate(run, paper, refusing, pace=Pace(concurrency=1))
    assert progress.missing is not None
    assert progress.missing.startswith("2 completions ")
    assert "SCRIPTED_API_KEY" in progress.missing
    model = Scripted()
    assert generate(run, paper, model).missing is None
    assert (len(model.asked), keys(run)) == (2, expected(3))
    assert len(about(run)["batches"]) == 1
    assert about(run)["possibly_paid_twice"] == 0


REFUSAL = ModelError("the server answered with status 400 (no)", is_temporary=False, is_refusal=True)


def test_refused_prompt_is_a_completion_without_a_program(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    model = Scripted(fails=lambda number: REFUSAL if number in {0, 5, 29} else None)
    progress = generate(run, paper, model, pace=Pace(concurrency=1))
    assert (progress.done, progress.missing, keys(run)) == (30, None, expected(3))
    refused = [row for row in rows(run) if row["no_program"] == "refusal"]
    assert [(row["program"], row["raw_reply"]) for row in refused] == [("", REFUSAL.sentence)] * 3


def test_refusals_of_every_prompt_are_an_error(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    with pytest.raises(ModelError, match="400"):
        generate(run, paper, Scripted(fails=lambda _: REFUSAL), pace=Pace(concurrency=1))
    assert not run.completions.exists()


def test_refusals_in_a_row_stop_a_run_and_are_not_kept(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    model = Scripted(fails=lambda number: REFUSAL if number >= 10 else None)  # No credit is left.
    progress = generate(run, paper, model, pace=Pace(concurrency=1))
    assert progress.stopped is not None
    assert progress.missing is not None
    assert [row["no_program"] for row in rows(run)] == [None] * 10


def test_occasional_failures_do_not_stop_a_run(tmp_path: Path, paper: Suite) -> None:
    model = Scripted(fails=lambda number: REFUSED if number % 3 else None)
    progress = generate(RunFolder(tmp_path / "run"), paper, model, pace=Pace(concurrency=1))
    assert (len(model.asked), progress.done, progress.stopped) == (30, 10, None)


@pytest.mark.parametrize(("concurrency", "most"), [(1, 3), (8, 15)])
def test_a_model_that_always_fails_stops_a_run_without_files(
    tmp_path: Path, paper: Suite, concurrency: int, most: int
) -> None:
    model = Scripted(fails=lambda _: REFUSED)
    with pytest.raises(ModelError, match="SCRIPTED_API_KEY"):
        generate(RunFolder(tmp_path / "runs" / "run"), paper, model, pace=Pace(concurrency))
    assert len(model.asked) <= most
    assert list(tmp_path.iterdir()) == []
    assert model.closed


def test_a_reply_that_is_too_long_is_a_failure(tmp_path: Path, paper: Suite) -> None:
    with pytest.raises(ModelError, match=r"has 6,0\d\d,\d\d\d bytes; the limit is"):
        generate(RunFolder(tmp_path / "run"), paper, Scripted(text="#" * 3_000_000), pace=Pace(1))


def test_a_token_budget_stops_cleanly_and_a_second_one_continues(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    progress = generate(run, paper, Scripted(), pace=Pace(concurrency=1, token_budget=1000))
    assert progress.done == 10
    assert progress.missing is not None
    assert re.match(r"20 completions .*\btoken budget of 1,000\b", progress.missing)
    assert len(rows(run)) == 10
    assert not run.in_flight.exists()
    progress = generate(run, paper, Scripted(), pace=Pace(concurrency=1, token_budget=1000))
    assert (progress.found, progress.done, progress.interrupted) == (10, 20, 0)
    generate(run, paper, Scripted())
    assert keys(run) == expected(3)


def test_a_token_budget_counts_pending_requests(tmp_path: Path, paper: Suite) -> None:
    pace = Pace(concurrency=4, token_budget=1000)
    progress = generate(RunFolder(tmp_path / "run"), paper, Scripted(seconds=0.001), pace=pace)
    assert f"{110 * progress.done:,} tokens were used" in (progress.missing or "")


def test_a_failed_request_is_not_pending_while_its_retry_waits(tmp_path: Path, paper: Suite) -> None:
    run = RunFolder(tmp_path / "run")
    notes: list[list[str]] = []

    def fails(number: int) -> ModelError | None:
        notes.append([next(iter(row)) for _, row in read_rows(run.in_flight)])
        return CUT if number == 0 else None

    generate(run, paper, Scripted(fails=fails), count=1, pace=Pace(concurrency=1))
    assert notes[:3] == [
        ["sent"],
        ["sent", "ended", "sent"],
        ["sent", "ended", "sent", "sent"],
    ]


@pytest.mark.slow
def test_4000_completions_although_one_request_in_ten_fails(tmp_path: Path, paper: Suite) -> None:
    chance = random.Random(3)
    run = RunFolder(tmp_path / "run")
    model = Scripted(fails=lambda _: CUT if chance.random() < 0.1 else None)
    progress = generate_run(run, GenerationPlan(paper), model, Pace(concurrency=100))
    assert (progress.done, progress.missing) == (4000, None)
    prompts = [(task.name, number) for task in paper.tasks.values() for number in range(len(task.prompts))]
    assert keys(run) == sorted((*prompt, index) for prompt in prompts for index in range(50))
    assert 4300 < len(model.asked) < 4600
    assert about(run)["possibly_paid_twice"] == 0


SCRIPT = """
import pathlib, sys
sys.path.insert(0, {tests!r})
from codebotler.models.sampling import SamplingSettings
from roboeval.evaluation.generating.generate import Pace, generate_run
from roboeval.evaluation.generating.requests import GenerationPlan
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.load import load_suite
from scripted_model import Scripted
print("on", flush=True)
{before}
generate_run(
    RunFolder(pathlib.Path({run!r})), GenerationPlan(load_suite(), {tasks!r}, {count}),
    Scripted(seconds={seconds}, log=pathlib.Path({log!r})), Pace(concurrency=5),
)
"""


def start_process(
    run: RunFolder, log: Path, *, count: int, seconds: float = 0.01, before: str = ""
) -> Forked:
    script = SCRIPT.format(
        tests=str(Path(__file__).parents[1]),
        run=str(run.path),
        log=str(log),
        tasks=SMALL,
        count=count,
        seconds=seconds,
        before=before,
    )
    process = Forked("-c", script, cwd=run.path.parent, environment=os.environ)
    assert process.stdout is not None
    process.stdout.readline()
    return process


def wait_for_notes(log: Path, count: int) -> None:
    """Wait until the model has noted so many events."""
    deadline = time.monotonic() + 30
    while (log.read_bytes().count(b"\n") if log.exists() else 0) < count:
        assert time.monotonic() < deadline
        time.sleep(0.002)


def asked_of(log: Path, pid: int, suite: Suite) -> set[tuple[str, int, int]]:
    """Return the completions that a process requested according to the model's log."""
    prompts = {
        instruction: (task.name, number)
        for task in suite.tasks.values()
        for number, instruction in enumerate(task.prompts)
    }
    noted = log.read_bytes() if log.exists() else b""
    if noted and not noted.endswith(b"\n"):  # A kill tears a line at the end of a memory page.
        os.truncate(log, noted.rfind(b"\n") + 1)
    notes = [json.loads(line) for line in noted.splitlines(keepends=True) if line.endswith(b"\n")]
    return {(*prompts[prompt], index) for what, prompt, index, by in notes if what == "asked" and by == pid}


@pytest.mark.slow
def test_kill_minus_nine_loses_only_pending_requests(tmp_path: Path, paper: Suite) -> None:
    run, log = RunFolder(tmp_path / "run"), tmp_path / "log"
    chance = random.Random(5)
    lost: Counter[tuple[str, int, int]] = Counter()
    kills = 0
    for _ in range(5):
        notes = log.read_bytes().count(b"\n") if log.exists() else 0
        process = start_process(run, log, count=60)
        wait_for_notes(log, notes + chance.randint(10, 100))
        time.sleep(chance.uniform(0, 0.01))
        process.kill()
        kills += process.wait() == -signal.SIGKILL
        process.communicate()
        done = {completion.key for completion in read_completions(run.completions, growing=True)}
        under_way = asked_of(log, process.pid, paper) - done
        assert len(under_way) <= 5
        # A request is noted before it is sent, so the count may include requests that never arrived.
        assert len(under_way) <= RequestLog(run.in_flight, done).interrupted <= 5
        lost.update(under_way)
    assert kills == 5
    generate(run, paper, Scripted(), count=60)
    assert Counter(keys(run)) == Counter(expected(60))
    assert 0 < sum(lost.values()) <= about(run)["possibly_paid_twice"] <= sum(lost.values()) + kills
    lines = map(json.loads, log.read_text().splitlines())
    asked = Counter((prompt, index) for what, prompt, index, _ in lines if what == "asked")
    assert sum(n - 1 for n in asked.values()) <= about(run)["possibly_paid_twice"]


@pytest.mark.slow
def test_ctrl_c_keeps_completions_and_counts_pending_requests(tmp_path: Path, paper: Suite) -> None:
    run, log = RunFolder(tmp_path / "run"), tmp_path / "log"
    process = start_process(run, log, count=60, seconds=0.05)
    wait_for_notes(log, 50)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in err
    done = set(keys(run))
    under_way = asked_of(log, process.pid, paper) - done
    assert 0 < len(under_way) <= 5
    progress = generate(run, paper, Scripted(), count=60)
    assert progress.interrupted == len(under_way)
    assert about(run)["possibly_paid_twice"] == len(under_way)
    assert Counter(keys(run)) == Counter(expected(60))
    assert not run.in_flight.exists()


def test_an_interruption_counts_completions_that_wait_for_a_sync(
    tmp_path: Path, paper: Suite, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = RunFolder(tmp_path / "run")
    seen: list[GenerationProgress] = []
    sync, once = Appender.sync, threading.Lock()

    def interrupt_sync(file: Appender) -> None:
        late = file.path == run.completions and file.path.read_bytes().count(b"\n") > 10
        if late and once.acquire(blocking=False):  # Other threads sync too.
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)
        sync(file)

    monkeypatch.setattr(Appender, "sync", interrupt_sync)
    plan = GenerationPlan(paper, SMALL, 100)  # So many last until the interrupt.
    with pytest.raises(KeyboardInterrupt):
        generate_run(run, plan, Scripted(seconds=0.1), Pace(), on_progress=seen.append)
    progress = seen[0]
    assert progress.done == len(rows(run)) > 10


@pytest.mark.slow
def test_a_full_disk_leaves_whole_rows_and_stops_requests(tmp_path: Path, paper: Suite) -> None:
    run, log = RunFolder(tmp_path / "run"), tmp_path / "log"
    limit = (
        "import resource, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (9000, 9000))\n"
    )
    process = start_process(run, log, count=20, seconds=0.0, before=limit)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "OSError: [Errno 27] File too large" in err
    assert run.completions.read_bytes().endswith(b"}\n")
    done = set(keys(run))
    under_way = asked_of(log, process.pid, paper) - done
    assert len(under_way) <= 5
    progress = generate(run, paper, Scripted(), count=20)
    assert len(under_way) <= progress.interrupted <= 5
    assert Counter(keys(run)) == Counter(expected(20))


@pytest.mark.parametrize("line", ["{}", '{"sent": 3}', '{"sent": ["a", "b", 1]}'])
def test_a_damaged_request_log_is_refused(tmp_path: Path, paper: Suite, line: str) -> None:
    run = RunFolder(tmp_path / "run")
    generate(run, paper, Scripted())
    run.in_flight.write_text(f'{{"sent": ["A", 0, 0]}}\n{line}\n')
    with pytest.raises(UserError, match="request") as error:
        generate(run, paper, Scripted())
    assert (error.value.file, error.value.line) == (run.in_flight, 2)
