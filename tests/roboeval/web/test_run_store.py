"""Runs are found by name and read again when they change, and no path leaves their folder."""

from __future__ import annotations

import fcntl
import os
import shutil
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.load import load_suite
from roboeval.web import run_store
from roboeval.web.run_store import MAX_SNAPSHOTS, MissingError, RunStore
from seals import unseal


def test_runs_are_listed_by_name(runs: Path) -> None:
    (runs / "no-run").mkdir()
    (runs / "file").write_text("")
    (runs / "begun").mkdir()
    (runs / "begun" / "run.json").write_text("{}")
    shutil.copytree(runs / "hasty", runs / ".hidden")
    assert RunStore(runs).names() == ["begun", "hasty"]
    assert RunStore(runs / "nothing").names() == []


def test_a_run_without_completions_is_not_damaged(runs: Path) -> None:
    (runs / "begun").mkdir()
    (runs / "begun" / "run.json").write_text("{}")
    begun = RunStore(runs).open("begun")
    assert (len(begun.results.completions), begun.results.key) == (0, None)


def test_a_folder_that_is_a_run_contains_only_itself(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(runs / "hasty", runs / "other")
    monkeypatch.chdir(runs / "hasty")
    for folder in (runs / "hasty", Path()):
        store = RunStore(folder)
        assert store.names() == ["hasty"]
        assert store.open("hasty").name == "hasty"
        for name in ("other", "..", "../other"):
            with pytest.raises(UserError, match="no run"):
                store.open(name)


@pytest.mark.parametrize(
    "name",
    ["..", ".", "", "/etc", "../secret", "hasty/../../secret", "hasty/", "hasty\0", "HASTY", "x" * 300],
)
def test_no_name_leaves_the_folder(runs: Path, name: str) -> None:
    shutil.copytree(runs / "hasty", runs.parent / "secret")
    with pytest.raises(UserError, match="no run"):
        RunStore(runs).open(name)


@pytest.mark.parametrize(
    "path", ["", "completions.jsonl", "run.json", "evaluations", "evaluations/paper.jsonl", "checks"]
)
def test_no_link_leaves_the_folder(runs: Path, path: str) -> None:
    (runs / "hasty" / "checks").mkdir()
    (runs / "hasty" / "checks" / "paper.jsonl").touch()
    secret = runs.parent / "secret"
    shutil.copytree(runs / "hasty", secret)
    link = runs / "hasty" / path
    if link.is_dir():
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.symlink_to(secret / path)
    with pytest.raises(UserError, match="leads out"):
        RunStore(runs).open("hasty")


def test_a_link_within_the_folder_is_a_run(runs: Path) -> None:
    (runs / "again").symlink_to("hasty")
    assert RunStore(runs).open("again").judged == 45


def test_the_folder_itself_may_be_a_link(runs: Path) -> None:
    link = runs.parent / "link"
    link.symlink_to(runs)
    assert RunStore(link).open("hasty").judged == 45


def test_a_pipe_instead_of_a_file_is_refused_at_once(runs: Path) -> None:
    rows = RunFolder(runs / "hasty").rows("paper")
    rows.unlink()
    os.mkfifo(rows)
    with pytest.raises(UserError, match="not a regular file") as error:
        RunStore(runs).open("hasty")
    assert error.value.file == "paper.jsonl"


def test_evaluations_are_found_by_name(runs: Path) -> None:
    run = RunFolder(runs / "hasty")
    shutil.copy(run.rows("paper"), run.rows("paper-ablation"))
    shutil.copy(run.rows("paper"), run.rows("another"))
    for key in ("paper-ablation", "another"):
        shutil.copy(run.manifest("paper"), run.manifest(key))
    store = RunStore(runs)
    assert store.open("hasty").evaluations == ("another", "paper", "paper-ablation")
    assert store.open("hasty").results.key == "another"
    assert store.open("hasty", "paper-ablation").results.key == "paper-ablation"
    for key in ("../../secret", "none", ""):
        with pytest.raises(UserError, match="has no evaluation"):
            store.open("hasty", key)


def test_a_run_is_read_again_only_when_it_has_changed(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_store, "REST_FACTOR", 0)
    store, run = RunStore(runs), RunFolder(runs / "hasty")
    first = store.open("hasty")
    assert store.open("hasty") is first
    assert store.version("hasty") == first.version
    unseal(run.path)
    lines = run.rows("paper").read_bytes().splitlines(keepends=True)
    for content, judged in ((lines[:20], 20), ([*lines[:20], lines[20][:9]], 20), (lines[:30], 30)):
        run.rows("paper").write_bytes(b"".join(content))
        assert store.version("hasty") != first.version
        again = store.open("hasty")
        assert again.judged == judged
        assert again.version != first.version
        first = again
    run.rows("paper").unlink()
    assert store.open("hasty").judged == 0


def test_a_growing_run_is_not_read_on_each_request(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_store, "REST_FACTOR", 1e9)
    store, run = RunStore(runs), RunFolder(runs / "hasty")
    first = store.open("hasty")
    completions = run.completions.read_bytes().splitlines(keepends=True)
    run.completions.write_bytes(b"".join(completions[:20]))
    assert store.open("hasty") is first
    assert store.version("hasty") != first.version
    with run.writing():
        now = store.open("hasty")
    assert (now.is_written, len(now.results.completions)) == (True, 45)


def test_rows_of_a_replaced_file_are_refused(runs: Path) -> None:
    run, rows = RunStore(runs).open("hasty"), RunFolder(runs / "hasty").rows("paper")
    assert run.results.row(("LunchBreak", 2, 1))["index"] == 1
    rows.write_bytes(b"".join(rows.read_bytes().splitlines(keepends=True)[1:]))
    with pytest.raises(UserError, match="replaced"):
        run.results.row(("LunchBreak", 2, 1))


def test_a_deleted_run_is_missing(runs: Path) -> None:
    store = RunStore(runs)
    store.open("hasty")
    shutil.rmtree(runs / "hasty")
    with pytest.raises(MissingError):
        store.open("hasty")


def test_a_writer_is_noticed_and_not_disturbed(runs: Path) -> None:
    run, store = RunFolder(runs / "hasty"), RunStore(runs)
    for _ in range(50):  # A lock that we kept would refuse the next writer.
        assert not store.open("hasty").is_written
        with run.writing():
            assert store.open("hasty").is_written
    with (run.path / ".lock").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_the_oldest_snapshots_leave_the_cache(runs: Path) -> None:
    for number in range(MAX_SNAPSHOTS):
        (runs / f"run-{number}").mkdir()
        (runs / f"run-{number}" / "run.json").write_text("{}")
    store = RunStore(runs)
    first = store.open("hasty")
    for number in range(MAX_SNAPSHOTS):
        store.open(f"run-{number}")
    assert store.open("hasty") is not first


def test_only_names_of_shipped_suites_are_loaded(runs: Path) -> None:
    run = RunFolder(runs / "hasty")
    assert RunStore(runs).open("hasty").suite == load_suite("paper")
    run.manifest("paper").write_text('{"suite": "../../my-suite"}')
    assert RunStore(runs).open("hasty").suite is None
    run.manifest("paper").write_text('{"suite": ["paper"]}')
    assert RunStore(runs).open("hasty").suite == load_suite("paper")
