"""Remarks on runs: what was repeated until a limit."""

from __future__ import annotations

import pytest

from codebotler.core.trace import Event, Option, Status, Trace
from roboeval.evaluation.remarks import cycle_at_end, remarks_on

THERE, LOOK, BACK = Event("goto", "lab"), Event("check", "mug", found=False), Event("goto", "hall")
VERDICT = {"status": Status.TIMEOUT, "satisfied": False}


@pytest.mark.parametrize(
    ("trace", "first", "length", "times"),
    [
        ((LOOK,) * 3, 1, 1, 3),
        ((THERE, *[LOOK] * 9), 2, 1, 9),
        ((THERE, LOOK) * 9, 1, 2, 9),
        ((BACK, *(THERE, LOOK) * 9, THERE), 2, 2, 9),  # the limit came in the middle of a turn
        ((THERE, LOOK, LOOK, LOOK, LOOK) * 5, 1, 5, 5),  # not the looks at the end
        ((Event("say", "hi"), THERE, LOOK, BACK) * 2 + (THERE, LOOK, BACK) * 4, 6, 3, 5),
    ],
)
def test_cycle_at_the_end_is_found(trace: Trace, first: int, length: int, times: int) -> None:
    cycle = cycle_at_end(trace)
    assert cycle is not None
    assert (cycle.first, len(cycle.steps), cycle.times) == (first, length, times)


@pytest.mark.parametrize(
    "trace",
    [
        (),
        (LOOK, LOOK),
        (THERE, LOOK, BACK, LOOK),
        (*[LOOK] * 9, THERE),
        tuple(Event("say", str(n)) for n in range(99)),
    ],
)
def test_trace_that_does_not_end_in_a_cycle_has_none(trace: Trace) -> None:
    assert cycle_at_end(trace) is None


def test_place_of_an_event_does_not_hide_a_cycle() -> None:
    first, then = Event("goto", "lab", place="hall"), Event("goto", "lab", place="lab")
    cycle = cycle_at_end((first, LOOK, *(then, LOOK) * 4))
    assert cycle is not None
    assert (cycle.first, cycle.times) == (1, 5)


def test_cycle_is_told_in_plain_words() -> None:
    asked = Event("ask", "tea?", (Option("yes"), Option("no")), answer="no")
    (remark,) = remarks_on(VERDICT, (BACK, *(THERE, LOOK, asked) * 333))
    for part in (
        "step 2",
        "333 times",
        'go to "lab"',
        'look for "mug" (not found)',
        'ask "tea?" (answer "no")',
    ):
        assert part in remark


def test_long_cycle_names_its_first_steps_only() -> None:
    rooms = tuple(Event("goto", f"room {n}") for n in range(40))
    (remark,) = remarks_on(VERDICT, rooms * 25)
    assert "40 steps" in remark
    assert "35 more" in remark
    assert len(remark) < 300


def test_only_a_limit_makes_a_cycle_worth_a_remark() -> None:
    assert remarks_on({**VERDICT, "status": Status.FINISHED}, (LOOK,) * 99) == []


def test_cycle_of_a_trace_that_is_cut_was_repeated_at_least_so_often() -> None:
    (remark,) = remarks_on({**VERDICT, "cut": {"events": 1, "sha256": ""}}, (LOOK,) * 99)
    assert "99 times or more" in remark
