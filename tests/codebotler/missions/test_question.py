"""A session asks which of several programs a person means, and keeps the answer with the mission."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from codebotler.candidates.clusters import CandidateClusters, compare_candidates
from codebotler.candidates.question import ClarifyingAnswer
from codebotler.core.errors import UserError
from codebotler.core.world import Room, World
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.mission import MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import MissionState, MissionSummary, read_events
from codebotler.robots.simulated import Simulated
from doubles import FakeModel

HOUSE = World((Room("hall"), Room("kitchen", ("mug",))), "hall")
STAY = 'def task_program():\n    say("hello")\n'
GO = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
CARRY = 'def task_program():\n    go_to("kitchen")\n    pick("mug")\n'
FETCH = 'def task_program():\n    go_to("kitchen")\n    pick("mug")\n    go_to("hall")\n    place("mug")\n'


@contextmanager
def start_session(
    home: Path, *programs: str, asks: bool = True, name: str = "several"
) -> Iterator[tuple[MissionSession, FakeModel]]:
    model = FakeModel(programs)
    session = MissionSession(
        Simulated(HOUSE, speed=None),
        home,
        MissionOrder("Do it.", name, candidates=len(programs), asks=asks),
        open_model=lambda _: model,
    )
    session.start()
    try:
        yield session, model
    finally:
        session.stop("the test")
        session.join(10)


def wait_for_person(session: MissionSession) -> SessionView:
    return session.wait_until(
        lambda view: view.waits_for_answer or view.may_be_approved or view.waits_for_program
    )


def notes(home: Path, view: SessionView) -> list[str]:
    folder = home / "missions" / view.id
    return [line["text"] for line in read_events(folder) if line["event"] == "log"]


@pytest.mark.parametrize(("answer", "program"), [(0, STAY), (1, FETCH), ("decide", STAY)])
def test_a_person_chooses_and_the_mission_keeps_the_answer(
    tmp_path: Path, answer: ClarifyingAnswer, program: str
) -> None:
    with start_session(tmp_path, STAY, FETCH, STAY) as (session, _):
        view = wait_for_person(session)
        assert view.phase == "question"
        assert view.question is not None
        assert [option.size for option in view.question.options] == [2, 1]
        chosen, options = view.question.chosen(answer), view.question.options
        session.answer(session.view.question, answer)
        view = wait_for_person(session)
        assert (view.program, view.question, view.author) == (program, None, "several")
        assert view.may_be_approved
        assert chosen is not None
        kept = notes(tmp_path, view)
        (note,) = [note for note in kept if chosen.course in note and "another" not in note]
        assert ("left the choice" in note) == (answer == "decide")
        assert all(any(option.course in note for note in kept) for option in options)


def test_none_of_these_adds_a_sentence_and_a_second_none_ends_the_mission(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH) as (session, model):
        question = wait_for_person(session).question
        assert question is not None
        assert not question.why_last
        model.programs = [CARRY, GO]
        session.answer(session.view.question, "none", "But  quietly.")
        view = session.wait_until(lambda now: now.waits_for_answer)
        assert view.question is not None
        assert view.question.why_last
        assert view.instruction == "Do it. But quietly."
        assert session.is_changed_by_person
        assert model.prompts[-1].instruction == "Do it. But quietly."
        kept = notes(tmp_path, view)
        assert all(any(one.course in note for note in kept) for one in question.options)
        session.answer(session.view.question, "none", "And fast.")
        view = session.wait_until(lambda now: now.is_over or now.state is MissionState.FAILED)
        assert view.state is MissionState.FAILED
        summary = MissionSummary.read(tmp_path / "missions" / view.id)
        assert summary.instruction == "Do it. But quietly."


def test_what_was_rejected_may_be_right_with_the_added_words(tmp_path: Path) -> None:
    """The question has shown only one case, and the words may be about another one."""
    with start_session(tmp_path, STAY, FETCH) as (session, model):
        wait_for_person(session)
        model.programs = [FETCH, FETCH]
        session.answer(session.view.question, "none", "If nobody is there, be quiet.")
        assert session.wait_until(lambda view: view.may_be_approved).program == FETCH


def test_a_recorded_model_is_not_asked_again(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH, name="recorded:several") as (session, model):
        question = wait_for_person(session).question
        assert question is not None
        session.answer(session.view.question, "none", "But quietly.")
        view = session.wait_until(lambda now: now.state is MissionState.FAILED or now.waits_for_answer)
        assert question.why_last
        assert question.why_last in view.reason
        assert (view.instruction, len(model.prompts)) == ("Do it.", 2)


def test_nobody_is_asked_if_all_do_the_same_or_nobody_can_answer(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, STAY) as (session, _):
        assert wait_for_person(session).program == STAY
    with start_session(tmp_path, FETCH, STAY, STAY, asks=False) as (session, _):
        view = wait_for_person(session)
        assert view.program == STAY
        assert view.remarks


def test_wrong_answers_are_refused(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH) as (session, _):
        wait_for_person(session)
        with pytest.raises(MissionError):
            session.answer(session.view.question, 2)
        with pytest.raises(MissionError):
            session.answer(session.view.question, -1)
        with pytest.raises(MissionError, match="none of these"):
            session.answer(session.view.question, 0, "but be quick")
        asked = session.view.question
        session.answer(asked, 0)
        with pytest.raises(MissionError):
            session.answer(asked, 0)


def test_an_answer_to_an_earlier_question_is_refused(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH) as (session, model):
        first = wait_for_person(session).question
        model.programs = [CARRY, GO]
        session.answer(first, "none", "But quietly.")
        session.wait_until(lambda now: now.waits_for_answer)
        with pytest.raises(MissionError):
            session.answer(first, 0)
        assert session.view.waits_for_answer


def test_an_edit_takes_the_place_of_the_question(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH) as (session, _):
        wait_for_person(session)
        session.edit(GO)
        view = session.wait_until(lambda now: now.may_be_approved)
        assert (view.program, view.question) == (GO, None)


def test_a_stop_ends_the_question(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH) as (session, _):
        wait_for_person(session)
        session.stop("the test")
        assert session.wait_until(lambda _: False).state is MissionState.STOPPED


def test_replies_without_a_program_do_not_count(tmp_path: Path) -> None:
    with start_session(tmp_path, "", GO) as (session, _):
        assert wait_for_person(session).program == GO
    with start_session(tmp_path, "", "") as (session, _):
        assert wait_for_person(session).waits_for_program


def test_an_old_program_cannot_be_approved_while_a_question_waits(tmp_path: Path) -> None:
    with start_session(tmp_path, STAY, FETCH) as (session, _):
        wait_for_person(session)
        session.answer(session.view.question, 0)
        wait_for_person(session)
        session.ask_again(repair=False)
        view = session.wait_until(lambda now: now.waits_for_answer)
        assert view.state is MissionState.CHECKED
        assert (view.may_be_approved, view.may_be_asked_again) == (False, False)


def test_an_edit_while_programs_are_compared_takes_the_place_of_the_question(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = Event(), Event()

    def slow(*given: Any) -> CandidateClusters:  # noqa: ANN401 - passed on
        begun.set()
        assert go_on.wait(10)
        return compare_candidates(*given)

    monkeypatch.setattr("codebotler.missions.session.compare_candidates", slow)
    with start_session(tmp_path, STAY, FETCH) as (session, _):
        assert begun.wait(10)
        session.edit(GO)
        go_on.set()
        view = wait_for_person(session)
        assert (view.program, view.question, view.author) == (GO, None, "")


def test_an_edit_outlives_candidates_that_repeat_a_rejected_behaviour(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = Event(), Event()

    def refuse(*_: Any) -> CandidateClusters:  # noqa: ANN401 - not used
        begun.set()
        assert go_on.wait(10)
        raise UserError("all would do again what was not meant")

    monkeypatch.setattr("codebotler.missions.session.compare_candidates", refuse)
    with start_session(tmp_path, STAY, FETCH) as (session, _):
        assert begun.wait(10)
        session.edit(GO)
        go_on.set()
        assert wait_for_person(session).program == GO
