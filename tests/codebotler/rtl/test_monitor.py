"""The monitor agrees with `holds` on every prefix and on everything that can follow."""

import pickle
from itertools import product

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
def test_monitor_agrees_with_the_formula_on_every_prefix(
    formulas: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(traces)
    monitor = Monitor(formula)
    assert monitor.holds == holds(formula, ())
    for end, event in enumerate(trace, 1):
        ahead = monitor.would_hold(event)
        assert monitor.feed(event) == monitor.holds == ahead == holds(formula, trace[:end])
    assert monitor.is_final is None


TEXTS = (
    'not tr.Exists(goto("kitchen"))',
    'tr.Exists(goto("kitchen"))',
    'tr.AtLeast(say("knock"), 2)',
    'tr.Count(goto("office"), 1)',
    'tr.Last(goto("office"))',
    'tr.AfterFirst(goto("kitchen")).Exists(goto("office")) and not tr.Exists(say("knock"))',
    'tr.OnlyAfterLast(goto("kitchen")).Exists(say("knock"))',
    'tr.BeforeFirst(goto("kitchen")).Exists(goto("office"))',
    'tr.Exists(goto("attic"))',
    'tr.AtLeast(goto("attic"), 0)',
    str(KNOCK),
)


@pytest.mark.parametrize("text", TEXTS)
def test_verdict_is_final_exactly_if_no_future_changes_it(text: str) -> None:
    formula, length = parse(text), 3
    for word in product(ROOMS, repeat=length):
        monitor = Monitor(formula, ROOMS)
        for end in range(length + 1):
            if end:
                monitor.feed(word[end - 1])
            futures = (word[:end] + more for n in range(4) for more in product(ROOMS, repeat=n))
            same = len({holds(formula, future) for future in futures}) == 1
            assert monitor.is_final is same, (word[:end], text)


@given(st.data())
def test_final_verdict_never_changes(
    formulas: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(traces)
    monitor, final = Monitor(formula, trace), None
    for event in trace:
        now = monitor.feed(event)
        assert final is None or now is final
        final = now if monitor.is_final else final


def test_impossible_event_is_refused_and_ignored() -> None:
    monitor = Monitor(parse('tr.Exists(say("attic"))'), ROOMS)
    assert monitor.is_final
    with pytest.raises(ValueError, match="list of possible events"):
        monitor.feed(Event("say", "attic"))
    assert not monitor.holds
    assert not monitor.feed(Event("goto", "another room"))  # to the formula, it equals the others


def test_a_formula_too_large_to_look_ahead_is_inconclusive() -> None:
    parts = " and ".join(f'tr.Count(say("{name}"), 50)' for name in "abcd")
    monitor = Monitor(parse(parts), [Event("say", name) for name in "abcd"])
    assert monitor.is_final is None
    assert not monitor.feed(Event("say", "a"))


def test_option_that_is_not_text_is_inconclusive() -> None:
    monitor = Monitor(parse('not tr.Exists(ask("tea", "yes"))'))
    mixed = Event("ask", "tea?", (Option("1", is_text=False),))
    for judge in (monitor.feed, monitor.would_hold):
        with pytest.raises(Inconclusive):
            judge(mixed)
    assert monitor.holds


def test_state_does_not_grow_with_the_trace() -> None:
    monitor, sizes = Monitor(KNOCK), set()
    for round_ in range(1_000):
        for event in ROOMS:
            monitor.feed(event)
        if round_ in {1, 999}:
            sizes.add(len(pickle.dumps(monitor._state)))
    assert len(sizes) == 1
