"""Measures `codebotler replay` of many programs under ten house rules, compared with `codebotler check`.

    python bench/replay.py [PROGRAMS]

The programs are made here. Each has some ten skill calls, and every second one breaks a rule. The script
prints the seconds of one `replay` of all of them, first with tame programs and then with wild ones, and the
ratio to `check`, which takes one program per command and is measured on a sample.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAMS = int(sys.argv[1]) if len(sys.argv) > 1 else 200
SAMPLE = 10  # Programs to check, each with a separate command.
SECONDS = 20.0
"""The target for replaying 200 programs on two cores."""

WORLD = """
robot: hall
rooms: [hall, kitchen, office, vault]
objects: {kitchen: [mug, knife, pan]}
people: {office: [{name: Ann, answers: ["no"]}]}
"""
RULES = [f'not tr.AtLeast(at("kitchen", pick("thing {number}")), {number + 2})' for number in range(8)]
RULES += ['not tr.Exists(goto("vault"))', 'not tr.Exists(answered("no"))']
BREAKING = ('go_to("vault")', 'say("it is here")', 'ask("Ann", "Tea?", ["yes", "no"])', 'say("no tea")')
PROGRAM = """def task_program():
    go_to("kitchen")
    say("looking for thing {number}")
    if is_in_room("{thing}"):
        pick("{thing}")
        go_to("office")
        place("{thing}")
    go_to("hall")
    say(f"back in {{get_current_location()}}")
    go_to("office")
    {breaking}
    say("done {number}")
"""
WILD = "getattr(str, 'upper')\n"  # too dynamic to share a process with other programs


def write_files(folder: Path) -> None:
    """Write the world, the rules, and the programs in two folders."""
    rules = "".join(
        f"  - {{name: rule-{number}, says: Rule {number}., always: '{formula}'}}\n"
        for number, formula in enumerate(RULES)
    )
    (folder / "house.yaml").write_text(f"rules:\n{rules}")
    (folder / "world.yaml").write_text(WORLD)
    for kind, more in (("tame", ""), ("wild", WILD)):
        (folder / kind).mkdir()
        for number in range(PROGRAMS):
            thing, breaking = ("mug", "knife", "pan", "book")[number % 4], BREAKING[number // 4 % 4]
            program = PROGRAM.format(number=number, thing=thing, breaking=breaking)
            (folder / kind / f"{number:04}.py").write_text(program + more)


def seconds(folder: Path, *arguments: str) -> float:
    """Run a command in a folder, and return the seconds it took."""
    words = [sys.executable, "-m", "codebotler", *arguments, "--world", "world.yaml", "--rules", "house.yaml"]
    start = time.perf_counter()
    ended = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if ended.stderr.startswith("codebotler: "):
        sys.exit(ended.stderr)
    return time.perf_counter() - start


def main() -> int:
    """Print the seconds. Return 1 if the target is missed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(folder)
        chosen = range(0, PROGRAMS, max(1, PROGRAMS // SAMPLE))
        checks = [seconds(folder, "check", f"tame/{number:04}.py") for number in chosen]
        check = PROGRAMS * sum(checks) / len(checks)
        print(f"check, one program per command: {check:6.1f} s for {PROGRAMS} programs")
        replays = {kind: seconds(folder, "replay", kind) for kind in ("tame", "wild")}
    for kind, spent in replays.items():
        print(f"replay of {kind} programs:       {spent:6.1f} s, {spent / check:.4f} of that")
    is_reached = max(replays.values()) <= SECONDS * PROGRAMS / 200
    print("target met" if is_reached else "target MISSED")
    return 0 if is_reached else 1


if __name__ == "__main__":
    sys.exit(main())
