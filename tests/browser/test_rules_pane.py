"""The page shows house rules, and a person can switch one off for one program."""

from __future__ import annotations

import re
from pathlib import Path

from playwright.sync_api import expect

from pageserver import PageServer
from viewing import PHONE, OpenPage, write

RULES = """
rules:
  - name: study
    says: Never go into the study.
    always: not tr.Exists(goto("study"))
  - name: carry
    says: Carry no mug out of the kitchen.
    always: not tr.Exists(holding("mug", goto(without("kitchen"))))
"""
VISIT = "def task_program():\n    go_to('study')\n    say('hello')\n"
SLY = """def task_program():
    go_to("kitchen")
    for _ in range(9):
        try:
            go_to("study")
        except BaseException:
            say("again")
"""


def test_a_rule_is_shown_enforced_and_switched_off_with_a_reason(tmp_path: Path, open_page: OpenPage) -> None:
    (tmp_path / "rules.yaml").write_text(RULES)
    with PageServer(tmp_path, "--speed", "40", "--rules", "rules.yaml") as server:
        page = open_page(server)
        expect(page.locator(".house-rules li")).to_have_text(
            ["Never go into the study.", "Carry no mug out of the kitchen."]
        )
        write(page, SLY)
        expect(page.get_by_text("1 problem. The robot should not run this.")).to_be_visible()
        expect(page.locator(".problems")).to_contain_text('the rule "study" forbids going to "study"')
        page.get_by_text("Run it despite the problems").click()
        page.get_by_role("button", name="Run it on the robot").click()
        expect(page.locator(".headline")).to_have_text("Stopped")
        expect(page.locator(".reason")).to_have_text("line 5: stopped by rule study")
        expect(page.locator(".moment-rule")).to_contain_text('the rule "study" prevented going to "study"')
        expect(page.locator(".moment-say")).to_have_count(0)

        write(page, VISIT)
        expect(page.locator(".problems")).to_contain_text('the rule "study" forbids going to "study"')
        page.get_by_role("button", name="Switch off the rule study for this program").click()
        page.get_by_role("button", name="Keep it").click()
        expect(page.locator(".q-dialog")).to_be_hidden()
        page.get_by_role("button", name="Switch off the rule study for this program").click()
        page.get_by_role("button", name="Switch it off").click()
        expect(page.get_by_text("give a reason why this program may break")).to_be_visible()
        page.get_by_label("Reason").fill("Ann has asked for a visit")
        page.get_by_role("button", name="Switch it off").click()
        expect(page.locator(".house-rules li.off")).to_contain_text("switched off for this program")
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        page.get_by_role("button", name="Run it on the robot").click()
        expect(page.locator(".headline")).to_have_text("Done")
        expect(page.locator(".moment-log")).to_contain_text("Ann has asked for a visit")

        write(page, VISIT + "\n")  # In this new mission the rule counts again.
        expect(page.locator(".problems")).to_contain_text('the rule "study" forbids going to "study"')
        expect(page.locator(".house-rules li.off")).to_have_count(0)
        page.context.close()


def test_the_api_shows_rules_and_cannot_switch_them_off(tmp_path: Path, open_page: OpenPage) -> None:
    (tmp_path / "rules.yaml").write_text(RULES)
    with PageServer(tmp_path, "--speed", "0", "--rules", "rules.yaml") as server:
        page = open_page(server, size=PHONE)
        write(page, "def task_program():\n    say('hello')\n")
        expect(page.get_by_text("Checked: no problems.")).to_be_visible()
        now = server.call("GET", "/api/missions/current").data
        in_force = [(rule["name"], rule["in_force"]) for rule in now["rules"]]
        assert in_force == [("study", True), ("carry", True)]
        described = server.call("GET", "/openapi.json").text
        assert not re.search(r"switch|\boff\b", described)
        found = server.call("POST", "/api/check", {"program": VISIT}).data
        assert [problem["kind"] for problem in found["problems"]] == ["RuleViolation"]
        page.context.close()
