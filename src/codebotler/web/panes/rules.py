"""The pane with the house rules, which can be switched off for one program."""

from __future__ import annotations

import asyncio
from collections.abc import Container, Iterable
from functools import partial

from nicegui import ui

from codebotler.checking.problems import RuleProof
from codebotler.core.terminal import shortened
from codebotler.missions.display.view import SessionView
from codebotler.simulator.guard.house_rule import Rule
from codebotler.web.console import Console
from codebotler.web.frame import Button, DrawnBox, PlainText

_MAX_RULES, _MAX_RULE_CHARACTERS, _MAX_SWITCH_OFF_REASON = 100, 300, 500


class RulesPane:
    """Lists the house rules, if there are any."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._box = DrawnBox("house-rules", self._draw)

    def show(self, view: SessionView) -> None:
        """Show which rules are in force. Let a person switch them off while the program awaits approval."""
        proofs = () if view.check is None else view.check.proofs
        if self._console.rules:
            self._box.show((view.disabled_rules, view.may_be_approved, proofs))

    def _draw(self, content: tuple[Container[str], bool, Iterable[RuleProof]]) -> None:
        disabled, may_be_approved, found = content
        PlainText("h3", "House rules")
        proofs = {proof.rule: proof for proof in found}
        with ui.element("ul"):
            for rule in self._console.rules[:_MAX_RULES]:
                is_off = rule.name in disabled
                with ui.element("li").classes("off" if is_off else ""):
                    with ui.element("div"):
                        PlainText("span", shortened(rule.says, _MAX_RULE_CHARACTERS))
                        if rule.name in proofs:
                            PlainText("small", f"It {proofs[rule.name].in_words}.", "quiet")
                    if is_off:
                        PlainText("small", "switched off for this program", "quiet")
                    elif may_be_approved:
                        off = Button("Switch off …", partial(self._ask_why, rule), "plain small")
                        off.props(f'aria-label="Switch off the rule {rule.name} for this program"')

    def _ask_why(self, rule: Rule) -> None:
        with ui.dialog() as dialog, ui.card().classes("pane"):
            PlainText("h3", f'Switch off "{shortened(rule.says, _MAX_RULE_CHARACTERS)}" for this program?')
            PlainText("p", "The robot may break it while this program runs. Your reason is logged.", "quiet")
            reason = (
                ui.input("Reason")
                .props(f"outlined autofocus maxlength={_MAX_SWITCH_OFF_REASON}")
                .classes("why")
            )

            async def switch_off() -> None:
                session = self._console.session
                if session is not None:
                    await asyncio.to_thread(session.switch_off, rule.name, reason.value or "")
                dialog.close()

            with ui.element("div").classes("word"):
                Button("Switch it off", switch_off, "risky go")
                Button("Keep it", dialog.close, "plain")
        dialog.on("hide", dialog.delete)
        dialog.open()
