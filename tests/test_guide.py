"""The guide says what is so."""

import re
from pathlib import Path

from codebotler.simulator.engine import run
from codebotler.simulator.sandbox.stdlib import LISTED
from codebotler.trace import Status
from codebotler.world import Room, World

GUIDE = (Path(__file__).parent.parent / "docs" / "index.md").read_text()


def test_the_guide_lists_all_that_a_program_can_import() -> None:
    listed = re.search(r"\n## What a program can import\n.*?```text\n(.*?)```", GUIDE, re.DOTALL)
    assert listed is not None
    assert listed[1].split() == LISTED


def test_a_program_can_import_what_listed_modules_are_made_of() -> None:
    told = re.search(r"made of, such as (.*?), can be imported", GUIDE, re.DOTALL)
    assert told is not None
    names = re.findall("`(.+?)`", told[1])
    assert names
    assert not set(names) & set(LISTED)
    world = World((Room("hall"),), "hall")
    programs = [f"import {name}\ndef task_program():\n    pass\n" for name in [*names, "numpy"]]
    *can, cannot = run([(program, world) for program in programs], workers=1)
    assert {outcome.status for outcome in can} == {Status.FINISHED}
    assert cannot.status is Status.PYTHON_ERROR
