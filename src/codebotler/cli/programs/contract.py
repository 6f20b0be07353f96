"""Show contracts on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import Group
from rich.text import Text

from codebotler.checking.contracts.file import contract_yaml
from codebotler.checking.contracts.text import contract_rows, contract_sentence
from codebotler.checking.problems import CheckResult
from codebotler.checking.storyboard import grid
from codebotler.cli.programs.skills import write_new
from codebotler.core.errors import UserError
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import note, shortened
from codebotler.simulator.guard.contract import Contract


def contract_view(contract: Contract, skills: SkillTable) -> Group:
    """Show what a program may do at most: in a sentence or two, and in a table with a row for each skill."""
    sentence = contract_sentence(contract, skills, shortened)
    head = Text.assemble(("\nwhat it may do at most", "bold"), f"\n{sentence}\n")
    table = grid("left", "left", "left", "left")
    for row in contract_rows(contract, skills, shortened):
        table.add_row(Text(row.what, "bold"), Text(row.texts), Text(row.places), Text(row.at_most, "dim"))
    return Group(head, table)


def write_contract(file: Path | None, contract: Contract | None) -> None:
    """Write a contract to a new file, if one is named. Raise UserError if there is none, or if it exists."""
    if file is None:
        return
    if contract is None:
        raise UserError("the program has no contract, since it cannot run")
    write_new(file, contract_yaml(contract))
    note(f"wrote {file}")


def proof_lines(found: CheckResult) -> Iterator[Text]:
    """Show what is proved of each house rule."""
    styles = {"never": "green", "possible": "red", "unknown": "yellow"}
    for proof in found.proofs:
        yield Text(f'the rule "{proof.rule}" {proof.words}', styles[proof.verdict])
