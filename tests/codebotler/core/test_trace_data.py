import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.errors import UserError
from codebotler.core.trace import (
    Event,
    Option,
    Outcome,
    RunError,
    Status,
    Trace,
    outcome_data,
    trace_data,
    trace_from,
)

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=10)
options = st.builds(Option, texts, st.booleans())


@st.composite
def questions(draw: st.DrawFn) -> Event:
    offered = tuple(draw(st.lists(options, max_size=4)))
    return Event("ask", draw(texts), offered, draw(st.sampled_from([None, *(o.text for o in offered)])))


events = st.one_of(
    st.builds(Event, st.sampled_from(["goto", "say", "pick", "place", "check"]), texts),
    st.builds(Event, st.just("check"), texts, found=st.booleans()),
    questions(),
)
traces = st.lists(events, max_size=5).map(tuple)


@given(traces)
def test_trace_survives_the_json_round_trip(trace: Trace) -> None:
    assert trace_from(json.loads(json.dumps(trace_data(trace)))) == trace


def test_outcome_data_has_the_fields_of_a_row() -> None:
    question = Event("ask", "Tea?", (Option("yes"), Option("1", is_text=False)), answer="yes")
    trace = (Event("goto", "lab"), Event("check", "kim", found=True), question)
    assert outcome_data(Outcome(Status.ROBOT_ERROR, trace, RunError("AskNoPerson", "nobody"), 4)) == {
        "status": "robot-error",
        "error": {"kind": "AskNoPerson", "message": "nobody"},
        "line": 4,
        "trace": [["goto", "lab"], ["check", "kim", True], ["ask", "Tea?", ["yes", {"no text": "1"}], "yes"]],
    }


@pytest.mark.parametrize(
    ("element", "named"),
    [
        (["say"], "['say']"),
        (["say", 3], "['say', 3]"),
        (["check", "hi", 1], "[kind, text, true or false]"),
        (["ask", "q", "yes", "a"], "[kind, question, options, answer or null]"),
        (["ask", "q", [3], "a"], "3 is not an option of a question"),
        ("say hi", "'say hi'"),
    ],
)
def test_invalid_event_is_an_error_that_names_it(element: object, named: str) -> None:
    with pytest.raises(UserError) as caught:
        trace_from([element])
    assert named in caught.value.sentence


def test_events_of_own_skills_are_read() -> None:
    data = [["wave", "kim"], ["smell", "tea", True], ["vote", "q", ["a"], "a"], ["say", "hi"]]
    assert trace_data(trace_from(data)) == data
