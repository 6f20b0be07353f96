"""A part of a run as tables, and that nothing a model wrote reaches the terminal as more than text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from made_results import results_of, table_of
from roboeval.analysis.counts import tally_of
from roboeval.analysis.summary import summary
from roboeval.analysis.tasks import Selection, parse_selection, task_data
from roboeval.cli.views.results import summary_view, task_view
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.scope import Scope
from small_run import HOSTILE, ROWS, SHOWN, SUITE, printed, row


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
        "models": [],
        "completions": 2,
        "gone": 0,
        "passed": 1,
        "pass@1": 0.5,
        "failures": [failure],
    }
    text = printed(task_view(task_data(results(*completions), "Visit")))
    assert "Visit/0  1 of 2 passed (pass@1 0.50)\nVisit her.\n" in text
    assert "  1  Python error: NameError  such as Visit/0/1\n" in text


def test_an_instruction_that_nobody_recorded_is_never_taken_from_the_suite() -> None:
    completions = [Completion(task="Visit", prompt=prompt, index=0, program="") for prompt in range(2)]
    text = printed(task_view(task_data(results(*completions), "Visit")))
    assert text.count("instruction not recorded") == 2
    assert "Go to Alice." not in text


@pytest.mark.parametrize("colour", [False, True])
def test_what_a_model_wrote_is_text(*, colour: bool) -> None:
    rows = [row(0, 0, ("PythonError", HOSTILE))]
    completions = [Completion(task="Visit", prompt=0, index=0, program="", instruction=HOSTILE)]
    views = [
        summary_view(summary(tally_of(table_of(rows)), SUITE, Scope({})), title=HOSTILE),
        task_view(task_data(results(*completions, rows=rows), "Visit")),
    ]
    for view in views:
        text = printed(view, colour=colour)
        assert text.count(SHOWN) == 2
        assert "\x1b[2J" not in text
        text.encode()


def test_visible_keeps_what_can_be_seen() -> None:
    assert visible("naïve 日本 → [x]") == "naïve 日本 → [x]"
    assert visible("a\tb\u200b\x9b") == r"a\tb\u200b\x9b"


def test_a_selection_is_read() -> None:
    assert parse_selection(None, SUITE) == Selection()
    assert parse_selection("Visit", SUITE) == Selection("Visit")
    assert parse_selection("visit/1/", SUITE) == Selection("Visit", 1)
    assert parse_selection("Visit/1/007", SUITE) == Selection("Visit", 1, 7)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("Dance", ['"small"', '"Dance"', "Visit, Wait"]),
        ("Visit/2", ["Visit/2", "0 to 1"]),
        ("Visit/-1", ['"Visit/-1"', "TASK/PROMPT/INDEX"]),
        ("Visit/0/x", ['"Visit/0/x"', "TASK/PROMPT/INDEX"]),
        ("Visit//0", ['"Visit//0"', "TASK/PROMPT/INDEX"]),
        ("Visit/0/0/0", ['"Visit/0/0/0"', "TASK/PROMPT/INDEX"]),
        ("Visit/\u0661", ['"Visit/\u0661"', "TASK/PROMPT/INDEX"]),
    ],
)
def test_a_wrong_selection_is_explained(text: str, named: list[str]) -> None:
    with pytest.raises(UserError) as error:
        parse_selection(text, SUITE)
    assert all(name in error.value.sentence for name in named), error.value


@pytest.mark.parametrize(
    ("selection", "named"),
    [
        (Selection("Wait"), "no completion of Wait "),
        (Selection("Visit", 0, 9), "no completion Visit/0/9 "),
    ],
)
def test_a_selection_without_rows_is_an_error(selection: Selection, named: str) -> None:
    with pytest.raises(UserError, match=named):
        selection.expect_judged(results_of(ROWS))
