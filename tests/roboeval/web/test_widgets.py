"""Short texts about runs on pages."""

from __future__ import annotations

from dataclasses import replace

from roboeval.analysis.metrics import Estimate
from roboeval.web.widgets import score_text


def test_an_interval_without_width_is_unknown() -> None:
    mean = Estimate(1.0, 1.0, 1.0, "tasks")
    assert score_text(mean) == "pass@1 1.000 (95% interval over tasks unknown: no variation between tasks)"
    known = replace(mean, low=0.8)
    assert score_text(known) == "pass@1 1.000 (95% interval over tasks 0.800 to 1.000)"
