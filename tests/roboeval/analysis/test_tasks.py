"""Tables of a part of a run, in which everything that a model wrote stays text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from codebotler.core.terminal import visible
from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from made_results import results_of, table_of
from roboeval.analysis.counting.counts import tally_of
from roboeval.analysis.counting.summary import summarise
from roboeval.analysis.counting.tasks import prompt_data, task_data
from roboeval.cli.views.completions import prompt_view
from roboeval.cli.views.results import summary_view, task_view
from roboeval.evaluation.judging.explanation import INSTRUCTION_NOT_RECORDED, OF_SUITE
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.scope import JudgingScope
from small_run import HOSTILE, ROWS, SHOWN, SUITE, row, text_of


def results(*completions: Completion, rows: Sequence[Mapping[str, Any]] = ROWS) -> Results:
    return results_of(rows, SUITE, completions=completions)


def test_a_task_is_shown_prompt_by_prompt() -> None:
    completions = [
        Completion(task="Visit", prompt=0, index=i, program="", instruction="Visit her.") for i in range(2)
    ]
    data = task_data(results(*completions), "Visit")
    failure = {"class": "PythonError", "kind": "NameError", "count": 1, "example": 1}
    assert data["prompts"][0] == {
        "prompt": 0,
        "instructions": ["Visit her."],
        "suite_instruction": SUITE.tasks["Visit"].prompts[0],
        "models": [],
        "completions": 2,
        "requested": None,
        "passed": 1,
        "pass@1": 0.5,
        "failures": [failure],
    }
    text = text_of(task_view(task_data(results(*completions), "Visit")))
    assert "Visit/0  1 of 2 passed (pass@1 0.50)\nVisit her.\n" in text
    assert "  1  Python error: NameError  such as Visit/0/1\n" in text


def test_a_prompt_with_missing_completions_shows_the_requested_number() -> None:
    about = {"batches": [{"tasks": None, "num_completions": 5}]}
    data = task_data(replace(results(), about=about), "Visit")
    assert [prompt["requested"] for prompt in data["prompts"]] == [5, 5]
    assert "Visit/0  1 of 2 passed (pass@1 0.50); 5 were requested\n" in text_of(task_view(data))


def test_replies_without_a_program_are_explained() -> None:
    found = results(rows=[row(0, 0, ("NoProgram", "cut-off"))])
    text = text_of(prompt_view(prompt_data(found, "Visit", 0)))
    assert "no program: cut-off" in text
    assert NO_PROGRAM_SENTENCES["cut-off"] in text


def test_the_suites_instruction_is_marked_if_none_was_recorded() -> None:
    completions = [Completion(task="Visit", prompt=prompt, index=0, program="") for prompt in range(2)]
    text = text_of(task_view(task_data(results(*completions), "Visit")))
    for instruction in SUITE.tasks["Visit"].prompts:
        assert f"{INSTRUCTION_NOT_RECORDED}; {OF_SUITE}\n{instruction}\n" in text


@pytest.mark.parametrize("colour", [False, True])
def test_hostile_text_of_a_model_stays_text(*, colour: bool) -> None:
    rows = [row(0, 0, ("PythonError", HOSTILE))]
    completions = [Completion(task="Visit", prompt=0, index=0, program="", instruction=HOSTILE)]
    views = [
        summary_view(summarise(tally_of(table_of(rows)), SUITE, JudgingScope({})), title=HOSTILE),
        task_view(task_data(results(*completions, rows=rows), "Visit")),
    ]
    for view in views:
        text = text_of(view, colour=colour)
        assert text.count(SHOWN) == 2
        assert "\x1b[2J" not in text
        text.encode()


def test_visible_escapes_only_invisible_characters() -> None:
    assert visible("naïve 日本 → [x]") == "naïve 日本 → [x]"
    assert visible("a\tb\u200b\x9b") == r"a\tb\u200b\x9b"
