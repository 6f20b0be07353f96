"""A run is followed while its files grow, damaged rows are named, and what changed is told."""

from __future__ import annotations

import fcntl
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from codebotler.files import to_line
from roboeval.evaluation.run import Run
from roboeval.web.followed import FollowedRun, GoneError
from roboeval.web.seen import Seen, Wanted
from roboeval.web.telling import State, notes, state_of


def followed(folder: Path) -> FollowedRun:
    return FollowedRun(Run(folder), "paper", folder.parent.resolve())


def lines_of(path: Path) -> list[bytes]:
    return path.read_bytes().splitlines(keepends=True)


def test_what_is_known_of_a_run(runs: Path) -> None:
    seen = followed(runs / "hasty").wait()
    rows = [json.loads(line) for line in lines_of(Run(runs / "hasty").rows("paper"))]
    assert len(seen.entries) == len(rows) == 45
    assert seen.written_count == seen.to_judge == len(seen.judged) == 45
    assert (seen.stale_count, seen.fault_count) == (0, 0)
    assert seen.models == ("recorded:hasty",)
    assert state_of(seen, 45) is State.JUDGED
    for row in rows:
        judged = seen.by_key[row["task"], row["prompt"], row["index"]].judged
        assert judged is not None
        assert judged.passed is row["passed"]
        assert [sign == "+" for sign in judged.worlds] == [v["satisfied"] for v in row["verdicts"]]
        if row["failure"]:
            assert (judged.failure_class, judged.kind) == (row["failure"]["class"], row["failure"]["kind"])
    assert sum(seen.kinds.values()) == sum(not row["passed"] for row in rows)


def test_a_row_and_a_completion_are_read_again(runs: Path) -> None:
    run = followed(runs / "hasty")
    entry = run.wait().by_key["LunchBreak", 2, 1]
    row, completion = run.row(entry), run.completion(entry)
    assert row is not None
    assert completion is not None
    assert (row["task"], row["prompt"], row["index"]) == completion.key == ("LunchBreak", 2, 1)
    assert "def task_program" in completion.program


def test_a_run_grows_line_by_line(runs: Path, tmp_path: Path) -> None:
    whole, growing = Run(runs / "hasty"), Run(tmp_path / "other" / "hasty")
    growing.rows("paper").parent.mkdir(parents=True)
    shutil.copy(whole.about, growing.about)
    run = FollowedRun(growing, "paper", tmp_path.resolve())
    versions = [run.look().version]
    for path, at_once in ((whole.completions, 9), (whole.programs("paper"), 45), (whole.rows("paper"), 7)):
        lines, torn = lines_of(path), b""
        for start in range(0, len(lines), at_once):
            rest = lines[start + at_once : start + at_once + 1]
            with (growing.path / path.relative_to(whole.path)).open("ab") as file:
                file.write(b"".join(lines[start : start + at_once])[len(torn) :])
                file.write(torn := b"".join(rest)[:5])
            versions.append(run.look().version)
            assert run.look().version == versions[-1], "nothing is new, and a torn line is none"
    seen, at_once_seen = run.wait(), followed(runs / "hasty").wait()
    assert seen.entries == at_once_seen.entries
    assert versions == sorted(versions)
    assert len(set(versions)) >= 5 + 7


@pytest.mark.parametrize("content", [b"{broken\n", b"[1]\n", b'{"task": "LunchBreak"}\n', b"\xff\n"])
def test_a_damaged_row_is_named_and_the_others_are_shown(runs: Path, content: bytes) -> None:
    rows = Run(runs / "hasty").rows("paper")
    lines = lines_of(rows)
    rows.write_bytes(b"".join([*lines[:10], content, *lines[11:]]))
    seen = followed(runs / "hasty").wait()
    assert seen.fault_count == 1
    assert seen.faults[0].startswith("paper.jsonl, line 11: ")
    assert len(seen.judged) == 44
    assert seen.stale_count == 0, "the rows after it are still held against their own programs"
    assert state_of(seen, 45) is State.DAMAGED


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("failure", {}),
        ("failure", {"class": [], "kind": "x", "world": 0, "check": None}),
        ("failure", {"class": "x", "kind": "y", "world": 99, "check": None}),
        ("failure", {"class": "x", "kind": "y", "world": "0", "check": None}),
        ("verdicts", [1]),
        ("verdicts", [{}]),
        ("prompt", True),
        ("passed", "yes"),
    ],
)
def test_a_row_with_a_wrong_field_is_no_row(runs: Path, field: str, value: object) -> None:
    rows = Run(runs / "hasty").rows("paper")
    lines = lines_of(rows)
    at = next(n for n, line in enumerate(lines) if json.loads(line)["failure"])
    row: dict[str, Any] = {**json.loads(lines[at]), field: value}
    rows.write_bytes(b"".join([*lines[:at], to_line(row), *lines[at + 1 :]]))
    seen = followed(runs / "hasty").wait()
    assert (seen.fault_count, len(seen.judged)) == (1, 44)


def test_many_damaged_lines_are_counted(runs: Path) -> None:
    completions = Run(runs / "hasty").completions
    completions.write_bytes(b"nothing\n" * 12 + completions.read_bytes() + lines_of(completions)[0])
    seen = followed(runs / "hasty").wait()
    assert seen.fault_count == 13
    assert len(seen.faults) == 5
    assert any("8 more lines" in note for note in notes(seen, None))
    assert seen.written_count == 45


def test_a_program_that_changed_since_it_was_judged_is_told(runs: Path) -> None:
    completions = Run(runs / "hasty").completions
    lines = lines_of(completions)
    row = json.loads(lines[7])
    completions.write_bytes(b"".join([*lines[:7], to_line({**row, "program": "x = 1\n"}), *lines[8:]]))
    seen = followed(runs / "hasty").wait()
    assert [entry.key for entry in seen.entries if entry.stale] == [
        (row["task"], row["prompt"], row["index"])
    ]


def test_a_run_that_is_written_anew_is_read_anew(runs: Path) -> None:
    run = followed(runs / "hasty")
    entry = run.wait().by_key["LunchBreak", 2, 1]
    rows = Run(runs / "hasty").rows("paper")
    lines = lines_of(rows)
    rows.unlink()
    assert len(run.wait().judged) == 0
    rows.write_bytes(b"".join(lines[:5]))
    assert len(run.wait().judged) == 5
    with pytest.raises(ValueError, match="reload"):
        run.row(entry)


def test_a_run_that_is_deleted_is_gone(runs: Path) -> None:
    run = followed(runs / "hasty")
    run.wait()
    shutil.rmtree(runs / "hasty")
    with pytest.raises(GoneError, match="is gone") as error:
        run.look()
    assert error.value.file == "hasty"


def test_who_writes_a_run_is_seen_and_not_disturbed(runs: Path) -> None:
    run = Run(runs / "hasty")
    for _ in range(50):  # a hold of ours that outlived a look would refuse the next writer
        assert not followed(run.path).wait().is_written
        with run.writing():
            assert followed(run.path).look().is_written
    with (run.path / ".lock").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def seen_of(run: Run, **changes: Any) -> Seen:  # noqa: ANN401 - any field
    seen = FollowedRun(run, "paper", run.path.parent.resolve()).wait()
    return Seen(**{**{name: getattr(seen, name) for name in Seen.__dataclass_fields__}, **changes})


def test_how_far_a_run_has_come(runs: Path) -> None:
    run = Run(runs / "hasty")
    seen = seen_of(run)
    unjudged = tuple(type(e)(e.key, e.written, None) for e in seen.entries)
    partly = (*unjudged[:5], *seen.entries[5:])
    cases: list[tuple[dict[str, Any], int | None, State]] = [
        ({"share": 0.5}, 45, State.READING),
        ({"is_written": True, "entries": unjudged}, 50, State.GENERATING),
        ({"is_written": True, "entries": ()}, None, State.GENERATING),
        ({"is_written": True, "entries": partly}, 45, State.JUDGING),
        ({"is_written": True}, 45, State.JUDGED),
        ({"entries": ()}, 45, State.EMPTY),
        ({"entries": unjudged}, 50, State.UNFINISHED),
        ({"entries": unjudged}, 45, State.NOT_JUDGED),
        ({"entries": partly}, 45, State.UNFINISHED),
        ({}, None, State.JUDGED),
    ]
    for changes, wanted, state in cases:
        assert state_of(seen_of(run, **changes), wanted) is state, state


def test_a_look_reads_a_part_and_the_next_one_goes_on(runs: Path) -> None:
    run = followed(runs / "hasty")
    shares: list[float] = []
    while not shares or shares[-1] < 1:
        shares.append(run.look(0.0).share)
    assert len(shares) > 45
    assert shares == sorted(shares)
    assert run.look().entries == followed(runs / "hasty").wait().entries


def test_cells_and_choices(runs: Path) -> None:
    seen = followed(runs / "hasty").wait()
    order = ("StaplerSupply", "LunchBreak")
    cells = seen.cells(Wanted(passed=True), order)
    assert [cell.task for cell in cells] == ["StaplerSupply"] * 5 + ["LunchBreak"] * 5 + ["SayGoodDay"] * 5
    assert all((cell.written, cell.judged) == (3, 3) for cell in cells)
    assert sum(cell.counted for cell in cells) == sum(one.passed for _, one in seen.judged)
    for wanted in (
        Wanted("LunchBreak", 2),
        Wanted(passed=False),
        *(Wanted(failure_class=name, kind=kind) for name, kind in seen.kinds),
    ):
        chosen = seen.chosen(wanted, order)
        assert chosen
        assert all(wanted.takes(entry) for entry in chosen)
        assert len(chosen) == sum(map(wanted.takes, seen.entries))
        keys = [entry.key for entry in chosen]
        for before, key, after in zip([None, *keys], keys, [*keys[1:], None], strict=False):
            assert list(seen.neighbours(key, wanted, order)) == [before, after]
    assert list(seen.neighbours(("LunchBreak", 9, 9), Wanted(), order)) == [None, None]
