"""Rows keep the circumstances of events."""

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.trace import Event, Trace, trace_data
from roboeval.evaluation.runs.traces import circumstances, first_events, trace_of

rooms = st.sampled_from(["hall", "lab"])
events = st.one_of(
    st.builds(Event, st.just("goto"), rooms, place=rooms, destination=st.none() | rooms),
    st.builds(Event, st.just("say"), st.just("hi"), place=rooms, holding=st.sampled_from(["", "mug", "pen"])),
    st.builds(Event, st.sampled_from(["ask", "bid"]), rooms, to=st.sampled_from([None, "", "amy"])),
)
traces = st.lists(events, max_size=6).map(tuple)


def facts_of(trace: Trace) -> list[tuple[object, ...]]:
    return [(e.kind, e.text, e.place, e.holding, e.to, e.destination) for e in trace]


def verdict_of(trace: Trace) -> dict[str, Any]:
    return {"trace": [*trace_data(trace)], **circumstances(trace)}


@given(traces, st.integers(0, 6))
def test_circumstances_are_read_from_whole_and_from_cut_rows(trace: Trace, count: int) -> None:
    verdict = json.loads(json.dumps(verdict_of(trace)))
    assert facts_of(trace_of(verdict)) == facts_of(trace)
    assert facts_of(trace_of(first_events(verdict, count))) == facts_of(trace[:count])


def test_only_changes_are_written() -> None:
    trace = (
        Event("say", "hi", place="hall"),
        Event("goto", "hall", place="hall", destination="hall"),
        Event("goto", "moon", place="hall"),
        Event("goto", "lab", place="hall", destination="lab"),
        Event("say", "hi", place="lab", holding="mug"),
        Event("ask", "q", place="lab", holding="mug", to="amy"),
        Event("goto", "hall", place="lab", destination="hall"),
        Event("ask", "q", place="hall", to="amy"),
        Event("ask", "q", place="hall", to="bob"),
    )
    assert circumstances(trace) == {
        "places": [[1, "hall"], [5, "lab"], [8, "hall"]],
        "holding": [[5, "mug"], [7, ""]],
        "to": [[6, "amy"], [9, "bob"]],
        "destinations": [[3, None]],
    }
    assert circumstances(()) == {"places": []}
    assert circumstances(trace[3:4]) == {"places": [[1, "hall"], [2, "lab"]]}
