"""The circumstances of events come back from a row as they were."""

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


def seen(trace: Trace) -> list[tuple[object, ...]]:
    return [(e.kind, e.text, e.place, e.holding, e.to, e.destination) for e in trace]


def written(trace: Trace) -> dict[str, Any]:
    return {"trace": [*trace_data(trace)], **circumstances(trace)}


@given(traces, st.integers(0, 6))
def test_they_come_back_also_where_a_row_ends_early(trace: Trace, count: int) -> None:
    verdict = json.loads(json.dumps(written(trace)))
    assert seen(trace_of(verdict)) == seen(trace)
    assert seen(trace_of(first_events(verdict, count))) == seen(trace[:count])


def test_only_what_changes_is_written() -> None:
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
