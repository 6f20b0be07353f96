"""Two runs are the same behaviour if a person would notice no difference, whatever the words."""

import pytest

from codebotler.candidates.behaviour import (
    MAX_STATEMENT_LENGTH,
    Behaviour,
    behaviour_of,
    claims_of,
    count_conflicts,
    count_in_other_rooms,
    names_in,
    rooms_with_several,
    statements,
)
from codebotler.core.trace import Event, Outcome, RunError, Status, Trace, to_options

START = "hall"
NAMES = names_in([START, "office 1", "office 2"], [(Event("check", "the mug"), Event("check", "person"))])


def drive(start: str, end: str) -> Event:
    return Event("goto", end, place=start, destination=end)


def say(text: str, room: str = START) -> Event:
    return Event("say", text, place=room)


def ask(*options: str, room: str = START, to: str = "", question: str = "Tea?") -> Event:
    return Event("ask", question, to_options(options), answer=options[0], place=room, to=to)


def observe(*events: Event) -> Behaviour:
    return behaviour_of(Outcome(Status.FINISHED, events), START, NAMES)


def observe_failure(status: Status, kind: str = "PickObjectNotFound") -> Behaviour:
    return behaviour_of(Outcome(status, (drive(START, "office 1"),), RunError(kind, "no mug")), START, NAMES)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("There is no mug in office 1.", "The mug is not in office 1"),
        ("2 people want tea", "Two of them want tea."),
        ("Lunch is at 12:30 pm", "they leave at half past twelve"),
        ("Lunch is at 5", "5 pm"),
        ("Hello!", "Good morning to you"),
        ("I found 3 mugs.", "There are three mugs in total"),
        ("eggs: 0", "zero eggs"),
        ("no tea", "0 teas"),
        ("The offices have a mug", "A mug, yes"),
    ],
)
def test_statements_with_the_same_claims_are_alike(one: str, other: str) -> None:
    assert claims_of(one, NAMES) == claims_of(other, NAMES)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("There is a mug in office 1.", "There is no mug in office 1."),
        ("There is a mug in office 1.", "There is a mug in office 2."),
        ("2 people want tea", "3 people want tea"),
        ("Lunch is at 12:30", "Lunch is at 12:45"),
        ("Somebody came", "Nobody came"),
        ("There is a mug", "Hello!"),
    ],
)
def test_statements_with_different_claims_differ(one: str, other: str) -> None:
    assert claims_of(one, NAMES) != claims_of(other, NAMES)


def test_yes_no_and_words_for_anybody_are_not_names() -> None:
    names = names_in([], [(ask("yes", "No", "black tea"), Event("check", "somebody"))])
    assert [match[0] for match in names.finditer("yes no somebody black tea black teas")] == [
        "black tea",
        "black teas",
    ]


def test_plural_of_a_thing_is_a_name_but_not_of_a_room() -> None:
    names = names_in(["lab", "lab 2"], [(Event("pick", "a mug"),)])
    assert [match[0] for match in names.finditer("the labs: lab, Lab 2; mugs")] == ["lab", "Lab 2", "mugs"]


def test_pattern_without_names_matches_nothing() -> None:
    assert not names_in([], []).findall("a mug in the hall")


def test_order_of_visits_and_looks_does_not_count() -> None:
    there, back = drive(START, "office 1"), drive("office 1", START)
    look = Event("check", "mug", found=True, place="office 1")
    aside = drive(START, "office 2"), drive("office 2", START)
    assert observe(there, look, back, *aside, say("2 mugs")) == observe(*aside, there, back, say("two mugs"))


def test_statements_between_two_drives_are_merged() -> None:
    assert observe(say("There is a mug."), say("It has 2 handles.")) == observe(say("A mug\nwith 2 handles"))
    assert observe(say("a mug"), drive(START, START), say("2")) == observe(say("a mug"), say("2"))
    apart = observe(say("a mug"), drive(START, "office 1"), drive("office 1", START), say("2"))
    assert apart != observe(say("a mug"), say("2"))


def test_long_statements_are_truncated() -> None:
    talk = [say(f"no, at {number}, but there is no mug in office 1 and ") for number in range(5_000)]
    (statement,) = statements(tuple(talk))
    assert len(statement[1]) == MAX_STATEMENT_LENGTH


def test_room_of_a_statement_counts() -> None:
    assert observe(say("a mug")).differences(observe(say("a mug", "office 1"))) == {"said"}


def test_a_greeting_differs_from_silence() -> None:
    assert observe(say("Hello")).differences(observe()) == {"said"}


def test_options_count_but_not_their_order_or_case_nor_the_question() -> None:
    one = observe(ask("Yes", "no", to="person"))
    assert one == observe(ask("no", "yes", to="", question="Would you like some tea?"))
    assert one.differences(observe(ask("yes", "no", "maybe"))) == {"asked"}
    assert one.differences(observe(ask("yes", "no", room="office 1"))) == {"asked"}


def test_carried_things_count_with_their_rooms() -> None:
    one = observe(Event("pick", "the mug", place="office 1"), Event("place", "mug", place=START))
    assert one == observe(Event("pick", "mug", place="office 1"), Event("place", "the mug", place=START))
    assert one.differences(observe(Event("pick", "mug", place="office 1"))) == {"moved"}


def test_last_room_counts() -> None:
    assert observe(drive(START, "office 1")).differences(observe()) == {"room"}
    assert observe(drive(START, "office 1"), drive("office 1", START)) == observe()
    lost = Event("goto", "attic", place=START)
    assert observe(lost) == observe()


def test_endings_differ_and_have_no_last_room() -> None:
    assert observe_failure(Status.ROBOT_ERROR).ending == "PickObjectNotFound"
    assert observe_failure(Status.TIMEOUT) == observe_failure(Status.TIMEOUT, "TimeoutError")
    assert observe_failure(Status.TIMEOUT).differences(observe_failure(Status.ROBOT_ERROR)) == {"ending"}
    assert observe_failure(Status.KILLED).room == ""


def test_own_skills_count_by_kind_and_text() -> None:
    one = observe(Event("wave", "left", more=("twice",)), Event("nod", ""))
    assert one == observe(Event("nod", ""), Event("wave", "left", more=("twice",)))
    assert one.differences(observe(Event("nod", ""), Event("wave", "left"))) == {"done"}


def test_addressee_counts_where_candidates_name_different_people() -> None:
    alice, bob, anybody = (ask("yes", "no", to=name) for name in ("Alice", "the Bob", "person"))
    several = rooms_with_several([(alice,), (bob,), (anybody,)])
    assert several == {START}
    assert rooms_with_several([(alice,), (anybody,), (ask("yes", room="office 1", to="Bob"),)]) == frozenset()
    shown = [
        behaviour_of(Outcome(Status.FINISHED, (one,)), START, NAMES, several) for one in (alice, bob, anybody)
    ]
    assert len({*shown}) == 3
    assert observe(alice) == observe(bob)


def test_a_room_does_not_have_two_things_for_one_run_and_one_for_another() -> None:
    pick, look = Event("pick", "mug", place="hall"), Event("check", "mug", found=False, place="hall")
    put = Event("place", "mug", place="hall")
    assert count_conflicts([(pick, pick), (pick, look)]) == 1
    assert count_conflicts([(pick,), (pick, look)]) == 0
    assert count_conflicts([(pick, pick), (pick, put, look)]) == 0, "the robot has put it there"
    assert count_conflicts([(pick,), (look,)]) == 1


def test_one_thing_is_confusing_in_several_rooms_unless_a_run_finds_several() -> None:
    def looks(*rooms: str) -> Trace:
        return tuple(Event("check", "mug", found=True, place=room) for room in rooms)

    assert count_in_other_rooms([looks("lab"), looks("den")]) == 1
    assert count_in_other_rooms([looks("lab"), looks("lab"), ()]) == 0
    assert count_in_other_rooms([looks("lab", "den"), looks("den")]) == 0, "there are several mugs"
    missed = (Event("check", "mug", found=False, place="den"),)
    assert count_in_other_rooms([looks("lab"), missed]) == 0
