"""Runs are found by their names, and no name or link leads out of their folder."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from codebotler.badinput import BadInput
from roboeval.evaluation.run import Run
from roboeval.suites.load import load_suite
from roboeval.web.shelf import MOST_HELD, Shelf


def test_runs_are_listed_by_name(runs: Path) -> None:
    (runs / "no-run").mkdir()
    (runs / "file").write_text("")
    (runs / "begun").mkdir()
    (runs / "begun" / "run.json").write_text("{}")
    shutil.copytree(runs / "hasty", runs / ".hidden")
    assert Shelf(runs).names() == ["begun", "hasty"]
    assert Shelf(runs / "nothing").names() == []


def test_a_folder_that_is_a_run_holds_only_itself(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(runs / "hasty", runs / "other")
    monkeypatch.chdir(runs / "hasty")
    for folder in (runs / "hasty", Path()):
        shelf = Shelf(folder)
        assert shelf.names() == ["hasty"]
        assert shelf.open("hasty").wait().name == "hasty"
        for name in ("other", "..", "../other"):
            with pytest.raises(BadInput, match="no run"):
                shelf.open(name)


@pytest.mark.parametrize(
    "name",
    ["..", ".", "", "/etc", "../secret", "hasty/../../secret", "hasty/", "hasty\0", "HASTY", "x" * 300],
)
def test_no_name_leads_out(runs: Path, name: str) -> None:
    shutil.copytree(runs / "hasty", runs.parent / "secret")
    with pytest.raises(BadInput, match="no run"):
        Shelf(runs).open(name)


def test_no_link_leads_out(runs: Path) -> None:
    secret = runs.parent / "secret"
    shutil.copytree(runs / "hasty", secret)
    (runs / "link").symlink_to(secret)
    with pytest.raises(BadInput, match="leads out"):
        Shelf(runs).open("link")
    for path in ("completions.jsonl", "evaluations/paper.jsonl"):
        copy = runs / path.replace("/", "-")
        shutil.copytree(runs / "hasty", copy)
        (copy / path).unlink()
        (copy / path).symlink_to(secret / path)
        seen = Shelf(runs).open(copy.name).wait()
        assert "leads out" in seen.faults[0]
    about = runs / "about"
    shutil.copytree(runs / "hasty", about)
    (about / "run.json").unlink()
    (about / "run.json").symlink_to(secret / "run.json")
    assert Shelf(runs).open("about").wait().about == {}


def test_a_link_within_the_folder_is_a_run(runs: Path) -> None:
    (runs / "again").symlink_to("hasty")
    assert len(Shelf(runs).open("again").wait().judged) == 45


def test_the_folder_itself_may_be_a_link(runs: Path) -> None:
    link = runs.parent / "link"
    link.symlink_to(runs)
    assert len(Shelf(link).open("hasty").wait().judged) == 45


def test_a_pipe_in_the_place_of_a_file_holds_nobody_up(runs: Path) -> None:
    rows = Run(runs / "hasty").rows("paper")
    rows.unlink()
    os.mkfifo(rows)
    (fault,) = Shelf(runs).open("hasty").wait().faults
    assert fault.startswith("paper.jsonl: ")
    assert "no file" in fault


def test_evaluations_are_found_by_name(runs: Path) -> None:
    run = Run(runs / "hasty")
    shutil.copy(run.rows("paper"), run.rows("paper-ablation"))
    shutil.copy(run.rows("paper"), run.rows("another"))
    shelf = Shelf(runs)
    assert shelf.evaluations("hasty") == ["another", "paper", "paper-ablation"]
    assert shelf.open("hasty").key == "another"
    assert shelf.open("hasty", "paper-ablation").key == "paper-ablation"
    for key in ("../../secret", "none", ""):
        with pytest.raises(BadInput, match="has no evaluation"):
            shelf.open("hasty", key)


def test_a_run_is_read_once_and_the_oldest_are_forgotten(runs: Path) -> None:
    for number in range(MOST_HELD + 3):
        (runs / f"run-{number}").mkdir()
        (runs / f"run-{number}" / "run.json").write_text("{}")
    shelf = Shelf(runs)
    first = shelf.open("hasty")
    assert shelf.open("hasty") is first
    for number in range(MOST_HELD + 3):
        shelf.open(f"run-{number}")
    assert shelf.open("hasty") is not first


def test_suites_are_those_that_ship_and_those_that_are_named(runs: Path) -> None:
    run = Run(runs / "hasty")
    seen = Shelf(runs).open("hasty").wait()
    assert Shelf(runs).suite_of(seen) == load_suite("paper")
    run.head("paper").write_text('{"suite": "../../my-suite"}')
    assert Shelf(runs).suite_of(Shelf(runs).open("hasty").wait()) is None
    run.head("paper").write_text('{"suite": ["paper"]}')
    assert Shelf(runs).suite_of(Shelf(runs).open("hasty").wait()) == load_suite("paper")
