from datetime import UTC, datetime

from codebotler.simulator.rules import PAPER, Limits, Rules


def test_rules_of_the_paper_are_those_that_the_published_verdicts_rest_on() -> None:
    assert (PAPER.literals, PAPER.matching, PAPER.people) == (
        "lowercase",
        "label-in-request",
        "answer-to-any-name",
    )
    assert PAPER.clock_starts == datetime(2024, 1, 1, 12, 0, 0, tzinfo=UTC)
    assert PAPER.limits == Limits(seconds=3600, calls=1000, ticks=200_000, text=10_000, trace=1_000_000)
    assert Rules() == PAPER
