"""A snapshot of a run: its completions, filters, counts and state."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import to_line
from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.web.run_store import RunStore
from roboeval.web.serializers import RunState, state_of
from roboeval.web.snapshot import CompletionFilter, Snapshot
from seals import unseal


def open_snapshot(folder: Path) -> Snapshot:
    return RunStore(folder.parent).open(folder.name)


def read_lines(path: Path) -> list[bytes]:
    return path.read_bytes().splitlines(keepends=True)


def keys(frame: Any) -> list[Any]:  # noqa: ANN401 - a table has no types
    return frame.select("task", "prompt", "index").rows()  # type: ignore[no-any-return]  # columns of any type


def test_a_row_for_each_completion(runs: Path) -> None:
    run = open_snapshot(runs / "hasty")
    rows = [json.loads(line) for line in read_lines(RunFolder(runs / "hasty").rows("paper"))]
    assert run.completions.height == len(rows) == 45
    assert len(run.results.completions) == run.results.scope.total == run.judged == 45
    assert run.models == ["recorded:hasty"]
    assert state_of(run) is RunState.JUDGED
    for row in rows:
        shown = run.row(f"{row['task']}/{row['prompt']}/{row['index']}")
        assert shown is not None
        assert shown["passed"] is row["passed"]
        assert [sign == "+" for sign in shown["worlds"]] == [v["satisfied"] for v in row["verdicts"]]
        if row["failure"]:
            assert (shown["failure_class"], shown["failure_kind"]) == (
                row["failure"]["class"],
                row["failure"]["kind"],
            )
            error = row["verdicts"][row["failure"]["world"]]["error"]
            assert (row["failure"]["check"] or error["message"]) in shown["why"]
    assert sum(one.count for (_, kind), one in run.failures.items() if kind is None) == sum(
        not row["passed"] for row in rows
    )
    assert run.row("LunchBreak/0/99") is None


def test_a_limit_that_ended_a_program_is_named(runs: Path) -> None:
    rows = RunFolder(runs / "hasty").rows("paper")
    lines = [json.loads(line) for line in read_lines(rows)]
    at = next(n for n, row in enumerate(lines) if row["failure"] and row["failure"]["check"] is None)
    for message, why in (
        ("1,000 skill calls", "stopped after 1,000 skill calls (limit)"),
        ("it waits for ever", "it waits for ever"),
    ):
        for verdict in lines[at]["verdicts"]:
            verdict |= {"status": "timeout", "error": {"kind": "TimeoutError", "message": message}}
        rows.write_bytes(b"".join(map(to_line, lines)))
        unseal(runs / "hasty")
        assert open_snapshot(runs / "hasty").completions["why"][at] == why


def test_completions_without_a_verdict_are_included(runs: Path) -> None:
    run = RunFolder(runs / "hasty")
    completions, rows = read_lines(run.completions), read_lines(run.rows("paper"))
    unseal(run.path)
    run.rows("paper").write_bytes(b"".join(rows[:40]))
    seen = open_snapshot(run.path)
    assert (len(seen.results.completions), seen.judged, seen.completions.height) == (45, 40, 45)
    waiting = seen.completions.filter(seen.completions["passed"].is_null())
    assert sorted(keys(waiting)) == sorted(_key(line) for line in completions[40:])


def _key(line: bytes) -> tuple[str, int, int]:
    row = json.loads(line)
    return row["task"], row["prompt"], row["index"]


def test_a_program_changed_after_its_verdict_is_named(runs: Path) -> None:
    completions = RunFolder(runs / "hasty").completions
    lines = read_lines(completions)
    row = json.loads(lines[7])
    changed = to_line({**row, "program": "x = 1\n"})
    for content in ([*lines[:7], changed, *lines[8:]], [*lines[:7], *lines[8:]]):
        completions.write_bytes(b"".join(content))
        with pytest.raises(UserError, match="--redo") as caught:
            open_snapshot(runs / "hasty")
        assert (caught.value.file, caught.value.line) == ("paper.jsonl", 8)
        assert "/".join(map(str, _key(lines[7]))) in caught.value.sentence


def test_filters_apply_to_prompts_completions_and_neighbours(runs: Path) -> None:
    run = open_snapshot(runs / "hasty")
    cells = run.prompts(CompletionFilter(passed=True))
    assert [cell["task"] for cell in cells] == [
        task for task in ("LunchBreak", "SayGoodDay", "StaplerSupply") for _ in range(5)
    ]
    assert all((cell["written"], cell["judged"]) == (3, 3) for cell in cells)
    assert sum(cell["counted"] for cell in cells) == run.passed
    assert keys(run.select(CompletionFilter())) == keys(run.completions)
    assert {task for task, _, _ in keys(run.select(CompletionFilter("LunchBreak")))} == {"LunchBreak"}
    kinds = [(name, one) for (name, kind), one in run.failures.items() if kind is not None]
    for chosen, count in (
        (CompletionFilter("LunchBreak", 2), 3),
        (CompletionFilter(passed=False), 45 - run.passed),
        *((CompletionFilter(failure_class=name, failure_kind=kind.name), kind.count) for name, kind in kinds),
    ):
        found = keys(run.select(chosen))
        assert len(found) == count > 0
        for before, key, after in zip([None, *found], found, [*found[1:], None], strict=False):
            assert run.neighbours(key, chosen) == (before, after)
    assert run.neighbours(("LunchBreak", 9, 9), CompletionFilter()) == (None, None)


def test_a_reply_without_a_program_is_explained(runs: Path) -> None:
    rows = RunFolder(runs / "hasty").rows("paper")
    first, *others = [json.loads(line) for line in read_lines(rows)]
    first |= {"passed": False, "failure": {"class": "NoProgram", "kind": "empty", "world": 0, "check": None}}
    rows.write_bytes(b"".join(map(to_line, [first, *others])))
    unseal(runs / "hasty")
    run = open_snapshot(runs / "hasty")
    shown = run.row(f"{first['task']}/{first['prompt']}/{first['index']}")
    assert shown is not None
    assert (shown["why"], shown["worlds"]) == (NO_PROGRAM_SENTENCES["empty"], "")
    assert next(iter(run.failures)) == ("NoProgram", None)


def test_the_state_of_a_run(runs: Path) -> None:
    run = RunFolder(runs / "hasty")
    completions, rows = read_lines(run.completions), read_lines(run.rows("paper"))
    cases: list[tuple[int, int, bool, int | None, RunState]] = [
        (45, 0, True, 60, RunState.GENERATING),
        (0, 0, True, None, RunState.GENERATING),
        (45, 40, True, 45, RunState.JUDGING),
        (45, 45, True, 45, RunState.JUDGED),
        (0, 0, False, 45, RunState.EMPTY),
        (45, 0, False, 60, RunState.UNFINISHED),
        (45, 0, False, 45, RunState.NOT_JUDGED),
        (45, 40, False, 45, RunState.UNFINISHED),
        (45, 45, False, None, RunState.JUDGED),
    ]
    head = json.loads(run.manifest("paper").read_text())
    run.manifest("paper").write_text(
        json.dumps({k: v for k, v in head.items() if k not in {"rows", "sha256"}})
    )
    for written, judged, is_written, requested, state in cases:
        run.completions.write_bytes(b"".join(completions[:written]))
        run.rows("paper").write_bytes(b"".join(rows[:judged]))
        seen = open_snapshot(run.path)
        each = None if requested is None else requested // 15  # There are three tasks of five prompts.
        tasks = ["SayGoodDay", "LunchBreak", "StaplerSupply"]
        about = {} if each is None else {"batches": [{"tasks": tasks, "num_completions": each}]}
        seen = Snapshot(replace(seen.results, about=about), seen.evaluations, is_written, None)
        assert state_of(seen) is state, state


@pytest.mark.parametrize("content", [b"{broken\n", b"[1]\n", b'{"task": "LunchBreak"}\n', b"\xff\n"])
def test_a_damaged_row_is_named(runs: Path, content: bytes) -> None:
    rows = RunFolder(runs / "hasty").rows("paper")
    lines = read_lines(rows)
    rows.write_bytes(b"".join([*lines[:10], content, *lines[11:]]))
    with pytest.raises(UserError) as caught:
        open_snapshot(runs / "hasty")
    assert (caught.value.file, caught.value.line) == (rows.name, 11)


def test_a_lone_surrogate_in_the_name_of_a_task_is_escaped(runs: Path) -> None:
    completions = RunFolder(runs / "hasty").completions
    odd = {**json.loads(read_lines(completions)[0]), "task": "half \ud800"}
    completions.write_bytes(completions.read_bytes() + to_line(odd))
    run = open_snapshot(runs / "hasty")
    assert (len(run.results.completions), run.judged) == (46, 45)
    assert keys(run.completions)[-1] == ("half \\ud800", odd["prompt"], odd["index"])
