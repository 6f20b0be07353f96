"""The page about mutation agrees with the operators and the command."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from command_line import ENVIRONMENT, roboeval
from roboeval.mutation.mutants import MUTATION_OPERATORS

PAGE = (Path(__file__).parents[3] / "docs" / "roboeval-plus.md").read_text()
WIDE = {**ENVIRONMENT, "COLUMNS": "160"}


def test_operators_are_documented() -> None:
    (table,) = re.findall(r"^\| operator \|.+\n(?:\|.+\n)+", PAGE, re.MULTILINE)
    rows = re.findall(r"^\| `([a-z-]+)` \| (.+) \|$", table, re.MULTILINE)
    assert rows == [(operator.name, operator.about) for operator in MUTATION_OPERATORS]


@pytest.mark.slow
def test_the_command_runs_and_prints_what_the_page_says(tmp_path: Path) -> None:
    (command,) = re.findall(r"^\.venv/bin/roboeval (mutate .+ --out .+)$", PAGE, re.MULTILINE)
    ended = roboeval(*shlex.split(command), cwd=tmp_path, environment=WIDE)
    assert ended.status == 0, ended
    assert {path.name for path in (tmp_path / "mutants").rglob("*.*")} == {
        "scores.json",
        "SayGoodDay.jsonl",
        "SayGoodDay.yaml",
    }
    (printed,) = re.findall(r"^SayGoodDay +\d+ +\d+ .*", ended.out, re.MULTILINE)
    documented = re.search(
        r"Scores of the suite `paper`.*?^(SayGoodDay .*?)$", PAGE, re.DOTALL | re.MULTILINE
    )
    assert documented is not None
    assert printed.split() == documented[1].split()
