"""A sampled world draws its facts when the program asks, and keeps them."""

import itertools
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.trace import Option
from codebotler.core.world import Person, Room, World
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.matching import normalized
from codebotler.simulator.worlds.robot import Argument, Result
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_facts import whereabouts
from codebotler.simulator.worlds.sampled_robot import SampledRobot

ROOMS = RoomMap(("start_loc", "kitchen", "lab"), "start_loc")
YES_NO = (Option("Yes"), Option("No"))


def robot_in(room: str = "kitchen", sample: int = 0, *, seed: int = 0, strict: bool = False) -> SampledRobot:
    robot = SampledRobot(ROOMS, FactSampler(seed, sample, strict))
    robot.perform("go_to", [room])
    return robot


def look(robot: SampledRobot, what: str) -> Result:
    return robot.perform("is_in_room", [what])


def kitchen_robot(what: str, *, there: bool) -> SampledRobot:
    """Return a robot that looked for something in the kitchen and found it, or did not."""
    robots = (robot_in(sample=number) for number in range(100))
    return next(robot for robot in robots if look(robot, what) is there)


def failure(robot: SampledRobot, skill: str, *arguments: Any) -> str:  # noqa: ANN401 - of any skill
    with pytest.raises(RobotError) as caught:
        robot.perform(skill, arguments)
    return caught.value.kind


# --- rooms


def test_rooms_are_those_of_the_map_and_match_as_in_the_simulator() -> None:
    robot = SampledRobot(ROOMS, FactSampler())
    assert robot.perform("get_all_rooms", ()) == ["start_loc", "kitchen", "lab"]
    assert robot.perform("get_current_location", ()) == "start_loc"
    robot.perform("go_to", ["the Kitchen, please"])
    assert robot.perform("get_current_location", ()) == "kitchen"
    assert failure(robot, "go_to", "kitch") == "GoToInvalidLocation"
    assert robot.room == "kitchen"
    assert [(event.kind, event.text) for event in robot.trace] == [
        ("goto", "the Kitchen, please"),
        ("goto", "kitch"),
    ]


def test_rooms_of_a_world_keep_their_regexes_and_their_start() -> None:
    world = World((Room("lab [12]", people=(Person("amy"),)), Room("hall")), "hall")
    robot = SampledRobot(RoomMap.of(world), FactSampler())
    assert robot.perform("get_current_location", ()) == "hall"
    robot.perform("go_to", ["lab 2"])
    assert robot.room == "lab [12]"


def test_guessed_rooms_are_plain_texts_and_other_rooms_exist_too() -> None:
    robot = SampledRobot(RoomMap(("c++ lab", "hall"), "hall", guessed=True), FactSampler())
    robot.perform("go_to", ["C++ lab"])
    assert robot.room == "c++ lab"
    robot.perform("go_to", [" attic "])
    assert robot.room == "attic"
    robot.perform("is_in_room", ["box"])
    assert robot.perform("get_all_rooms", ()) == ["c++ lab", "hall"]
    assert failure(robot, "go_to", " ") == "GoToInvalidLocation"


def test_longer_room_name_is_preferred_to_one_that_it_contains() -> None:
    room_map = RoomMap(("lab", "lab 2", "hall"), "hall", guessed=True)
    assert (room_map.room("Lab 2"), room_map.room("the lab"), room_map.room("")) == ("lab 2", "lab", None)


# --- looks


def test_repeated_look_has_the_same_result() -> None:
    for sample in range(30):
        robot = robot_in(sample=sample)
        first = look(robot, "mug")
        robot.perform("go_to", ["lab"])
        look(robot, "mug")
        robot.perform("go_to", ["kitchen"])
        assert look(robot, "mug") is first
        assert look(robot, "the Mug") is first
        assert len([fact for fact in robot.facts if '"kitchen"' in fact.sentence]) == 1


def test_look_succeeds_in_about_half_of_the_worlds_and_differs_by_room() -> None:
    seen = [look(robot_in(sample=number), "mug") for number in range(200)]
    assert 70 < sum(map(bool, seen)) < 130
    in_lab = [look(robot_in("lab", number), "mug") for number in range(200)]
    assert seen != in_lab


def test_look_in_a_lucky_world_mostly_succeeds() -> None:
    seen = [
        FactSampler(sample=number, lucky=True).decide("is_there", "kitchen", "mug").result
        for number in range(200)
    ]
    assert 155 < sum(seen) < 195


def test_look_for_a_longer_name_agrees_with_one_for_a_part() -> None:
    assert look(kitchen_robot("stapler", there=True), "red stapler") is True
    assert look(kitchen_robot("red stapler", there=False), "stapler") is False


def test_all_words_for_people_mean_the_same() -> None:
    for number in range(10):
        robot = robot_in(sample=number)
        assert len({look(robot, word) for word in ("person", "Somebody", "any person", "a human", "")}) == 1
    assert normalized("The  Mug") == "mug"
    assert normalized("another person") == normalized("anyone")
    assert normalized("anne") == "anne"


def test_thing_is_not_a_person() -> None:
    robots = (robot_in(sample=number) for number in range(40))
    assert {look(robot, "person") for robot in robots if look(robot, "body")} == {True, False}


def test_looking_and_speaking_are_idle() -> None:
    assert robot_in().idle_skills == {"is_in_room", "get_all_rooms", "get_current_location", "say"}


def test_picked_object_is_gone_and_placed_object_is_there() -> None:
    robot = kitchen_robot("mug", there=True)
    robot.perform("pick", ["mug"])
    assert look(robot, "mug") is False
    robot.perform("go_to", ["lab"])
    assert failure(robot, "place", "the mug") == "PlaceNoObject"
    robot.perform("place", ["mug"])
    assert look(robot, "the mug") is True
    robot.perform("pick", ["mug"])
    robot.perform("go_to", ["kitchen"])
    assert look(robot, "mug") is False
    robot.perform("place", ["mug"])
    assert look(robot, "mug") is True


def test_placed_object_is_there_even_if_an_earlier_look_missed_it() -> None:
    robot = kitchen_robot("mug", there=False)
    robot.perform("go_to", ["lab"])
    robot.perform("pick", ["mug"])
    robot.perform("go_to", ["kitchen"])
    robot.perform("place", ["mug"])
    assert look(robot, "mug") is True


# --- assumptions without a look


def test_assumption_without_a_look_is_true() -> None:
    for number in range(30):
        robot = robot_in(sample=number)
        robot.perform("pick", ["stapler"])
        assert robot.perform("ask", ["alice", "Tea?", YES_NO]) in {0, 1}
        assert look(robot, "person") is True
        fact = whereabouts("alice", "kitchen", is_there=True, is_random=False)
        assert fact in robot.facts
        assert fact.sentence == '"alice" is in "kitchen"'


def test_second_pick_without_a_look_succeeds_until_a_look() -> None:
    robot = robot_in()
    for _ in range(2):
        robot.perform("pick", ["stapler"])
        robot.perform("go_to", ["lab"])
        robot.perform("place", ["stapler"])
        robot.perform("go_to", ["kitchen"])
    assert look(robot, "stapler") is False
    assert failure(robot, "pick", "stapler") == "PickInvalidObject"


def test_observed_absence_makes_skills_fail() -> None:
    assert failure(kitchen_robot("mug", there=False), "pick", "mug") == "PickInvalidObject"
    assert failure(kitchen_robot("alice", there=False), "ask", "alice", "Tea?", YES_NO) == "AskNoPerson"
    nobody = kitchen_robot("person", there=False)
    assert failure(nobody, "ask", "", "Tea?", YES_NO) == "AskNoPerson"
    assert failure(nobody, "ask", "alice", "Tea?", YES_NO) == "AskNoPerson"


def test_error_about_an_absent_person_does_not_claim_that_the_room_is_empty() -> None:
    for absent, says_empty in (("alice", False), ("person", True)):
        with pytest.raises(RobotError) as caught:
            kitchen_robot(absent, there=False).perform("ask", ["alice", "Tea?", YES_NO])
        assert ("nobody is in" in str(caught.value)) == says_empty


def test_absent_object_says_nothing_about_people_or_other_rooms() -> None:
    robot = kitchen_robot("mug", there=False)
    robot.perform("ask", ["", "Where is the mug?", YES_NO])
    robot.perform("go_to", ["lab"])
    robot.perform("pick", ["mug"])


def test_strict_world_draws_the_assumptions_of_the_program() -> None:
    picked: set[str] = set()
    answered: set[str] = set()
    granted: list[tuple[str, Sequence[Argument], set[str]]] = [
        ("pick", ["stapler"], picked),
        ("ask", ["alice", "Tea?", YES_NO], answered),
    ]
    for number in range(40):
        robot = robot_in(sample=number, strict=True)
        for skill, arguments, ended in granted:
            try:
                robot.perform(skill, arguments)
                ended.add("done")
            except RobotError as error:
                ended.add(error.kind)
        assert all(fact.is_random for fact in robot.facts)
    assert picked == {"done", "PickInvalidObject"}
    assert answered == {"done", "AskNoPerson"}


def test_strict_world_has_no_second_object() -> None:
    robots = (robot_in(sample=number, strict=True) for number in range(100))
    robot = next(robot for robot in robots if robot.sampler.decide("is_there", "kitchen", "mug").result)
    robot.perform("pick", ["mug"])
    robot.perform("go_to", ["lab"])
    robot.perform("place", ["mug"])
    robot.perform("go_to", ["kitchen"])
    assert failure(robot, "pick", "mug") == "PickInvalidObject"


def test_robot_holds_one_thing_and_questions_need_options() -> None:
    robot = robot_in()
    assert failure(robot, "ask", "alice", "Tea?", ()) == "AskEmptyOptions"
    assert failure(robot, "place", "mug") == "PlaceNoObject"
    robot.perform("pick", ["mug"])
    assert failure(robot, "pick", "cup") == "PickWhileHolding"


# --- answers


def test_answers_are_random_options_and_stay_the_same() -> None:
    options = tuple(Option(text) for text in ("tea", "water", "1", "10"))
    chosen = set()
    for number in range(60):
        robot = robot_in(sample=number)
        first = robot.perform("ask", ["alice", "What to drink?", options])
        assert robot.perform("ask", ["alice", "What to drink?", options]) == first
        turned = options[::-1]
        again = robot.perform("ask", ["alice", "What to drink?", turned])
        assert isinstance(first, int)
        assert isinstance(again, int)
        assert turned[again] == options[first]
        assert robot.trace[-1].answer == options[first].text
        chosen.add(first)
    assert chosen == {0, 1, 2, 3}


def test_an_answer_that_is_no_longer_offered_is_drawn_again() -> None:
    robot = robot_in()
    robot.perform("ask", ["", "Which?", (Option("a"),)])
    assert robot.perform("ask", ["", "Which?", (Option("b"),)]) == 0
    assert [re.findall('".+?"', fact.sentence) for fact in robot.facts][1:] == [
        ['"kitchen"', '"Which?"', '"a"'],
        ['"kitchen"', '"Which?"', '"b"'],
    ]


# --- excuses for bad luck


def search_rooms(what: str, in_kitchen: bool, in_lab: bool, seed: int = 0) -> SampledRobot:  # noqa: FBT001 - a row of a table
    for number in itertools.count():
        robot = robot_in(sample=number, seed=seed)
        if look(robot, what) is not in_kitchen:
            continue
        robot.perform("go_to", ["lab"])
        if look(robot, what) is in_lab:
            return robot
    raise AssertionError


def test_search_in_vain_excuses_the_failures_that_follow() -> None:
    robot = search_rooms("mug", in_kitchen=False, in_lab=False)
    assert failure(robot, "place", "mug") == "PlaceNoObject"
    assert len(robot.excuses) == 1
    assert failure(robot, "place", "cup") == "PlaceNoObject"
    assert len(robot.excuses) == 1
    robot = search_rooms("alice", in_kitchen=False, in_lab=False)
    assert failure(robot, "ask", "alice", "Tea?", YES_NO) == "AskNoPerson"
    assert len(robot.excuses) == 1


def test_single_look_in_vain_excuses_nothing() -> None:
    robot = kitchen_robot("mug", there=False)
    for skill in ("place", "pick"):
        assert failure(robot, skill, "mug") in {"PlaceNoObject", "PickInvalidObject"}
    assert look(robot, "mug") is False
    assert failure(robot, "pick", "mug")
    assert robot.excuses == set()


def test_search_that_found_the_person_excuses_nothing() -> None:
    robot = search_rooms("alice", in_kitchen=True, in_lab=False)
    assert failure(robot, "ask", "alice", "Tea?", YES_NO) == "AskNoPerson"
    assert robot.excuses == set()


def test_long_search_that_found_the_person_once_excuses_nothing() -> None:
    robot = search_rooms("alice", in_kitchen=False, in_lab=True)
    while not robot.here.lacks("alice"):
        robot = search_rooms("alice", in_kitchen=False, in_lab=True, seed=robot.sampler.seed + 1)
        robot.perform("go_to", ["start_loc"])
        look(robot, "alice")
    assert len(robot.searches["alice"].rooms_without) == 2
    assert failure(robot, "ask", "alice", "Tea?", YES_NO) == "AskNoPerson"
    assert robot.excuses == set()


@pytest.mark.parametrize(("sought", "placed"), [("my blue mug", "mug"), ("mug", "the blue mug")])
def test_search_by_a_longer_or_shorter_name_excuses_failures(sought: str, placed: str) -> None:
    robot = search_rooms(sought, in_kitchen=False, in_lab=False)
    assert failure(robot, "place", placed) == "PlaceNoObject"
    assert len(robot.excuses) == 1


def test_waiting_in_vain_does_not_excuse_asking() -> None:
    robot = kitchen_robot("guest", there=False)
    robot.now = 60.0
    look(robot, "guest")
    assert failure(robot, "ask", "guest", "Tea?", YES_NO) == "AskNoPerson"
    assert robot.excuses == set()


def test_named_person_is_also_found_as_a_person() -> None:
    for sample in range(20):
        robot = SampledRobot(ROOMS, FactSampler(sample=sample))
        if look(robot, "Bob"):
            assert look(robot, "person")
        robot = SampledRobot(ROOMS, FactSampler(sample=sample))
        if not look(robot, "person"):
            assert not look(robot, "Bob")


def test_picked_thing_with_a_capitalized_name_is_gone() -> None:
    robot = kitchen_robot("Coke", there=True)
    robot.perform("pick", ["Coke"])
    assert not look(robot, "Coke")


@pytest.mark.parametrize("options", [("No", "Yes"), ("Yes", "No")])
def test_people_in_a_lucky_world_mostly_agree(options: tuple[str, ...]) -> None:
    def says_yes(sample: int, *, lucky: bool) -> bool:
        robot = SampledRobot(ROOMS, FactSampler(sample=sample, lucky=lucky))
        chosen = robot.perform("ask", ["Bob", "Tea?", tuple(map(Option, options))])
        return isinstance(chosen, int) and options[chosen] == "Yes"

    assert 20 < sum(says_yes(sample, lucky=False) for sample in range(64)) < 44
    assert sum(says_yes(sample, lucky=True) for sample in range(64)) > 52


def test_finding_the_thing_twice_excuses_picking_both() -> None:
    robot = search_rooms("mug", in_kitchen=True, in_lab=True)
    robot.perform("pick", ["mug"])
    assert failure(robot, "pick", "mug") == "PickWhileHolding"
    assert len(robot.excuses) == 1
    assert failure(robot, "pick", "cup") == "PickWhileHolding"
    assert len(robot.excuses) == 1


def test_strict_world_excuses_nothing() -> None:
    robot = search_rooms("mug", in_kitchen=False, in_lab=False)
    robot.sampler = FactSampler(robot.sampler.seed, robot.sampler.sample, strict=True)
    assert failure(robot, "place", "mug") == "PlaceNoObject"
    assert robot.excuses == set()


# --- seeds


def test_draws_depend_only_on_seed_sample_and_fact() -> None:
    def draw_numbers(sampler: FactSampler) -> list[int]:
        return [sampler.draw(1_000, "a fact", str(number)) for number in range(20)]

    assert draw_numbers(FactSampler(7, 3)) == draw_numbers(FactSampler(7, 3))
    assert (
        len(
            {
                tuple(draw_numbers(sampler))
                for sampler in (FactSampler(7, 3), FactSampler(7, 4), FactSampler(8, 3), FactSampler(73, 0))
            }
        )
        == 4
    )
    assert FactSampler(1).draw(1_000, "ab", "c") != FactSampler(1).draw(1_000, "a", "bc")


def test_draws_do_not_depend_on_the_hash_seed() -> None:
    code = (
        "from codebotler.simulator.worlds.fact_sampler import FactSampler\n"
        "print([FactSampler(5).draw(99, 'x', str(n)) for n in range(9)])\n"
    )
    printed = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert printed == {f"{[FactSampler(5).draw(99, 'x', str(n)) for n in range(9)]}\n".encode()}


def test_draw_holds_exactly_in_worlds_with_the_same_result() -> None:
    robot = robot_in(sample=1)
    look(robot, "mug")
    robot.perform("ask", ["", "Tea?", YES_NO])
    for number in range(30):
        other = robot_in(sample=number)
        same = look(other, "mug") == look(robot, "mug")
        same &= other.perform("ask", ["", "Tea?", YES_NO]) == robot.perform("ask", ["", "Tea?", YES_NO])
        assert all(draw.holds_in(other.sampler) for draw in robot.draws) is same


def answer_by_options(question: str, *options: str, person: str = "", sample: int = 0) -> str:
    robot = SampledRobot(ROOMS, FactSampler(sample=sample, by_options=True))
    chosen = robot.perform("ask", [person, question, tuple(map(Option, options))])
    assert isinstance(chosen, int)
    return options[chosen].lower()


def test_answers_by_options_ignore_the_words_of_the_question() -> None:
    worlds = range(20)
    first = [answer_by_options("Tea or coffee?", "tea", "coffee", sample=number) for number in worlds]
    same = [
        answer_by_options("What would you like?", "Coffee", "Tea", person="person", sample=number)
        for number in worlds
    ]
    assert first == same
    assert {*first} == {"tea", "coffee"}


def test_answers_by_options_differ_between_several_questions() -> None:
    robots = [SampledRobot(ROOMS, FactSampler(sample=number, by_options=True)) for number in range(20)]
    pairs = [
        tuple(robot.perform("ask", ["", text, YES_NO]) for text in ("Tea?", "Milk?")) for robot in robots
    ]
    assert len({*pairs}) == 4
    again = [robot.perform("ask", ["", "Tea?", YES_NO]) for robot in robots]
    assert again == [first for first, _ in pairs]
