"""What pages say of a run in a few words."""

from __future__ import annotations

from typing import Any

import pytest

from roboeval.web.widgets import completions_text, score_text


@pytest.mark.parametrize(
    ("judged", "requested", "text"),
    [
        (1, 1, "1 of 1 completion"),
        (2, None, "2 of 2 completions"),
        (1, 2, "1 of 2 completions (1 missing)"),
    ],
)
def test_completions_are_counted_with_their_noun(judged: int, requested: int | None, text: str) -> None:
    data = {"completions": judged, "requested": requested, "judged": judged, "to_judge": judged}
    assert completions_text(data) == text


def test_an_interval_without_width_is_unknown() -> None:
    mean: dict[str, Any] = {"mean": 1.0, "low": 1.0, "high": 1.0, "over": "tasks"}
    assert (
        score_text({"pass@1": mean})
        == "pass@1 1.000 (95% interval over tasks unknown: no variation between tasks)"
    )
    known = {**mean, "low": 0.8}
    assert score_text({"pass@1": known}) == "pass@1 1.000 (95% interval over tasks 0.800 to 1.000)"
