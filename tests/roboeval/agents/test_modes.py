"""Compare programs and agents mission by mission."""

import csv
import json
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from codebotler.core.files import to_line
from command_line import refused, roboeval
from made_results import results_of
from made_up_runs import leave_figures_empty
from roboeval.analysis.comparisons.compare import compare_tables, has_missions, sample_size_sentences
from roboeval.analysis.statistics import SampleSizes
from roboeval.cli.inputs import open_with_results
from roboeval.cli.results.report import judged_run
from roboeval.evaluation.runs.results import load_results
from roboeval.report.runs import JudgedRun
from roboeval.report.sections.modes import ending_sheet, mode_sheet
from small_run import SUITE
from small_suite import write_suite

WORLDS = """\
name: T
summary: s
prompts: [Say hello in the kitchen.]
checks:
  says(what): {category: SayAtLocation, rtl: 'tr.Exists(say("{what}"))'}
worlds:
- {about: one, robot: lobby, rooms: [kitchen, lobby], require: [says("hello")]}
- {about: two, robot: lobby, rooms: [lobby], require: [says("hello")]}
"""
GO = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'  # The second world has no kitchen.
SAY = 'def task_program():\n    say("hello")\n'
USAGE = {"input_tokens": 90, "output_tokens": 10, "reasoning_tokens": None}


def make_run(folder: Path, suite: str, rows: list[dict[str, object]], mode: str = "program") -> Path:
    folder.mkdir()
    identity = {"task": "T", "prompt": 0, "instruction": "Say hello in the kitchen.", "usage": USAGE}
    lines = [to_line({**identity, "index": index, "model": "m", **row}) for index, row in enumerate(rows)]
    (folder / "completions.jsonl").write_bytes(b"".join(lines))
    (folder / "run.json").write_text(json.dumps({"settings": {}, "model": "m", "mode": mode}))
    roboeval("evaluate", str(folder), "--suite", suite)
    return folder


def mission(world: int, program: str, ending: str = "answer", **more: object) -> dict[str, object]:
    entries = {"mode": "agent", "world": world, "ending": ending, "turns": 3, "no_program": None}
    return {"program": program, **entries, "tool_errors": {}, **more}


@pytest.fixture
def runs(tmp_path: Path) -> tuple[Path, Path, str]:
    """A program that succeeds in one of two worlds, and an agent that succeeds in three of four missions."""
    folder = tmp_path / "suite"
    folder.mkdir()
    suite = write_suite(folder, WORLDS)
    programs = make_run(tmp_path / "programs", suite, [{"program": GO}])
    missions = [
        mission(0, GO),
        mission(1, SAY, tool_errors={"GoToInvalidLocation": 2}),
        mission(0, SAY),
        mission(1, "def task_program():\n    pass\n", "TurnLimit"),
    ]
    agents = make_run(tmp_path / "agents", suite, missions, "agent")
    return programs, agents, suite


def tables(runs: tuple[Path, Path, str]) -> list[pl.DataFrame]:
    return [load_results(run, suite=runs[2]) for run in runs[:2]]


def test_a_program_and_an_agent_are_compared_by_missions(runs: tuple[Path, Path, str]) -> None:
    programs, agents = tables(runs)
    assert (has_missions(programs), has_missions(agents)) == (False, True)
    found = compare_tables(programs, agents)
    assert (found.first, found.second) == (0.5, 0.75)
    assert found.counts_missions
    assert not sample_size_sentences(found)  # These sentences are about completions.
    assert found.sample_sizes == SampleSizes(None, None)


def test_two_runs_of_programs_are_counted_by_programs(runs: tuple[Path, Path, str]) -> None:
    programs, _ = tables(runs)
    found = compare_tables(programs, programs)
    assert (found.first, found.counts_missions) == (0.0, False)
    assert sample_size_sentences(found)


def costs(*tables: pl.DataFrame) -> list[list[Any]]:
    results = results_of([], SUITE)
    return [[*row] for row in mode_sheet([JudgedRun(results, table, name="m") for table in tables]).rows]


def test_costs_are_counted_by_mission(runs: tuple[Path, Path, str]) -> None:
    (one, other) = costs(*tables(runs))
    assert one[:4] == ["m", "program", 2, 0.5]
    assert one[6:] == [0, 1, None, 100, 200]
    assert other[:4] == ["m", "agent", 4, 0.75]
    assert other[6:] == [0, 3, 0.5, 100, pytest.approx(100 / 0.75)]


def test_missions_that_a_contract_ended_are_forbidden(runs: tuple[Path, Path, str], tmp_path: Path) -> None:
    missions = [mission(0, SAY), mission(1, SAY), mission(0, SAY, "OutsideContract"), mission(1, SAY)]
    run = make_run(tmp_path / "bounded", runs[2], missions, "agent")
    (row,) = costs(load_results(run, suite=runs[2]))
    assert row[6] == 0.25


def test_compare_counts_missions_of_agents(runs: tuple[Path, Path, str]) -> None:
    programs, agents, suite = runs
    paths = [str(programs), str(agents)]
    data = json.loads(roboeval("compare", *paths, "--suite", suite, "--json").out)
    assert (data["first"]["pass@1"], data["second"]["pass@1"]) == (0.5, 0.75)
    assert data["first"]["failures"]["RobotExecutionError"] == 0.5  # It is a share of missions.
    assert any("mission" in warning for warning in data["warnings"])
    shown = roboeval("compare", *paths, "--suite", suite).out
    assert "pass@1" not in shown
    assert "missions that succeed" in shown


@pytest.mark.slow
def test_a_report_with_house_rules_counts_the_missions_that_they_end(
    runs: tuple[Path, Path, str], tmp_path: Path
) -> None:
    _, agents, suite = runs
    rules = tmp_path / "house.yaml"
    rules.write_text("rules: [{name: stay, says: Stay., always: 'not tr.Exists(goto(\".*\"))'}]")
    roboeval("evaluate", str(agents), "--suite", suite, "--rules", str(rules))
    results = open_with_results(agents, suite, ablated=False)
    run = judged_run(results, suite, beside=None, rules=rules, engine=None)
    ((_, _, missions, succeed, _, _, forbidden, *_),) = mode_sheet([run]).rows
    assert (missions, succeed, forbidden) == (4, 0.5, 0.25)
    assert [(ending, share) for _, ending, _, share, *_ in ending_sheet([run]).rows] == [
        ("answer", pytest.approx(2 / 3)),
        ("TurnLimit", 0),
    ]


@pytest.mark.slow
def test_a_report_has_a_table_of_missions(
    runs: tuple[Path, Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs, agents, suite = runs
    paths = [str(programs), str(agents)]
    roboeval("report", *paths, "--suite", suite, "--out", str(tmp_path / "report"))
    with (tmp_path / "report" / "tables" / "modes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["mode"], row["missions"], float(row["succeed"])) for row in rows] == [
        ("program", "2", 0.5),
        ("agent", "4", 0.75),
    ]
    with (tmp_path / "report" / "tables" / "endings.csv").open() as file:
        ended = [(row["ending"], row["missions"], float(row["turns: most"])) for row in csv.DictReader(file)]
    assert ended == [("answer", "3", 3.0), ("TurnLimit", "1", 3.0)]
    leave_figures_empty(monkeypatch)  # the report of both runs has shown them
    roboeval("report", paths[0], "--suite", suite, "--out", str(tmp_path / "plain"))
    assert not {"modes.csv", "endings.csv"} & {
        path.name for path in (tmp_path / "plain" / "tables").iterdir()
    }


def test_a_search_in_a_world_finds_its_missions(runs: tuple[Path, Path, str]) -> None:
    _, agents, suite = runs
    data = json.loads(roboeval("find", str(agents), "--suite", suite, "--world", "2", "--json").out)
    assert [(one["completion"], one["worlds"][0]["number"]) for one in data["found"]] == [
        ("T/0/1", 2),
        ("T/0/3", 2),
    ]

    assert data["looked_at"] == 2


def test_the_nearest_passing_mission_is_from_the_same_world(
    runs: tuple[Path, Path, str], tmp_path: Path
) -> None:
    twice = f'{SAY}    say("hello")\n'
    run = make_run(tmp_path / "run", runs[2], [mission(0, SAY), mission(1, twice), mission(1, GO)], "agent")
    (group,) = json.loads(roboeval("find", str(run), "--suite", runs[2], "--json").out)["groups"]
    assert group["fix"]["program"] == "T/0/1"


@pytest.mark.parametrize("name", ["recover", "resample", "clarify"])
def test_commands_about_programs_refuse_missions(runs: tuple[Path, Path, str], name: str) -> None:
    _, agents, suite = runs
    assert "of an agent" in refused(name, str(agents), "--suite", suite).sentence


@pytest.mark.parametrize("mode", ["agent", "replan"])
def test_recorded_models_cannot_be_agents(mode: str) -> None:
    refused("run", "--model", "recorded:careful", "--mode", mode)


def test_a_summary_says_how_missions_ended(runs: tuple[Path, Path, str]) -> None:
    _, agents, suite = runs
    data = json.loads(roboeval("show", str(agents), "--suite", suite, "--json").out)
    assert (data["endings"], data["turns"]) == ({"answer": 3, "TurnLimit": 1}, 12)
    kinds = [kind for one in data["failures"] if one["class"] == "AgentError" for kind in one["kinds"]]
    assert [kind["kind"] for kind in kinds if kind["count"]] == ["TurnLimit"]
