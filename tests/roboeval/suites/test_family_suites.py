"""Suites of fresh tasks: found by name, the same everywhere, and different for each seed."""

import json
import pickle
import shutil
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from command_line import refused, roboeval
from roboeval.evaluation.evaluate import evaluation_metadata
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.families.suite import FIRST_SEEDS, MAX_FAMILY_TASKS, FamilyTasks
from roboeval.suites.families.tasks import trained_task
from roboeval.suites.load import has_suite, load_suite
from roboeval.training.prompts import load_prompts
from roboeval.web.run_store import RunStore

SMALL = "families-test-7-2"


def test_a_suite_has_a_task_of_each_family_by_default() -> None:
    usual = FamilyTasks("test", 7)
    assert usual.name == "families-test-7"
    assert len({family for _, family, _ in usual.seeds()}) == usual.count == 17
    names = [name for name, _, _ in FamilyTasks("train", 0, 19).seeds()]
    assert names[17:] == [f"{name}-2" for name in names[:2]]


def test_tasks_are_those_of_the_training_prompts() -> None:
    tasks = load_suite(SMALL).tasks
    rows = load_prompts("test", count=2, seed=7)
    assert [*tasks] == sorted(row["family"] for row in rows)
    for row in rows:
        assert row["prompt"][-1]["content"] == tasks[row["family"]].prompts[row["prompt_index"]]
        made = trained_task(row["family"], row["seed"])
        assert tasks[row["family"]].scenarios == made.suite.tasks[made.name].scenarios
        assert tasks[row["family"]].path.is_file()


def test_a_seed_always_makes_the_same_suite() -> None:
    suite, other = load_suite(SMALL), load_suite("families-test-8-2")
    assert suite == pickle.loads(pickle.dumps(suite))
    digest = evaluation_metadata(suite)["digest"]
    assert digest == "40f52ef23d358ad486177ab5518169e439a82320c0c61f5368d881cbb7b0f1ec"
    assert evaluation_metadata(other)["digest"] != digest


def test_seeds_and_splits_share_no_task() -> None:
    kinds = [FamilyTasks(split, seed, 3) for split in FIRST_SEEDS for seed in (0, 1)]
    assert len({seed for kind in kinds for _, _, seed in kind.seeds()}) == 3 * len(kinds)


@pytest.mark.parametrize(
    "name", ["families-test-07", "families-test-7-17", "families-test", "families-test-1-x"]
)
def test_other_spellings_of_a_name_are_refused(name: str) -> None:
    assert not has_suite(name)
    with pytest.raises(UserError, match="unknown suite"):
        load_suite(name)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (("exam",), 'unknown split "exam"; .*train, validation and test'),
        (("test", -1), "the seed is -1, but with 17 tasks it must be from 0 to"),
        (("test", 1_000_000_000), "the seed is 1000000000"),
        (("test", 0, 0), "the number of tasks is 0"),
        (("test", 0, MAX_FAMILY_TASKS + 1), f"at most {MAX_FAMILY_TASKS}"),
    ],
)
def test_wrong_splits_seeds_and_counts_are_refused(wrong: tuple[str, int, int], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        FamilyTasks(*wrong)


def test_worlds_of_a_suite_from_families_cannot_be_resampled() -> None:
    with pytest.raises(UserError, match=f'"{SMALL}" are determined by its name'):
        load_suite(SMALL).with_worlds(4)


def test_recorded_models_know_right_and_wrong_programs() -> None:
    suite = load_suite(SMALL)
    careful = [*recorded_completions("recorded:careful", suite)]
    hasty = [*recorded_completions("recorded:hasty", suite)]
    prompts = sum(len(task.prompts) for task in suite.tasks.values())
    assert len(careful) == prompts
    assert {one.program for one in careful} < {one.program for one in hasty}


# --- on the command line


FRESH = ("--suite", SMALL)


def test_a_run_of_fresh_tasks_can_be_judged_on_another_machine(tmp_path: Path) -> None:
    words = ("--model", "recorded:careful", "--num-completions", "1")
    ended = roboeval("run", *FRESH, *words, "--no-report", cwd=tmp_path)
    assert ended.status == 0
    assert "pass@1 over all prompts: 1.000" in ended.out
    run = tmp_path / "runs" / f"recorded-careful-{SMALL}"
    about = json.loads((run / "run.json").read_text())
    suite = load_suite(SMALL)
    assert (about["suite"], about["settings"]["seed"]) == (SMALL, None)
    moved = tmp_path / "moved"
    moved.mkdir()
    for name in ("run.json", "completions.jsonl"):
        shutil.copy(run / name, moved)
    verdicts = f"evaluations/{SMALL}.jsonl"
    assert roboeval("evaluate", "moved", "--suite", about["suite"], cwd=tmp_path).status == 0
    assert (moved / verdicts).read_bytes() == (run / verdicts).read_bytes()
    snapshot = RunStore(tmp_path / "runs").open(run.name)
    assert snapshot.results.suite == suite


def test_completions_of_another_seed_are_not_judged(tmp_path: Path) -> None:
    assert roboeval("generate", *FRESH, "--num-completions", "1", "--out", "run", cwd=tmp_path).status == 0
    refusal = refused(
        "evaluate", "run", "--suite", "families-test-24-2", cwd=tmp_path
    )  # It has the same families.
    assert refusal.at == ("run/completions.jsonl", 1)
    assert not (tmp_path / "run" / "evaluations").exists()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--suite", "families-exam-0"), '"exam"'),
        (("--suite", "families-test-0-101"), " 100"),
    ],
)
@pytest.mark.parametrize("command", ["generate", "run"])
def test_wrong_names_leave_no_files(tmp_path: Path, command: str, words: tuple[str, ...], named: str) -> None:
    assert named in refused(command, *words, cwd=tmp_path).sentence
    assert list(tmp_path.iterdir()) == []
