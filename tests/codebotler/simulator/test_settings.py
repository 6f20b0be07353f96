from datetime import UTC, datetime

import pytest

from codebotler.core.trace import Option
from codebotler.simulator.settings import PAPER_SETTINGS, Limits, SimulationSettings, choose
from codebotler.simulator.worlds.matching import Matching, finds


def test_paper_settings_are_those_of_the_published_verdicts() -> None:
    assert (PAPER_SETTINGS.literals, PAPER_SETTINGS.matching, PAPER_SETTINGS.people) == (
        "lowercase",
        "label-in-request",
        "answer-to-any-name",
    )
    assert PAPER_SETTINGS.clock_starts == datetime(2024, 1, 1, 12, 0, 0, tzinfo=UTC)
    assert PAPER_SETTINGS.limits == Limits(
        seconds=3600, calls=1000, ticks=200_000, text=10_000, trace=1_000_000
    )
    assert SimulationSettings() == PAPER_SETTINGS


@pytest.mark.parametrize("matching", ["label-in-request", "whole-words", "longest-name"])
@pytest.mark.parametrize("label", ["(?i)yes", "(?x) yes # or no", "(?s).*yes", ".*yes|(?i:no)"])
def test_label_may_have_flags(label: str, matching: Matching) -> None:
    options = (Option("later"), Option("Yes"))
    assert choose(label, "Tea?", options, SimulationSettings(matching=matching)) == 1
    assert finds("oh yes", label, matching)
    assert not finds("later", label, matching)


def test_answer_prefers_a_whole_word_of_an_option_to_a_part() -> None:
    settings = SimulationSettings(matching="longest-name")
    options = tuple(map(Option, ("Warmer", "Colder", "no")))
    assert choose("warm", "Warmer or colder?", options, settings) == 0
    assert choose("no", "Now?", tuple(map(Option, ("I know", "no"))), settings) == 1
