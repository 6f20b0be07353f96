from dataclasses import FrozenInstanceError, replace

import pytest

from codebotler.core.trace import Event, Option, Outcome, RunError, Status


def test_equality_of_events_ignores_time_and_place() -> None:
    event = Event("goto", "lab", place="hall", time=1.0)
    assert event == Event("goto", "lab", place="lab", time=2.0)
    assert hash(event) == hash(Event("goto", "lab"))
    assert len({event, Event("goto", "lab"), Event("goto", "Lab"), Event("say", "lab")}) == 3


@pytest.mark.parametrize(
    "other",
    [
        Event("ask", "Tea?", (Option("yes"), Option("no"))),
        Event("ask", "Tea?", (Option("yes"),), answer="yes"),
        Event("ask", "Tea?", (Option("yes", is_text=False),)),
        Event("ask", "Tea?", (Option("yes"),), found=False),
        Event("say", "Tea?", (Option("yes"),)),
    ],
)
def test_events_differ_in_options_answer_look_and_kind(other: Event) -> None:
    assert other != Event("ask", "Tea?", (Option("yes"),))


def test_events_and_outcomes_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        Event("say", "a").text = "b"  # type: ignore[misc]  # the test needs this error
    with pytest.raises(FrozenInstanceError):
        Outcome(Status.FINISHED, ()).line = 3  # type: ignore[misc]  # the test needs this error


def test_equality_of_outcomes_compares_every_field() -> None:
    outcome = Outcome(Status.PYTHON_ERROR, (Event("say", "a"),), RunError("NameError", "no x"), 3)
    assert outcome == replace(outcome)
    changed = ({"status": Status.KILLED}, {"trace": ()}, {"error": None}, {"line": None})
    assert all(replace(outcome, **change) != outcome for change in changed)
    assert len({outcome, replace(outcome)}) == 1


def test_statuses_have_the_names_of_evaluation_rows() -> None:
    assert [str(status) for status in Status] == [
        "finished", "timeout", "python-error", "robot-error", "agent-error", "killed",
    ]  # fmt: skip
