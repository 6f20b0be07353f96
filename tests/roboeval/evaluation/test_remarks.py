"""Remarks on runs: what was repeated until a limit, and questions that got the answer to another."""

from __future__ import annotations

import pytest

from codebotler.core.trace import Event, Option, Status, Trace
from codebotler.core.world import Answer, Person, Room, World
from codebotler.simulator.settings import PAPER_SETTINGS, SimulationSettings
from roboeval.evaluation.remarks import cycle_at_end, misplaced_questions, remarks_on

THERE, LOOK, BACK = Event("goto", "lab"), Event("check", "mug", found=False), Event("goto", "hall")
VERDICT = {"status": Status.TIMEOUT, "satisfied": False}


# --- cycles


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
    (remark,) = remarks_on(VERDICT, (BACK, *(THERE, LOOK, asked) * 333), None, None)
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
    (remark,) = remarks_on(VERDICT, rooms * 25, None, None)
    assert "40 steps" in remark
    assert "35 more" in remark
    assert len(remark) < 300


def test_only_a_limit_makes_a_cycle_worth_a_remark() -> None:
    assert remarks_on({**VERDICT, "status": Status.FINISHED}, (LOOK,) * 99, None, None) == []


def test_cycle_of_a_trace_that_is_cut_was_repeated_at_least_so_often() -> None:
    (remark,) = remarks_on({**VERDICT, "cut": {"events": 1, "sha256": ""}}, (LOOK,) * 99, None, None)
    assert "99 times or more" in remark


# --- answers in a fixed order


def world(*people: Person) -> World:
    return World((Room("hall"), Room("office", people=people)), "hall")


def asked(question: str, *options: str, answer: str | None = None, place: str = "office") -> Event:
    return Event("ask", question, tuple(map(Option, options)), answer=answer, place=place)


JILL = Person("jill", ("yes", ".*"))
LUNCH, WHEN = asked("lunch?", "yes", "no", answer="yes"), asked("when?", "12:30", "1:00")


def test_question_that_comes_too_early_is_named() -> None:
    (remark,) = misplaced_questions((WHEN,), world(JILL), PAPER_SETTINGS)
    for part in ("office", '1st gets "yes"', "2nd gets the first option", '1st was "when?"'):
        assert part in remark


def test_question_that_comes_too_late_is_named() -> None:
    person = Person("jill", ("yes", r"12:\d\d"))
    (remark,) = misplaced_questions((LUNCH, LUNCH), world(person), PAPER_SETTINGS)
    assert '2nd was "lunch?"' in remark


@pytest.mark.parametrize(
    ("trace", "people"),
    [
        ((), (JILL,)),
        ((LUNCH, WHEN), (JILL,)),
        ((WHEN,), (Person("jill", ("yes",)),)),  # there is no order
        ((WHEN,), (Person("jill", ("yes", "no")),)),  # nor does the other answer fit
        ((WHEN,), (JILL, Person("jack", ("yes", ".*")))),  # who of the two was asked is not recorded
        ((WHEN,), (Person("jill", ("yes", ".*"), topics=(("when", "1:00"),)),)),
        ((asked("when?", "1:00", place="hall"),), (JILL,)),
        ((asked("when?"),), (JILL,)),  # an error of its own
    ],
)
def test_questions_in_the_order_of_the_answers_need_no_remark(
    trace: Trace, people: tuple[Person, ...]
) -> None:
    assert [*misplaced_questions(trace, world(*people), PAPER_SETTINGS)] == []


def test_answer_that_became_a_no_is_remarked_on_as_well() -> None:
    early = asked("which tea?", "green", "none", answer="none")
    person = Person("jill", ("yes", "green"))
    assert [*misplaced_questions((early,), world(person), PAPER_SETTINGS)]


@pytest.mark.parametrize(("answer", "told"), [(-1, "the last option"), (2, "option 2"), ("tea", '"tea"')])
def test_answers_are_described(answer: Answer, told: str) -> None:
    person = Person("jill", ("yes", answer))
    (remark,) = misplaced_questions((asked("which?", "tea", "milk"),), world(person), SimulationSettings())
    assert f"2nd gets {told}" in remark


def test_satisfied_world_and_unknown_world_need_no_remark_on_questions() -> None:
    failed = {"status": Status.ROBOT_ERROR, "satisfied": False}
    assert remarks_on(failed, (WHEN,), world(JILL), PAPER_SETTINGS)
    assert remarks_on({**failed, "satisfied": True}, (WHEN,), world(JILL), PAPER_SETTINGS) == []
    assert remarks_on(failed, (WHEN,), None, PAPER_SETTINGS) == []
