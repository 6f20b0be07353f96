"""The verdicts of `plus` agree with a fair reader, who knew only the instructions."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.suites.load import load_suite

FAIR = Path(__file__).parent / "fair"
AT_LEAST = 0.98


def read_programs(name: str) -> list[tuple[str, dict[str, Any]]]:
    """Return the programs of a set, each with its task, prompt, label and reason."""
    files = sorted((FAIR / name).glob("*.yaml"))
    return [(file.stem, one) for file in files for one in yaml.safe_load(file.read_text(encoding="utf-8"))]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "second", "third"])
def test_verdicts_are_those_of_a_fair_reader(name: str) -> None:
    labelled = read_programs(name)
    assert len(labelled) == 160
    assert sum(one["label"] == "right" for _, one in labelled) == 80
    completions = [
        Completion(task=task, prompt=one["prompt"], index=index, program=one["program"])
        for index, (task, one) in enumerate(labelled)
    ]
    passed = [row["passed"] for row in evaluate(completions, load_suite("plus"), workers=2)]
    right = [one["label"] == "right" for _, one in labelled]
    both = sum(one and other for one, other in zip(passed, right, strict=True))
    otherwise = [
        (task, one["prompt"], one["label"], one["reason"])
        for (task, one), was in zip(labelled, passed, strict=True)
        if was != (one["label"] == "right")
    ]
    assert both >= AT_LEAST * sum(passed), otherwise
    assert both >= AT_LEAST * sum(right), otherwise
