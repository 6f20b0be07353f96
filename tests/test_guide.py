"""The guide says what is so."""

import re
from pathlib import Path

from codebotler.checker import check
from codebotler.simulator.engine import run
from codebotler.simulator.sandbox.stdlib import LISTED
from codebotler.trace import Status
from codebotler.world import Room, World

DOCS = Path(__file__).parent.parent / "docs"
GUIDE = (DOCS / "index.md").read_text()


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


def test_the_keys_of_a_check_are_documented() -> None:
    page = (DOCS / "imagined-worlds.md").read_text().partition("## JSON")[2]
    documented = [re.findall(r"`(\w+)`", row) for row in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE)]
    data = check("def task_program():\n    go_to('a')\n    say(b)\n").data()
    told = [*data, *data["problems"][0], *data["samples"][0]]
    assert [key for keys in documented for key in keys] == told
