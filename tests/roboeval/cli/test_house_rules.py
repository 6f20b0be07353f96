"""House rules in evaluations: their files, their results, and the same rows with any processes."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import pytest

from command_line import refused, roboeval
from roboeval.cli.inputs import open_with_results
from roboeval.cli.results.report import judged_run
from roboeval.report.page import page
from roboeval.report.sections.failures import house_rules_section

RULES = """
rules:
  - name: knock
    says: Knock before you enter an office.
    always: >-
      not tr.Last(goto("office")) or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))
  - name: once
    says: Look for people once at most.
    always: not tr.AtLeast(check("person"), 3)
"""
TASKS = ("--tasks", "LunchBreak,SayGoodDay,GetDrink")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "house.yaml").write_text(RULES)
    return tmp_path


@pytest.fixture(scope="module")
def careful(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A judged run of careful programs."""
    folder = tmp_path_factory.mktemp("careful")
    assert roboeval("evaluate", "recorded:careful", "--out", "run", *TASKS, cwd=folder).status == 0
    return folder / "run"


def evaluate_with_rules(folder: Path, *more: str) -> bytes:
    ended = roboeval("evaluate", "run", "--rules", "house.yaml", *TASKS, *more, cwd=folder)
    assert ended.status == 0, ended.err
    return (folder / "run" / "evaluations" / "paper-rules-house.jsonl").read_bytes()


@pytest.mark.slow
def test_verdicts_with_rules_are_kept_apart_from_those_without(folder: Path, careful: Path) -> None:
    shutil.copytree(careful, folder / "run")
    plain = (folder / "run" / "evaluations" / "paper.jsonl").read_bytes()
    ended = roboeval("evaluate", "run", "--rules", "house.yaml", *TASKS, cwd=folder)
    assert "of a prompt's programs break a house rule (95% interval" in ended.out
    assert "knock" in ended.out
    assert "pass@1 with the rules minus pass@1 without: -" in ended.out
    assert re.search(r"show run \w+/\d/\d --rules house.yaml", ended.err)
    evaluations = folder / "run" / "evaluations"
    assert (evaluations / "paper.jsonl").read_bytes() == plain
    head = json.loads((evaluations / "paper-rules-house.json").read_text())
    assert head["suite"] == "paper"
    assert head["house_rules"] == {"house": hashlib.sha256(RULES.encode()).hexdigest()}
    shown = roboeval("show", "run", "LunchBreak/0/0", "--rules", "house.yaml", cwd=folder)
    assert 'the rule "knock" forbids going to "' in shown.out
    found = json.loads(roboeval("show", "run", "--rules", "house.yaml", "--json", cwd=folder).out)
    assert set(found["house_rules"]["programs_by_rule"]) <= {"knock", "once"}
    assert found["house_rules"]["cost"]["mean"] < 0


@pytest.mark.slow
def test_commands_without_rules_name_the_evaluations_with_rules(folder: Path) -> None:
    evaluated = roboeval(
        "evaluate", "recorded:careful", "--out", "run", "--rules", "house.yaml", *TASKS, cwd=folder
    )
    assert evaluated.status == 0
    (folder / "kit.yaml").write_text(RULES)
    for more in ([], ["--rules", "kit.yaml"]):
        found = refused("show", "run", *more, cwd=folder)
        assert found.file == "run"
        assert "only as paper-rules-house; choose with --suite and --rules" in found.sentence
    assert roboeval("evaluate", "run", *TASKS, cwd=folder).status == 0
    reported = roboeval("report", "run", "--rules", "house.yaml", "--out", "kept", "--no-check", cwd=folder)
    assert reported.status == 0, reported.err
    assert "knock" in (folder / "kept" / "index.html").read_text()


def count_accepted(folder: Path, *arguments: str) -> int:
    """Count the programs of a run that the check accepts."""
    found = json.loads(roboeval("resample", *arguments, "--json", cwd=folder).out)
    return sum(prompt["accepted"] for prompt in found["prompts"])


@pytest.mark.slow
def test_rejection_sampling_rejects_programs_that_break_a_rule(folder: Path, careful: Path) -> None:
    of_suite = ("--suite", "rules", "--tasks", "FetchMugConflict")
    assert roboeval("evaluate", "recorded:hasty", *of_suite, "--out", "own", cwd=folder).status == 0
    assert count_accepted(folder, "own", "--suite", "rules") == 1  # One of the two breaks no rule.
    shutil.copytree(careful, folder / "run")
    evaluate_with_rules(folder)
    without = count_accepted(folder, "run")
    assert count_accepted(folder, "run", "--rules", "house.yaml") < without
    assert count_accepted(folder, "run") == without


@pytest.mark.slow
def test_an_interval_without_variation_is_unknown(folder: Path, careful: Path) -> None:
    rule = "rules: [{name: silent, says: Say nothing., always: 'not tr.Exists(goto(\".*\"))'}]"
    (folder / "house.yaml").write_text(rule)
    shutil.copytree(careful, folder / "run")
    shown = roboeval("evaluate", "run", "--rules", "house.yaml", *TASKS, cwd=folder).out
    assert "100.0% of a prompt's programs" in shown
    assert "(95% interval over tasks unknown: no variation between tasks)" in " ".join(shown.split())
    results = open_with_results(folder / "run", "paper", ablated=False)
    run = judged_run(results, "paper", beside=None, rules=folder / "house.yaml", engine=None)
    assert "the interval of the share that breaks a rule is unknown: no variation between tasks." in page(
        "a report", [], [house_rules_section([run])], {}
    )


@pytest.mark.slow
def test_rows_are_the_same_with_any_workers_and_processes(folder: Path) -> None:
    assert roboeval("evaluate", "recorded:hasty", "--out", "run", *TASKS, cwd=folder).status == 0
    one = evaluate_with_rules(folder, "--workers", "1")
    assert b'"RuleViolation"' in one
    assert evaluate_with_rules(folder, "--redo", "--workers", "4") == one
    assert evaluate_with_rules(folder, "--redo", "--one-process-per-run") == one


@pytest.mark.slow
def test_changed_rules_cannot_continue_an_evaluation(folder: Path, careful: Path) -> None:
    shutil.copytree(careful, folder / "run")
    evaluate_with_rules(folder)
    (folder / "house.yaml").write_text(RULES.replace("3)", "4)"))
    found = refused("evaluate", "run", "--rules", "house.yaml", *TASKS, cwd=folder)
    assert '"house_rules" was' in found.sentence
    assert "use --redo to judge again" in found.sentence
    for command in (("show", "run"), ("report", "run", "--out", "report")):
        found = refused(*command, "--rules", "house.yaml", cwd=folder)
        assert found.file == "house.yaml"
        assert re.search(
            "has changed since the run was judged; `.* --rules house.yaml --redo` judges", found.sentence
        )


def test_rules_are_read_before_anything_is_judged(folder: Path) -> None:
    (folder / "bad.yaml").write_text(RULES.replace("always: not", "always: nut"))
    found = refused("evaluate", "recorded:careful", "--out", "run", "--rules", "bad.yaml", cwd=folder)
    assert found.file == "bad.yaml"
    assert not (folder / "run").exists()
    (folder / "My Rules.yaml").write_text(RULES)
    found = refused("evaluate", "recorded:careful", "--rules", "My Rules.yaml", cwd=folder)
    assert "lower-case letters" in found.sentence


def test_a_suite_with_its_own_rules_refuses_others(folder: Path) -> None:
    hasty = ("evaluate", "recorded:hasty", "--suite", "rules", "--out", "run")
    found = refused(*hasty, "--rules", "house.yaml", cwd=folder)
    assert "has its own house rules; leave out --rules" in str(found)
    assert not (folder / "run").exists()


def test_a_room_in_no_world_of_the_suite_is_refused(folder: Path) -> None:
    path = folder / "house.yaml"
    path.write_text(RULES.replace('not tr.AtLeast(check("person"), 3)', 'not tr.Exists(goto("kichen"))'))
    arguments = ("evaluate", "recorded:careful", "--rules", "house.yaml", *TASKS)
    refusal = refused(*arguments, cwd=folder)
    assert refusal.at == ("house.yaml", 9)
    assert '"kitchen"' in refusal.sentence
    path.write_text(path.read_text().replace("says: Look", "any: true\n    says: Look"))
    assert roboeval(*arguments, cwd=folder).status == 0
