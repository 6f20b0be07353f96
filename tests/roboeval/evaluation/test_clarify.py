"""Measure questions with a simulated person who judges options by the task's requirements."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.simulator.pool import WorkerPool
from made_results import results_of
from roboeval.evaluation.clarify import (
    ClarifySettings,
    PromptShares,
    clarify,
    measurement_data,
    read_measurements,
    store_measurement,
)
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import Results
from roboeval.suites.load import Suite

TASK = "SayGoodDay"
RIGHT = """
def task_program():
    for room in get_all_rooms():
        if "lab" in room:
            go_to(room)
            if is_in_room("person"):
                say("Good day!")
"""
WRONG = RIGHT.replace('if is_in_room("person")', 'if not is_in_room("person")')
SILENT = "def task_program():\n    pass\n"


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as started:
        yield started


def completions(*programs: str, usage: int | None = None) -> list[Completion]:
    more = {} if usage is None else {"usage": {"input_tokens": usage, "output_tokens": 1}}
    return [
        Completion(task=TASK, prompt=0, index=number, program=program, more=more)
        for number, program in enumerate(programs)
    ]


def measure(
    programs: Sequence[Completion], paper: Suite, pool: WorkerPool, candidates: int = 4, noise: float = 0.0
) -> PromptShares:
    (found,) = clarify(programs, paper, pool, ClarifySettings(candidates, noise))
    return found


@pytest.mark.slow
def test_a_person_takes_the_option_that_passes(paper: Suite, pool: WorkerPool) -> None:
    found = measure(completions(WRONG, WRONG, RIGHT, SILENT), paper, pool)
    assert found == shares(0.25, majority=0, question=1, mattered=1)


@pytest.mark.slow
def test_none_of_the_options_counts_as_failed(paper: Suite, pool: WorkerPool) -> None:
    found = measure(completions(WRONG, WRONG, SILENT), paper, pool, 3)
    assert found == shares(0, majority=0, question=0, mattered=0)


@pytest.mark.slow
def test_without_a_question_the_largest_cluster_counts(paper: Suite, pool: WorkerPool) -> None:
    found = measure(completions(RIGHT, RIGHT, RIGHT, WRONG), paper, pool)
    assert found == shares(0.75, majority=1, question=1, asked=0)


@pytest.mark.slow
def test_a_person_who_is_always_wrong_never_takes_the_option_that_passes(
    paper: Suite, pool: WorkerPool
) -> None:
    found = measure(completions(RIGHT, RIGHT, WRONG, SILENT), paper, pool, noise=1.0)
    assert found == shares(0.5, majority=1, question=0, mattered=1)


@pytest.mark.slow
def test_tokens_are_counted_for_a_group(paper: Suite, pool: WorkerPool) -> None:
    assert measure(completions(RIGHT, SILENT, usage=9), paper, pool, 2)["tokens"] == 20
    assert measure(completions(RIGHT, SILENT), paper, pool, 2)["tokens"] is None


def test_too_few_completions_are_refused(paper: Suite, pool: WorkerPool) -> None:
    with pytest.raises(UserError, match="more than 2"):
        next(clarify(completions(RIGHT, WRONG), paper, pool, ClarifySettings(3)))


def shares(
    one: float = 0.5,
    *,
    majority: float = 0,
    question: float = 0,
    asked: float = 1,
    mattered: float | None = None,
    tokens: float | None = None,
) -> PromptShares:
    return {
        "task": TASK,
        "prompt": 0,
        "one": one,
        "majority": majority,
        "question": question,
        "asked": asked,
        "mattered": mattered,
        "tokens": tokens,
    }


def test_prompts_count_equally_but_mattered_counts_questions(paper: Suite) -> None:
    prompts = [
        shares(0.75, majority=0.5, question=1, asked=0.5, mattered=1),
        shares(0, majority=1, question=1, mattered=0, tokens=30),
        shares(0, asked=0),
    ]
    found = measurement_data([], paper, ClarifySettings(), prompts)
    assert (found["one"], found["majority"], found["question"], found["asked"]) == (0.25, 0.5, 2 / 3, 0.5)
    assert (found["mattered"], found["tokens"], found["prompts"]) == (1 / 3, 30, prompts)


def test_nothing_mattered_without_a_question(paper: Suite) -> None:
    assert measurement_data([], paper, ClarifySettings(), [shares(asked=0)])["mattered"] is None


# --- measurements in a run


def results_by(suite: Suite, written: Sequence[Completion], run: Path) -> Results:
    results = results_of([], suite, completions=written, head={"digest": suite.digest})
    return replace(results, run=RunFolder(run))


def test_a_stored_measurement_is_outdated_when_programs_or_the_suite_change(
    paper: Suite, tmp_path: Path
) -> None:
    written = completions(RIGHT, SILENT)
    prompts = [shares(question=1, mattered=1)]
    data = measurement_data(written, paper, ClarifySettings(2, 0.1, 7), prompts)
    path = store_measurement(RunFolder(tmp_path), paper, data)
    assert (path.parent, json.loads(path.read_text())) == (RunFolder(tmp_path).questions("paper"), data)
    results = results_by(paper, written, tmp_path)
    ((found, is_current),) = read_measurements(results)
    assert (found["candidates"], found["noise"], found["seed"], is_current) == (2, 0.1, 7, True)
    assert (found["question"], found["mattered"], found["prompts"][0]["task"]) == (1.0, 1.0, TASK)
    others = [
        results_by(paper, completions(RIGHT, WRONG), tmp_path),
        results_by(paper, [replace(one, prompt=1) for one in written], tmp_path),
        results_by(replace(paper, digest="0"), written, tmp_path),
    ]
    assert [is_current for each in others for _, is_current in read_measurements(each)] == [False] * 3
    store_measurement(RunFolder(tmp_path), paper, {**data, "candidates": 10})
    assert [one["candidates"] for one, _ in read_measurements(results)] == [2, 10]


@pytest.mark.parametrize("content", ["{}", '{"candidates": 2', '{"x": ' + "[" * 100_000])
def test_a_damaged_measurement_is_named(paper: Suite, tmp_path: Path, content: str) -> None:
    path = RunFolder(tmp_path).questions("paper") / "a.json"
    path.parent.mkdir(parents=True)
    path.write_text(content)
    with pytest.raises(UserError, match="clarify") as refused:
        list(read_measurements(results_by(paper, [], tmp_path)))
    assert refused.value.file == path
