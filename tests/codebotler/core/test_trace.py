from dataclasses import FrozenInstanceError, replace

import pytest

from codebotler.core.trace import Event, Option, Outcome, RunError, Status


def test_events_are_equal_by_what_was_done_whenever_and_wherever() -> None:
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
        Event("say", "a").text = "b"  # type: ignore[misc]  # that it fails is the point
    with pytest.raises(FrozenInstanceError):
        Outcome(Status.FINISHED, ()).line = 3  # type: ignore[misc]  # the same


def test_outcomes_are_equal_by_all_that_they_hold() -> None:
    outcome = Outcome(Status.PYTHON_ERROR, (Event("say", "a"),), RunError("NameError", "no x"), 3)
    assert outcome == replace(outcome)
    changed = ({"status": Status.KILLED}, {"trace": ()}, {"error": None}, {"line": None})
    assert all(replace(outcome, **change) != outcome for change in changed)
    assert len({outcome, replace(outcome)}) == 1


def test_statuses_are_spelt_as_the_rows_of_an_evaluation_spell_them() -> None:
    assert [str(status) for status in Status] == [
        "finished", "timeout", "python-error", "robot-error", "agent-error", "killed",
    ]  # fmt: skip
