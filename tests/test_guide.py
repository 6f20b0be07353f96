"""The guide says what is so."""

import re
from pathlib import Path

from codebotler.simulator.sandbox.stdlib import LISTED

GUIDE = (Path(__file__).parent.parent / "docs" / "index.md").read_text()


def test_the_guide_lists_all_that_a_program_can_import() -> None:
    listed = re.search(r"\n## What a program can import\n.*?```text\n(.*?)```", GUIDE, re.DOTALL)
    assert listed is not None
    assert listed[1].split() == LISTED
