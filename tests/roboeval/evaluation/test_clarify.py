"""What a question gains is measured with a person who judges options by the task's requirements."""

from collections.abc import Iterator, Sequence

import pytest

from codebotler.core.errors import UserError
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.clarify import (
    DRAWS_PER_PROMPT,
    ClarifiedPrompt,
    ClarifySettings,
    ClarifyTrial,
    clarified_data,
    clarify,
)
from roboeval.evaluation.runs.completions import Completion
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


def measured(
    programs: Sequence[Completion], paper: Suite, pool: WorkerPool, candidates: int = 4, noise: float = 0.0
) -> ClarifiedPrompt:
    (found,) = clarify(programs, paper, pool, ClarifySettings(candidates, noise))
    assert len(found.trials) == DRAWS_PER_PROMPT
    return found


@pytest.mark.slow
def test_a_person_takes_the_option_that_passes(paper: Suite, pool: WorkerPool) -> None:
    found = measured(completions(WRONG, WRONG, RIGHT, SILENT), paper, pool)
    assert {*found.trials} == {ClarifyTrial(0.25, majority=False, question=True, asked=True)}


@pytest.mark.slow
def test_none_of_the_options_counts_as_failed(paper: Suite, pool: WorkerPool) -> None:
    found = measured(completions(WRONG, WRONG, SILENT), paper, pool, 3)
    assert {*found.trials} == {ClarifyTrial(0.0, majority=False, question=False, asked=True)}


@pytest.mark.slow
def test_without_a_question_the_largest_cluster_counts(paper: Suite, pool: WorkerPool) -> None:
    found = measured(completions(RIGHT, RIGHT, RIGHT, WRONG), paper, pool)
    assert {*found.trials} == {ClarifyTrial(0.75, majority=True, question=True, asked=False)}


@pytest.mark.slow
def test_a_person_who_is_always_wrong_never_takes_the_option_that_passes(
    paper: Suite, pool: WorkerPool
) -> None:
    found = measured(completions(RIGHT, RIGHT, WRONG, SILENT), paper, pool, noise=1.0)
    assert {*found.trials} == {ClarifyTrial(0.5, majority=True, question=False, asked=True)}


@pytest.mark.slow
def test_tokens_are_counted_for_a_group(paper: Suite, pool: WorkerPool) -> None:
    assert measured(completions(RIGHT, SILENT, usage=9), paper, pool, 2).tokens == 20
    assert measured(completions(RIGHT, SILENT), paper, pool, 2).tokens is None


def test_too_few_completions_are_refused(paper: Suite, pool: WorkerPool) -> None:
    with pytest.raises(UserError, match="at most 2"):
        next(clarify(completions(RIGHT, WRONG), paper, pool, ClarifySettings(3)))


def trial(*, one: float = 0.5, majority: bool, question: bool, asked: bool = True) -> ClarifyTrial:
    return ClarifyTrial(one, majority, question, asked)


def test_shares_are_of_all_trials_but_what_mattered_is_of_questions() -> None:
    gains = trial(majority=False, question=True)
    silent = trial(one=1.0, majority=True, question=True, asked=False)
    useless = trial(one=0.0, majority=True, question=True)
    data = clarified_data(
        [ClarifiedPrompt("A", 0, (gains, silent)), ClarifiedPrompt("A", 1, (useless, useless), 30)]
    )
    first, second = data["prompts"]
    assert {
        name: first[name] for name in ("task", "prompt", "one", "majority", "question", "asked", "mattered")
    } == {
        "task": "A",
        "prompt": 0,
        "one": 0.75,
        "majority": 0.5,
        "question": 1.0,
        "asked": 0.5,
        "mattered": 1.0,
    }
    assert (second["mattered"], second["tokens"]) == (0.0, 30)
    assert (data["one"], data["asked"], data["mattered"], data["tokens"]) == (0.375, 0.75, 1 / 3, 30)


def test_nothing_mattered_without_a_question() -> None:
    silent = trial(majority=True, question=True, asked=False)
    assert clarified_data([ClarifiedPrompt("A", 0, (silent,))])["mattered"] is None
