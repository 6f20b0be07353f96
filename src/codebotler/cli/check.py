"""`codebotler check`: reads a program, and shows what a check found."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from codebotler.checking.problems import Check, Problem, Sample
from codebotler.checking.storyboard import steps_of, storyboard
from codebotler.core.errors import UserError
from codebotler.core.files import MOST_FILE_BYTES, read_text, text_of
from codebotler.core.terminal import shortened, visible
from codebotler.core.trace import RunError
from codebotler.prompts.extract import program_in

INPUT = "standard input"
AROUND = 1
"""Lines that are shown before and after one that is to blame."""

MOST_ROOMS = 12


def read_program(name: str) -> str:
    """The program in a file, or on standard input (`-`), where it may be a model's whole reply."""
    if name != "-":
        if not name:
            raise UserError("the file name is empty; name a file, or - for standard input")
        text = read_text(Path(name))
        if not text.strip():
            raise UserError("it contains no program", file=name)
        return text
    text = text_of(sys.stdin.buffer.read(MOST_FILE_BYTES + 1), INPUT)
    if not text.strip():
        raise UserError("is empty; pipe a program or a model's reply into it", file=INPUT)
    return program_in(text)


def check_view(found: Check, program: str, name: str, *, shows_all: bool = False) -> RenderableType:
    """What a check found, for a person: the verdict, the problems, and what the robot would do.

    By default that is shown in one imagined world, with `shows_all` in one of each kind.
    """
    parts: list[RenderableType] = [_verdict(found, name)]
    lines = program.rstrip("\n").split("\n")
    for problem in found.problems:
        parts += [Text(), *_problem(problem, lines)]
    parts += [Text(), _rooms(found), *_in_vain(found)]
    kinds = _kinds(found)
    for sample in kinds if shows_all else kinds[:1]:
        parts += [Text(), *_sample(sample)]
    if len(kinds) > 1 and not shows_all:
        parts += [Text(), Text(f"this is 1 of {len(kinds)} different courses; --all shows them", "dim")]
    return Group(*parts)


def _verdict(found: Check, name: str) -> Text:
    count = len(found.problems)
    if not count:
        verdict = Text.assemble(("accepted", "bold green"), f": no problem in {visible(name)}")
    else:
        what = "1 problem" if count == 1 else f"{count} problems"
        verdict = Text.assemble(("rejected", "bold red"), f": {what} in {visible(name)}")
    if not found.samples:
        ran = "it was not run"
    elif not any(sample.draws for sample in found.samples):
        ran = "it does the same in every world"
    else:
        worlds = f"{len(found.samples)} imagined world{'s'[: len(found.samples) > 1]}"
        ran = f"run in {worlds}, where people and things are put by chance"
    return verdict.append(f"\n{ran}", "dim")


def _problem(problem: Problem, lines: list[str]) -> Iterator[RenderableType]:
    yield Text(shortened(problem.sentence), "red")
    if problem.line is None:
        return
    first, last = max(1, problem.line - AROUND), min(len(lines), problem.line + AROUND)
    width = len(str(last))
    for number in range(first, last + 1):
        mark, style = (">", "bold") if number == problem.line else (" ", "dim")
        text = shortened(lines[number - 1].expandtabs(4))
        yield Text(f"{mark} {number:{width}} | {text}", style)


def _rooms(found: Check) -> Text:
    shown = [f'"{shortened(room, 60)}"' for room in found.rooms[:MOST_ROOMS]]
    left = len(found.rooms) - len(shown)
    rooms = ", ".join([*shown, *([f"and {left} more"] if left > 0 else [])])
    if not found.rooms_are_guessed:
        return Text(f"rooms: {rooms}", "dim")
    told = f"rooms named by the program: {rooms}"
    return Text(f"{told}\nto find misspelled rooms, add --world FILE", "yellow")


def _in_vain(found: Check) -> Iterator[Text]:
    count = sum(sample.in_vain for sample in found.samples)
    if 0 < count < len(found.samples):
        often = f"{count} of {len(found.samples)} worlds"
        yield Text(
            f"in {often} the robot waits or searches without success, which is not counted as a problem",
            "dim",
        )


def _kinds(found: Check) -> list[Sample]:
    """A sample of each kind of world in which the robot does something else.

    First come those that show a problem, and then what says most about what the robot is to do: those that
    end well, the longest first.
    """

    def rank(sample: Sample) -> tuple[bool, bool, bool, int]:
        outcome = sample.outcome
        return (
            sample.number not in found.showing,
            outcome.error is not None,
            sample.in_vain,
            -len(outcome.trace),
        )

    different: dict[tuple[str, RunError | None], Sample] = {}
    for sample in found.samples:
        different.setdefault((str(steps_of(sample.outcome.trace)), sample.outcome.error), sample)
    return sorted(different.values(), key=rank)


def _sample(sample: Sample) -> Iterator[RenderableType]:
    where = f", where {shortened(sample.world, 1_000)}" if sample.world else ""
    yield Text.assemble(("what the robot would do", "bold"), where)
    steps = steps_of(sample.outcome.trace, has_places=True)
    yield storyboard(steps, set())
    if sample.outcome.error is not None:
        told = f"{sample.outcome.error.kind}: {shortened(sample.outcome.error.message)}"
        yield Padding(Text(told, "red"), (0, 0, 0, 4))
