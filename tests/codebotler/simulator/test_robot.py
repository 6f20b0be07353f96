import re
from typing import TypeAlias

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.errors import RobotError
from codebotler.core.trace import Event, Option
from codebotler.core.world import Person, Room, World
from codebotler.simulator.settings import SimulationSettings, choose
from codebotler.simulator.worlds.entities import Thing
from codebotler.simulator.worlds.matching import Matching, _pattern, resolve_room
from codebotler.simulator.worlds.robot import Result, SimulatedRobot

Texts: TypeAlias = tuple[str, ...]


def test_thing_that_was_put_down_is_found_without_a_regex() -> None:
    before = _pattern.cache_info()
    thing = Thing("Mug (of Amy)", is_pattern=False)
    assert thing.is_meant_by("the mug (OF AMY), please")
    assert not thing.is_meant_by("the mug of amy")
    assert not Thing("a" * 5_000 + "b", is_pattern=False).is_meant_by("a" * 10_000)
    assert _pattern.cache_info() == before


def options(*texts: str) -> tuple[Option, ...]:
    return tuple(map(Option, texts))


def robot_in(
    *rooms: str, objects: Texts = (), answers: Texts | None = None, start: str | None = None
) -> SimulatedRobot:
    """Return a robot in the first room, which holds the objects and the person."""
    people = () if answers is None else (Person(".*", answers),)
    first, *others = rooms or ("lab",)
    here = Room(first, objects=objects, people=people)
    return SimulatedRobot(World((here, *map(Room, others)), start or first))


def failure(robot: SimulatedRobot, skill: str, *arguments: str | tuple[Option, ...]) -> str:
    """Perform a skill that must fail, and return the kind of its error."""
    with pytest.raises(RobotError) as caught:
        robot.perform(skill, arguments)
    assert str(caught.value)
    return caught.value.kind


def go(request: str, *rooms: str) -> str:
    robot = robot_in("start", *rooms)
    robot.perform("go_to", [request])
    return robot.room


def look_for(request: str, *objects: str) -> Result:
    return robot_in(objects=objects).perform("is_in_room", [request])


# --- how a request finds a room, an object, a person (SEMANTICS.md, section 2)


def test_request_may_be_longer_than_the_label_of_the_room() -> None:
    assert go("the Main Conference Room", "conference room") == "conference room"


def test_request_may_not_be_shorter_than_the_label_of_the_room() -> None:
    robot = robot_in("start", "conference room")
    assert failure(robot, "go_to", "conference") == "GoToInvalidLocation"


def test_request_for_room_12_finds_an_earlier_room_1() -> None:
    rooms = [f"conference room {number}" for number in range(1, 13)]
    assert go("conference room 12", *rooms) == "conference room 1"


def test_request_with_two_rooms_means_the_first_of_the_world() -> None:
    assert go("alice's and bob's office", "bob's office", "alice's office") == "bob's office"


def test_later_room_is_found_if_the_earlier_one_does_not_match() -> None:
    assert go("alice's office", "bob's office", "alice's office") == "alice's office"


@pytest.mark.parametrize("matching", ["label-in-request", "whole-words"])
def test_name_is_found_literally_even_if_it_is_another_regex(matching: Matching) -> None:
    for request in ("Lab (2F)", "lab (2f)"):
        assert resolve_room(("hall", "Lab (2F)"), request, matching) == "Lab (2F)"
        assert Thing("lab (2F)").is_meant_by(request, matching)
    assert resolve_room(("hall", "Lab (2F)"), "Lab (2", matching) is None


def test_labels_ignore_case_and_match_across_lines() -> None:
    assert go("MAIN OFFICE", "Main Office") == "Main Office"
    assert go("room\n5", "room.5") == "room.5"


@pytest.mark.parametrize(
    ("request_", "label", "found"),
    [
        ("red staplers", "stapler", True),
        ("STAPLER", "stapler", True),
        ("stapler", "Stapler", True),
        ("bag", "backpack", False),
        ("backpack", "bag", False),
        ("", "mug", False),
        ("cup", "mug|cup", True),
        ("mugs", "^mug$", False),
    ],
)
def test_object_is_found_if_the_request_holds_its_label(request_: str, label: str, found: object) -> None:
    assert look_for(request_, label) is found


@given(st.text())
def test_look_in_an_occupied_room_finds_anything(request: str) -> None:
    assert robot_in(answers=("yes",)).perform("is_in_room", [request]) is True


@given(st.text())
def test_look_in_an_empty_room_finds_nothing(request: str) -> None:
    assert robot_in().perform("is_in_room", [request]) is False


def test_only_the_room_where_the_robot_is_counts() -> None:
    robot = robot_in("lab", "hall", objects=("mug",), answers=("yes",), start="hall")
    assert robot.perform("is_in_room", ["mug"]) is False
    assert failure(robot, "pick", "mug") == "PickInvalidObject"
    assert failure(robot, "ask", "", "Tea?", options("yes")) == "AskNoPerson"


def test_first_matching_object_of_the_room_is_taken() -> None:
    robot = robot_in(objects=("water", "cold water", "tea"))
    robot.perform("pick", ["a bottle of cold water"])
    assert [thing.label for thing in robot.contents["lab"]] == ["cold water", "tea"]


def test_placed_object_is_found_by_its_request_as_literal_text() -> None:
    robot = robot_in(objects=("stapler",))
    robot.perform("pick", ["stapler ("])
    robot.perform("place", ["stapler ("])
    assert robot.perform("is_in_room", ["stapler"]) is False
    assert robot.perform("is_in_room", ["the STAPLER ( there"]) is True
    robot.perform("pick", ["stapler ("])


def test_placed_object_with_special_characters_is_not_a_regex() -> None:
    robot = robot_in(objects=("mug",))
    robot.perform("pick", ["mug.*"])
    robot.perform("place", ["mug.*"])
    assert robot.perform("is_in_room", ["mug and tea"]) is False


# --- effects of skills (section 3)


def test_location_is_the_label_and_leaves_no_event() -> None:
    robot = robot_in("start", "lab")
    robot.perform("go_to", ["The LAB"])
    assert robot.perform("get_current_location", []) == "lab"
    assert robot.trace == (Event("goto", "The LAB"),)


def test_rooms_are_in_the_order_of_the_world_and_leave_no_event() -> None:
    robot = robot_in("start_loc", "b", "a")
    assert robot.perform("get_all_rooms", []) == ["start_loc", "b", "a"]
    assert robot.trace == ()


def test_list_of_rooms_is_a_copy() -> None:
    robot = robot_in("start", "lab")
    rooms = robot.perform("get_all_rooms", [])
    assert isinstance(rooms, list)
    rooms.remove("lab")
    robot.perform("go_to", ["lab"])


def test_failed_drive_is_recorded_and_leaves_the_robot_where_it_is() -> None:
    robot = robot_in("start", "lab")
    assert failure(robot, "go_to", "attic") == "GoToInvalidLocation"
    assert (robot.room, robot.trace) == ("start", (Event("goto", "attic"),))


def test_look_is_recorded_with_its_result() -> None:
    robot = robot_in(objects=("mug",))
    robot.perform("is_in_room", ["mug"])
    robot.perform("is_in_room", ["cup"])
    assert robot.trace == (Event("check", "mug", found=True), Event("check", "cup", found=False))


def test_speaking_needs_no_listener() -> None:
    robot = robot_in()
    assert robot.perform("say", ["Hello"]) is None
    assert robot.trace == (Event("say", "Hello"),)


@pytest.mark.parametrize("skill", ["go_to", "is_in_room", "say", "pick"])
def test_events_hold_the_request_with_its_case_but_stripped(skill: str) -> None:
    robot = robot_in("The Lab", objects=("lab",))
    robot.perform(skill, [" \t the Lab \n"])
    assert [event.text for event in robot.trace] == ["the Lab"]


def test_options_keep_their_spaces_but_the_question_is_stripped() -> None:
    robot = robot_in(answers=(".*",))
    robot.perform("ask", ["", "  Tea?\n", options(" Yes ", "No")])
    assert robot.trace == (Event("ask", "Tea?", options(" Yes ", "No"), answer=" Yes "),)


def test_held_object_is_the_raw_request_and_must_be_named_exactly() -> None:
    robot = robot_in(objects=("stapler",))
    robot.perform("pick", [" the Stapler "])
    for wrong in ("the Stapler", " the stapler ", "stapler", ""):
        assert failure(robot, "place", wrong) == "PlaceNoObject"
    robot.perform("place", [" the Stapler "])
    assert robot.trace == (Event("pick", "the Stapler"), Event("place", "the Stapler"))


def test_picked_object_is_gone_and_placed_object_lies_in_the_room_of_the_robot() -> None:
    robot = robot_in("lab", "hall", objects=("mug",))
    robot.perform("pick", ["mug"])
    assert robot.perform("is_in_room", ["mug"]) is False
    robot.perform("go_to", ["hall"])
    robot.perform("place", ["mug"])
    assert robot.perform("is_in_room", ["mug"]) is True
    robot.perform("go_to", ["lab"])
    assert robot.perform("is_in_room", ["mug"]) is False


def test_failed_pick_and_failed_place_leave_no_event() -> None:
    robot = robot_in(objects=("mug",))
    assert failure(robot, "pick", "cup") == "PickInvalidObject"
    assert failure(robot, "place", "mug") == "PlaceNoObject"
    assert (robot.trace, robot.held) == ((), None)


def test_held_object_is_an_error_before_a_missing_one() -> None:
    robot = robot_in(objects=("mug", "cup"))
    robot.perform("pick", ["mug"])
    assert failure(robot, "pick", "cup") == "PickWhileHolding"
    assert failure(robot, "pick", "sofa") == "PickWhileHolding"
    robot.perform("place", ["mug"])
    assert failure(robot, "place", "mug") == "PlaceNoObject"
    robot.perform("pick", ["cup"])


def test_empty_request_that_was_picked_can_be_placed() -> None:
    robot = robot_in(objects=(".*",))
    robot.perform("pick", [""])
    assert failure(robot, "pick", "mug") == "PickWhileHolding"
    robot.perform("place", [""])


def test_robot_leaves_the_world_unchanged() -> None:
    world = World((Room("lab", ("mug",), (Person(".*", ("a", "b")),)),), "lab")
    for _ in range(2):
        robot = SimulatedRobot(world)
        robot.perform("pick", ["mug"])
        assert robot.perform("ask", ["", "?", options("a", "b")]) == 0


def test_events_have_place_and_time() -> None:
    robot = robot_in("hall", "lab")
    robot.perform("go_to", ["lab"])
    robot.now = 2.5
    robot.perform("say", ["a"])
    assert [(event.place, event.time) for event in robot.trace] == [("hall", 0.0), ("lab", 2.5)]


def test_look_is_idle_unless_a_person_may_come() -> None:
    for looks in (0, 2):
        people = (Person("ann", after_looks=looks),)
        robot = SimulatedRobot(World((Room("hall", people=people),), "hall"))
        assert ("is_in_room" in robot.idle_skills) == (looks == 0)


# --- questions (section 4)


def test_question_without_options_is_recorded_and_fails_even_in_an_empty_room() -> None:
    for answers in (None, ("yes",)):
        robot = robot_in(answers=answers)
        assert failure(robot, "ask", "bob", "Tea?", ()) == "AskEmptyOptions"
        assert robot.trace == (Event("ask", "Tea?"),)


def test_question_without_options_uses_up_no_answer() -> None:
    robot = robot_in(answers=("tea", "milk"))
    assert failure(robot, "ask", "", "?", ()) == "AskEmptyOptions"
    assert robot.perform("ask", ["", "?", options("milk", "tea")]) == 1


def test_question_in_an_empty_room_is_recorded_and_fails() -> None:
    robot = robot_in()
    assert failure(robot, "ask", "bob", "Tea?", options("yes")) == "AskNoPerson"
    assert robot.trace == (Event("ask", "Tea?", options("yes")),)


@given(st.text())
def test_person_answers_to_any_name(name: str) -> None:
    assert robot_in(answers=("yes",)).perform("ask", [name, "?", options("no", "yes")]) == 1


def test_answers_are_used_up_in_order_and_the_last_one_stays() -> None:
    robot = robot_in(answers=("a", "b", "c"))
    chosen = [robot.perform("ask", ["", "?", options("a", "b", "c")]) for _ in range(5)]
    assert chosen == [0, 1, 2, 2, 2]


def test_person_without_answers_fits_no_option() -> None:
    robot = robot_in(answers=())
    assert failure(robot, "ask", "", "Tea?", options("yes", "no")) == "AskInvalidOptions"
    assert robot.trace == (Event("ask", "Tea?", options("yes", "no")),)


def test_question_that_fits_no_option_has_used_up_an_answer() -> None:
    robot = robot_in(answers=("milk", "tea"))
    assert failure(robot, "ask", "", "?", options("tea", "juice")) == "AskInvalidOptions"
    assert robot.perform("ask", ["", "?", options("juice", "tea")]) == 1


def test_event_of_a_question_holds_the_answer() -> None:
    robot = robot_in(answers=("TEA",))
    robot.perform("ask", ["bob", "What?", options("juice", "green tea")])
    assert robot.trace == (Event("ask", "What?", options("juice", "green tea"), answer="green tea"),)


@pytest.mark.parametrize(
    ("answer", "question", "offered", "chosen"),
    [
        ("lemonade", "Lemonade?", ("No", "Yes"), 1),
        ("lemonade", "Tea?", ("No", "Yes"), 0),
        ("lemonade", "Tea?", ("Yes", "lemonade", "Lemonade!"), 1),
        ("LEMONADE", "Tea?", ("Yes", "some lemonade"), 1),
        (".*", "Tea?", ("x", "yes"), 0),
        ("lemonade", "Lemonade?", ("tea", "no"), None),
        ("lemonade", "Tea?", ("I don't kNOw", "no"), 0),
        ("lemonade", "Lemonade?", ("oh YES please", "yes"), 0),
        ("lemonade", "Tea?", ("tea", "juice"), None),
        ("lemonade", "Tea?", ("yes", "juice"), None),
        ("lemon", "Lemonade?", ("no", "yes"), 1),
        ("^tea$", "Tea", ("no", "yes"), 1),
        ("yes", "Yes?", ("maybe", "no"), None),
        ("yes", "Tea?", ("maybe", "no"), 1),
    ],
)
def test_answer_chooses_the_option_that_holds_it_or_else_yes_or_no(
    answer: str, question: str, offered: Texts, chosen: int | None
) -> None:
    assert choose(answer, question, options(*offered)) == chosen


@given(st.text(), st.lists(st.text(), min_size=1).map(tuple))
def test_answer_that_matches_all_options_chooses_the_first(question: str, offered: Texts) -> None:
    assert choose(".*", question, options(*offered)) == 0


@given(st.text(), st.text(), st.lists(st.text(max_size=5), max_size=4).map(tuple))
def test_chosen_option_holds_the_answer_or_else_yes_or_no(answer: str, question: str, offered: Texts) -> None:
    def has(part: str, text: str) -> bool:
        return re.search(part, text, re.IGNORECASE) is not None

    literal = re.escape(answer)
    chosen = choose(literal, question, options(*offered))
    wanted = literal
    if not any(has(literal, option) for option in offered):
        wanted = "yes" if has(literal, question) else "no"
    fitting = [position for position, option in enumerate(offered) if has(wanted, option)]
    assert chosen == (fitting[0] if fitting else None)


def test_second_person_in_a_room_is_not_asked() -> None:
    people = (Person(".*", ("milk",)), Person(".*", ("tea",)))
    robot = SimulatedRobot(World((Room("lab", people=people),), "lab"))
    assert failure(robot, "ask", "", "?", options("tea")) == "AskInvalidOptions"


def test_number_among_the_options_is_matched_as_text() -> None:
    robot = robot_in(answers=("2",))
    offered = (Option("1", is_text=False), Option("2", is_text=False))
    assert robot.perform("ask", ["", "?", offered]) == 1
    assert robot.trace == (Event("ask", "?", offered, answer="2"),)


# --- the rest


def test_events_have_the_place_and_the_destination_of_drives() -> None:
    robot = robot_in("hall", "lab", "office")
    for request in ("the lab", "attic", "office"):
        try:
            robot.perform("go_to", [request])
        except RobotError:
            robot.perform("say", ["where?"])
    assert [(e.place, e.destination) for e in robot.trace] == [
        ("hall", "lab"),
        ("lab", None),
        ("lab", None),
        ("lab", "office"),
    ]


def test_robot_uses_the_settings_of_the_suite() -> None:
    settings = SimulationSettings(literals="as-written")
    assert SimulatedRobot(World((Room("a"),), "a"), settings).settings is settings
