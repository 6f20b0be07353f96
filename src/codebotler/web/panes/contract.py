"""The part of the page with the contract: what the program may do at most."""

from __future__ import annotations

from nicegui import ui

from codebotler.checking.contracts.text import contract_rows, contract_sentence
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import shortened, visible
from codebotler.simulator.guard.contract import Contract
from codebotler.web.frame import PlainText


def draw_contract(skills: SkillTable, contracts: tuple[Contract, Contract | None]) -> None:
    """Draw the first contract, and what it adds to the second, which is the previous draft's, if any."""
    contract, earlier = contracts
    PlainText("h3", "What it may do at most")
    sentence = contract_sentence(contract, skills)
    PlainText("p", visible(sentence))
    if earlier is not None:
        new, is_narrower = contract.excess_over(earlier), bool(earlier.excess_over(contract).skills)
        same = "Less than the draft before." if is_narrower else "The same as the draft before."
        PlainText("p", "More than the draft before:" if new.skills else same)
        if new.skills:
            _draw_table(skills, new)
    is_cut = sentence != contract_sentence(contract, skills, is_short=False)
    with ui.element("details").props("open" if is_cut else ""):
        PlainText("summary", "The whole contract")
        _draw_table(skills, contract)


def _draw_table(skills: SkillTable, contract: Contract) -> None:
    with ui.element("table"), ui.element("tbody"):
        for what, allowed, often in contract_rows(contract, skills, shortened):
            with ui.element("tr"):
                PlainText("th", what).props("scope=row")
                PlainText("td", allowed)
                PlainText("td", often, "quiet")
