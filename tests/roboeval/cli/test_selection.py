"""The part of a run that a user names."""

from __future__ import annotations

import pytest

from codebotler.core.errors import UserError
from made_results import results_of
from roboeval.cli.inputs import Selection, expect_judged, names_completion, parse_selection
from small_run import ROWS, SUITE


def test_a_selection_is_read() -> None:
    assert parse_selection("Visit", SUITE) == ("Visit",)
    assert parse_selection("visit/1/", SUITE) == ("Visit", 1)
    assert parse_selection("Visit/1/007", SUITE) == ("Visit", 1, 7)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("Dance", ['"small"', '"Dance"', "Visit, Wait"]),
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
        (("Wait",), "no completion of Wait "),
        (("Visit", 0, 9), "no completion of Visit/0/9 "),
        (("Visit", 2), "no completion of Visit/2 "),
    ],
)
def test_a_selection_without_rows_is_an_error(selection: Selection, named: str) -> None:
    with pytest.raises(UserError, match=named):
        expect_judged(selection, results_of(ROWS).places)


def test_only_all_three_parts_name_a_completion() -> None:
    named = "Visit/0/1", "Visit/0/1/"
    others = "", "Visit", "Visit/0", "Visit/0/", "Visit/0/1/2"
    assert all(map(names_completion, named))
    assert not any(map(names_completion, others))
