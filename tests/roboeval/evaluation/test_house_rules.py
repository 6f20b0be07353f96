"""Effects of house rules on a few programs; bench/rules.py measures many."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

import rules
from codebotler.core.errors import UserError
from codebotler.core.trace import Event
from codebotler.simulator.guard.rule_guard import RuleGuard
from roboeval.suites.suite import HouseRules
from rules import ALL, Effect, Measuring, errand_of, houses

HASTY = """
def task_program():
    go_to("kitchen")
    for drink in ["water", "lemonade"]:
        if is_in_room(drink):
            pick(drink)
            break
    go_to("lobby")
    drink = ask("", "What would you like?", ["water", "iced tea", "lemonade"])
    say("Here you are.")
"""
IN_VAIN = """
def task_program():
    try:
        pick("a unicorn")
    except Exception:
        pass
    go_to("lobby")
    drink = ask("", "What would you like?", ["water", "iced tea", "lemonade"])
    go_to("kitchen")
    pick(drink)
"""


@pytest.fixture(scope="module")
def measuring() -> Iterator[Measuring]:
    started = Measuring()
    yield started
    started.worker.close()


def effects(measuring: Measuring, task: str, program: str) -> dict[str, Effect]:
    found = measuring.effects([(task, program)], frozenset())
    return {effect.house: effect for effect in found}


def test_there_are_eight_kinds_of_three_or_more_rules() -> None:
    kinds = Counter(house.kind for house in houses())
    del kinds[ALL]
    assert len(kinds) == 8
    assert min(kinds.values()) >= 3


@pytest.mark.slow
def test_rules_stop_only_what_breaks_them(measuring: Measuring) -> None:
    found = effects(measuring, "GetDrink", HASTY)
    broken = {name for name, effect in found.items() if effect.broken}
    assert {"permission-to-take", "holding-in-the-lobby", ALL} <= broken
    assert not {"order-see-then-take", "words-whole-sentences"} & broken
    assert "rooms-one-office-at-a-time" not in found
    for effect in found.values():
        assert effect.executed == effect.unseen == effect.altered == effect.failing == 0
        assert effect.rejected == (effect.broken > 0)


def test_a_refused_call_would_have_failed(measuring: Measuring) -> None:
    found = effects(measuring, "GetDrink", IN_VAIN)["permission-to-take"]
    assert (found.broken, found.failing, found.altered) == (0, 3, 0)


@pytest.mark.slow
def test_a_blind_guard_is_noticed(measuring: Measuring, monkeypatch: pytest.MonkeyPatch) -> None:
    def ignore_events(_: RuleGuard, *events: Event, is_drive: bool = False) -> None:
        """Ignore all events."""

    monkeypatch.setattr(RuleGuard, "judge", ignore_events)
    monkeypatch.setattr(RuleGuard, "judge_result", ignore_events)
    found = effects(measuring, "GetDrink", HASTY)["permission-to-take"]
    assert (found.broken, found.executed) == (3, 3)


def test_an_errand_costs_more_with_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rules, "SIZES", (0, 1))
    monkeypatch.setattr(rules, "ROUNDS", 1)
    assert len(errand_of(1)) > 30
    assert rules.costs()[0][0] > 0


def test_the_benchmark_refuses_rules_about_where_a_robot_is(tmp_path: Path) -> None:
    path = tmp_path / "house.yaml"
    path.write_text("rules:\n- {name: lab, says: Never., always: 'not tr.Exists(inside(\"lab\"))'}\n")
    with pytest.raises(UserError, match=r'the rule "lab" uses .?inside'):
        HouseRules.read(path)
