"""Tests that random programs end in the same way under several versions of Python.

    python bench/versions.py 1000 7 ../venv-3.12/bin/python ../venv-3.13/bin/python

This command runs 1,000 random programs with seed 7 under this Python and the others, which need the same
packages. It compares status, kind of error, line and trace, and prints the programs that differ. It does not
compare error messages, because they depend on the version. Run it under the oldest version, because the
programs use the syntax of the Python that generates them.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from codebotler.core.trace import Outcome
from codebotler.core.world import Person, Room, World
from codebotler.simulator.engine import run
from codebotler.simulator.settings import Limits, SimulationSettings

PYTHONS_OWN = re.compile("0x[0-9a-f]+|(?<=maximum recursion depth exceeded)[a-z ]+", re.IGNORECASE)
SETTINGS = SimulationSettings(limits=Limits(ticks=2_000, calls=60))
AMY = Person("amy", ("yes", "no", "hello|kitchen", ".*"))
WORLD = World(
    (
        Room("start_loc", ("mug",), (Person(".*", ("no", "yes")),)),
        Room("kitchen", ("apple", "mug"), (AMY,)),
        Room("conference room", ("stapler",)),
    ),
    "start_loc",
)


def draw_programs(count: int, seed: int) -> list[str]:
    """Return distinct random programs."""
    import hypothesis  # noqa: PLC0415 - not needed under the other versions

    from random_programs import programs  # noqa: PLC0415 - imports hypothesis

    found: dict[str, None] = {}

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=count, database=None, deadline=None, suppress_health_check=list(hypothesis.HealthCheck)
    )
    @hypothesis.given(programs(deep=False))
    def draw(source: str) -> None:
        found[source] = None

    draw()
    return list(found)


def portable(outcome: Outcome) -> list[object]:
    """Return the parts of an outcome that must not depend on the version."""
    trace = [PYTHONS_OWN.sub("", repr(event)) for event in outcome.trace]
    return [outcome.status, outcome.error and outcome.error.kind, outcome.line, trace]


def outcomes(sources: list[str]) -> list[list[object]]:
    """Run programs under this version, and return the parts of their outcomes that are compared."""
    return [portable(outcome) for outcome in run([(s, WORLD) for s in sources], workers=1, settings=SETTINGS)]


def compare(sources: list[str], pythons: list[str]) -> int:
    """Run programs under several versions. Print and count those that differ."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "programs.json")
        file.write_text(json.dumps(sources), encoding="utf-8")
        by_version = {
            python: json.loads(subprocess.check_output([python, __file__, "--outcomes", str(file)]))
            for python in pythons
        }
    different = 0
    for number, source in enumerate(sources):
        came = {python: by_version[python][number] for python in pythons}
        if any(outcome != came[pythons[0]] for outcome in came.values()):
            different += 1
            print(f"--- program {number}\n{source}\n")
            for python, outcome in came.items():
                print(f"{python}: {outcome}")
    return different


def main() -> int:
    """Compare several versions, or run programs for the comparison."""
    match sys.argv[1:]:
        case ["--outcomes", file]:
            print(json.dumps(outcomes(json.loads(Path(file).read_text(encoding="utf-8")))))
            return 0
        case [count, seed, *pythons]:
            sources = draw_programs(int(count), int(seed))
            different = compare(sources, [sys.executable, *pythons])
            print(f"{different} of {len(sources)} programs differ")
            return int(different > 0)
        case _:
            print(__doc__, file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main())
