"""`codebotler check`: read a program, and show the result of the check and the contract."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from codebotler.checking.contracts.file import contract_yaml
from codebotler.checking.contracts.text import contract_rows, contract_sentence
from codebotler.checking.problems import CheckResult, Problem, Sample
from codebotler.checking.storyboard import grid, steps_of, storyboard
from codebotler.cli.programs.skills import write_new
from codebotler.core.errors import UserError
from codebotler.core.files import MAX_FILE_BYTES, decode_text, read_text
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import note, shortened, visible
from codebotler.core.text.words import counted, elide_list
from codebotler.core.trace import RunError
from codebotler.prompts.extract import program_in
from codebotler.simulator.guard.contract import Contract

STANDARD_INPUT = "standard input"
CONTEXT_LINES = 1
"""The number of lines to show before and after a line with a problem."""
MAX_ROOMS_SHOWN = 12
PROOF_STYLES = {"never": "green", "possible": "red", "unknown": "yellow"}


def read_program(name: str) -> str:
    """Read a program file, or find the program in standard input (`-`), which may be a model's reply."""
    if name == "-":
        text = program_in(decode_text(sys.stdin.buffer.read(MAX_FILE_BYTES + 1), STANDARD_INPUT))
    else:
        text = read_text(Path(name))
    if not text.strip():
        raise UserError("no program found", file=STANDARD_INPUT if name == "-" else name)
    return text


def check_view(found: CheckResult, program: str, name: str, *, shows_all: bool = False) -> RenderableType:
    """Return a check for printing: verdict, problems, and one run or, if `shows_all`, all different runs."""
    parts: list[RenderableType] = [_verdict(found, name)]
    lines = program.rstrip("\n").split("\n")
    for problem in found.problems:
        parts += [Text(), *_problem(problem, lines)]
    parts += [Text(), _rooms(found)]
    parts += [Text(f"{found.vain_runs}; this is not a problem", "dim")] if found.vain_runs else []
    parts += [Text(found.assumption, "dim")] if found.assumption else []
    for proof in found.proofs:
        parts.append(Text(f'the rule "{proof.rule}" {proof.in_words}', PROOF_STYLES[proof.verdict]))
    kinds = _distinct_samples(found)
    for sample in kinds if shows_all else kinds[:1]:
        parts += [Text(), *_sample(sample)]
    if len(kinds) > 1 and not shows_all:
        parts += [Text(), Text(f"this is 1 of {len(kinds)} different outcomes; --all shows them", "dim")]
    return Group(*parts)


def _verdict(found: CheckResult, name: str) -> Text:
    count = len(found.problems)
    if not count:
        verdict = Text.assemble(("accepted", "bold green"), f": no problem in {visible(name)}")
    else:
        verdict = Text.assemble(("rejected", "bold red"), f": {counted(count, 'problem')} in {visible(name)}")
    if not found.samples:
        run = "the program was not run"
    elif not any(sample.draws for sample in found.samples):
        run = "the program behaves the same in all imagined worlds"
    else:
        run = f"run in {counted(len(found.samples), 'imagined world')} with random people and objects"
    return verdict.append(f"\n{run}", "dim")


def _problem(problem: Problem, lines: list[str]) -> Iterator[RenderableType]:
    yield Text(shortened(problem.sentence), "red")
    if problem.line is None:
        return
    first, last = max(1, problem.line - CONTEXT_LINES), min(len(lines), problem.line + CONTEXT_LINES)
    width = len(str(last))
    for number in range(first, last + 1):
        mark, style = (">", "bold") if number == problem.line else (" ", "dim")
        text = shortened(lines[number - 1].expandtabs(4))
        yield Text(f"{mark} {number:{width}} | {text}", style)


def _rooms(found: CheckResult) -> Text:
    rooms = ", ".join(elide_list([f'"{shortened(room, 60)}"' for room in found.rooms], MAX_ROOMS_SHOWN))
    if not found.rooms_are_guessed:
        return Text(f"rooms: {rooms}", "dim")
    return Text(f"rooms named by the program: {rooms}\nto find misspelled rooms, add --world FILE", "yellow")


def _distinct_samples(found: CheckResult) -> list[Sample]:
    """Return one sample of each different behaviour: first those with problems, then long successful runs."""

    def rank(sample: Sample) -> tuple[bool, bool, bool, int]:
        error, trace = sample.outcome.error, sample.outcome.trace
        return sample.number not in found.evidence, error is not None, sample.in_vain, -len(trace)

    different: dict[tuple[str, RunError | None], Sample] = {}
    for sample in found.samples:
        different.setdefault((str(steps_of(sample.outcome.trace)), sample.outcome.error), sample)
    return sorted(different.values(), key=rank)


def _sample(sample: Sample) -> Iterator[RenderableType]:
    where = f", where {shortened(sample.world, 1_000)}" if sample.world else ""
    yield Text.assemble(("what the robot would do", "bold"), where)
    steps = steps_of(sample.outcome.trace, has_places=True, has_waits=True)
    yield storyboard(steps, set())
    if sample.outcome.error is not None:
        error = f"{sample.outcome.error.kind}: {shortened(sample.outcome.error.message)}"
        yield Padding(Text(error, "red"), (0, 0, 0, 4))


# --- contracts


def contract_view(contract: Contract, skills: SkillTable) -> Group:
    """Return a contract for printing: a sentence or two, and a table with a row for each skill."""
    sentence = contract_sentence(contract, skills, shortened)
    head = Text.assemble(("\nwhat it may do at most", "bold"), f"\n{sentence}\n")
    table = grid("left", "left", "left")
    for what, allowed, often in contract_rows(contract, skills, shortened):
        table.add_row(Text(what, "bold"), Text(allowed), Text(often, "dim"))
    return Group(head, table)


def write_contract(file: Path | None, contract: Contract | None) -> None:
    """Write a contract to a new file, if one is named. Raise UserError if it exists or `contract` is None."""
    if file is None:
        return
    if contract is None:
        raise UserError("no contract could be derived from the program; correct its problems first")
    write_new(file, contract_yaml(contract))
    note(f"wrote {file}")
