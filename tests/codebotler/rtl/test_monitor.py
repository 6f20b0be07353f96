"""The monitor, against `holds` on every prefix."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import Formula, Inconclusive, Monitor, holds, parse

ROOMS = (Event("goto", "kitchen"), Event("goto", "office"), Event("say", "knock knock"))
KNOCK = parse(
    'not tr.Last(goto("office")) or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))'
)


@given(st.data())
def test_it_says_of_every_prefix_what_the_formula_does(
    formulas: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(traces)
    monitor = Monitor(formula)
    assert monitor.holds == holds(formula, ())
    for end, event in enumerate(trace, 1):
        ahead = monitor.would_hold(event)
        assert monitor.feed(event) == monitor.holds == ahead == holds(formula, trace[:end])


def test_an_option_that_is_no_text_is_never_judged() -> None:
    monitor = Monitor(parse('not tr.Exists(ask("tea", "yes"))'))
    odd = Event("ask", "tea?", (Option("1", is_text=False),))
    for judge in (monitor.feed, monitor.would_hold):
        with pytest.raises(Inconclusive):
            judge(odd)
    assert monitor.holds


def test_what_it_remembers_does_not_grow_with_the_trace() -> None:
    monitor, sizes = Monitor(KNOCK), set()
    for round_ in range(1_000):
        for event in ROOMS:
            monitor.feed(event)
        if round_ in {1, 999}:
            sizes.add(len(pickle.dumps(monitor._state)))
    assert len(sizes) == 1
