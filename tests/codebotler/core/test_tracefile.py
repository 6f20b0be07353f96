import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.errors import UserError
from codebotler.core.trace import Event, Option, Outcome, RunError, Status, Trace
from codebotler.core.tracefile import outcome_data, outcome_yaml, read_outcome, trace_data, trace_from

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
errors = st.builds(RunError, texts, texts)
lines = st.none() | st.integers(1, 9999)
outcomes = st.one_of(
    st.builds(Outcome, st.just(Status.FINISHED), traces),
    st.builds(
        Outcome, st.sampled_from([s for s in Status if s is not Status.FINISHED]), traces, errors, lines
    ),
)


@given(traces)
def test_a_trace_comes_back_from_json(trace: Trace) -> None:
    assert trace_from(json.loads(json.dumps(trace_data(trace)))) == trace


@given(outcomes)
def test_an_outcome_comes_back_from_yaml(tmp_path_factory: pytest.TempPathFactory, outcome: Outcome) -> None:
    path = tmp_path_factory.getbasetemp() / "outcome.yaml"
    path.write_text(outcome_yaml(outcome))
    assert read_outcome(path) == outcome


def test_the_data_of_an_outcome_are_those_of_a_row() -> None:
    question = Event("ask", "Tea?", (Option("yes"), Option("1", is_text=False)), answer="yes")
    trace = (Event("goto", "lab"), Event("check", "kim", found=True), question)
    assert outcome_data(Outcome(Status.ROBOT_ERROR, trace, RunError("AskNoPerson", "nobody"), 4)) == {
        "status": "robot-error",
        "error": {"kind": "AskNoPerson", "message": "nobody"},
        "line": 4,
        "trace": [["goto", "lab"], ["check", "kim", True], ["ask", "Tea?", ["yes", {"no text": "1"}], "yes"]],
    }


GOOD = "status: robot-error\nerror: {kind: K, message: m}\nline: 3\ntrace:\n- [goto, lab]\n- [say, hi]\n"


@pytest.mark.parametrize(
    ("old", "new", "line", "named"),
    [
        ("robot-error", "tired", 1, ['"status"', "'tired'", "'finished'"]),
        ("status: robot-error\n", "", 1, ['"status"', "missing"]),
        ("error: {kind: K, message: m}\n", "", 1, ["error", "not finished"]),
        ("robot-error", "finished", 1, ["error", "not finished"]),
        ("kind: K", "kind: 3", 2, ['"kind"', "a number", "a text"]),
        ("line: 3", "line: 0", 3, ['"line"', " 0,", " 1"]),
        ("line: 3", "place: lab", 3, ['"place"']),
        ("[say, hi]", "[say]", 6, ["['say']", "[say, text]"]),
        ("[say, hi]", "[say, 3]", 6, ["['say', 3]", "[say, text]"]),
        ("[say, hi]", "[say, q, [a], b]", 6, ["['say', 'q', ['a'], 'b']", "[say, text]"]),
        ("[say, hi]", "[say, hi, true]", 6, ["['say', 'hi', True]", "[say, text]"]),
        ("[say, hi]", "[check, hi, 1]", 6, ["[check, text, true or false]"]),
        ("[say, hi]", "[ask, q]", 6, ["[ask, question, [option, ...], answer or null]"]),
        ("[say, hi]", "[ask, q, yes, a]", 6, ["[ask, question, [option, ...], answer or null]"]),
        ("[say, hi]", "[ask, q, [a], b]", 6, ['"b"', '"q"']),
        ("[say, hi]", "[ask, q, [3], a]", 6, ["3 is no option"]),
        ("[say, hi]", "[wave, kim]", 6, ['"wave"', "check, goto, ask, say, pick, place"]),
        ("[say, hi]", "say hi", 6, ["'say hi'", "[kind, text, ...]"]),
        ("[say, hi]", "{say: hi}", 6, ["{'say': 'hi'}", "[kind, text, ...]"]),
    ],
)
def test_a_wrong_file_gets_a_sentence(
    tmp_path: Path, old: str, new: str, line: int, named: list[str]
) -> None:
    assert old in GOOD
    path = tmp_path / "o.yaml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(UserError) as caught:
        read_outcome(path)
    assert (caught.value.file, caught.value.line) == (path, line)
    assert all(name in caught.value.sentence for name in named), caught.value
    assert "\n" not in str(caught.value)


def test_events_of_further_skills_are_read_where_they_may_stand() -> None:
    data = [["wave", "kim"], ["smell", "tea", True], ["vote", "q", ["a"], "a"], ["say", "hi"]]
    assert trace_data(trace_from(data, further=True)) == data
    with pytest.raises(UserError, match=r'"wave" .*check, goto, ask, say, '):
        trace_from(data)
    with pytest.raises(UserError, match=r"\['wave', 3\]"):
        trace_from([["wave", 3]], further=True)
    with pytest.raises(UserError, match=r"\['ask', 'q'\] .*\[ask, question, "):
        trace_from([["ask", "q"]], further=True)
