"""The pane with the contract: what the program may do at most."""

from __future__ import annotations

from nicegui import ui

from codebotler.checking.contracts.text import contract_rows, contract_sentence
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import shortened, visible
from codebotler.missions.display.view import SessionView
from codebotler.simulator.guard.contract import Contract
from codebotler.web.frame import PlainText


class ContractPane:
    """Shows the contract of the checked program, and what the last program's contract did not allow."""

    def __init__(self, skills: SkillTable) -> None:
        self._skills = skills
        self._drawn: tuple[object, ...] = ()
        self._box = ui.element("div").classes("contract")
        self._box.set_visibility(False)

    def show(self, view: SessionView) -> None:
        """Update the pane for a view."""
        contract = view.contract
        self._box.set_visibility(contract is not None)
        if contract is not None and (contract, view.earlier) != self._drawn:
            self._drawn = contract, view.earlier
            self._box.clear()
            with self._box:
                self._draw(contract, view.earlier)

    def _draw(self, contract: Contract, earlier: Contract | None) -> None:
        PlainText("h3", "What it may do at most")
        sentence = contract_sentence(contract, self._skills)
        PlainText("p", visible(sentence))
        if earlier is not None:
            new, is_narrower = contract.beyond(earlier), bool(earlier.beyond(contract).skills)
            same = "Less than the draft before." if is_narrower else "The same as the draft before."
            PlainText("p", "More than the draft before:" if new.skills else same)
            if new.skills:
                self._table(new)
        is_cut = sentence != contract_sentence(contract, self._skills, is_short=False)
        with ui.element("details").props("open" if is_cut else ""):
            PlainText("summary", "The whole contract")
            self._table(contract)

    def _table(self, contract: Contract) -> None:
        with ui.element("table"), ui.element("tbody"):
            for what, allowed, often in contract_rows(contract, self._skills, shortened):
                with ui.element("tr"):
                    PlainText("th", what).props("scope=row")
                    PlainText("td", allowed)
                    PlainText("td", often, "quiet")
