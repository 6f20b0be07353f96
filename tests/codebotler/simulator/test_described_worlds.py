"""Worlds with properties of things and people and with places in rooms, and skills that read them."""

from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.trace import Option
from codebotler.core.world import Room, World, is_within, laid_out
from codebotler.core.world_file import read_world
from codebotler.missions.storage.map_event import map_data, map_from
from codebotler.robots.simulated import SIMULATION
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot

FLAT = """
robot: hall
rooms:
  - hall
  - {name: kitchen, places: [kitchen table, sink]}
  - bathroom
objects:
  kitchen table: [{name: apple, is: [fruit, red], size: 2}, {name: pear, is: [fruit, green]}, mug]
  sink: [sponge]
people:
  kitchen:
    - {name: Angel, pose: waving, wears: red coat, answers: ["yes"]}
    - {name: Bo, pose: sitting, tall: true}
  hall: [{name: Cy, answers: ["no"]}]
truths: {Number of cups: 3}
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    path = tmp_path_factory.mktemp("world") / "flat.yaml"
    path.write_text(FLAT)
    return read_world(path)


@pytest.fixture
def robot(world: World) -> SimulatedRobot:
    return SimulatedRobot(world, SIMULATION)


def robot_in(world: World, sample: int = 0) -> SampledRobot:
    return SampledRobot(RoomMap.of(world), FactSampler(sample=sample))


def test_world_file_keeps_places_and_properties(world: World, tmp_path: Path) -> None:
    path = tmp_path / "again.yaml"
    path.write_text(world.to_yaml())
    assert read_world(path) == world


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("pose: waving", "anwers: [x]", 12),
        ("size: 2", "size: {x: 1}", 8),
        ("mug]", "{name: apple, is: [fruit, green]}]", 8),
        ("[kitchen table, sink]", "[kitchen table, hall]", 5),
        ("Number of cups: 3", "Number of cups: [3]", 15),
    ],
)
def test_mistake_is_an_error_with_its_line(tmp_path: Path, old: str, new: str, line: int) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(FLAT.replace(old, new))
    with pytest.raises(UserError) as raised:
        read_world(path)
    assert raised.value.line == line


def test_place_is_a_destination_but_not_a_room(world: World, robot: SimulatedRobot) -> None:
    assert robot.perform("get_all_rooms", []) == ["hall", "kitchen", "bathroom"]
    robot.perform("go_to", ["the kitchen table"])
    assert (robot.room, robot.trace[-1].destination) == ("kitchen table", "kitchen table in kitchen")
    rooms = {room.name: room for room in laid_out(world).rooms}
    for place in ("kitchen table", "sink"):
        assert all(
            is_within(corner, rooms["kitchen"].footprint or ()) for corner in rooms[place].footprint or ()
        )


def test_things_at_places_are_found_in_the_room_and_only_there(robot: SimulatedRobot) -> None:
    def finds(where: str, what: str) -> object:
        robot.perform("go_to", [where])
        return robot.perform("is_in_room", [what])

    assert finds("kitchen", "apple")
    assert finds("kitchen table", "apple")
    assert not finds("sink", "apple")
    assert finds("sink", "Angel")  # people at a place are in its room
    assert not finds("bathroom", "apple")


def test_thing_put_down_at_a_place_lies_there(robot: SimulatedRobot) -> None:
    robot.perform("go_to", ["kitchen"])
    robot.perform("pick", ["apple"])
    robot.perform("go_to", ["sink"])
    robot.perform("place", ["apple"])
    assert robot.things("sink") == ["sponge", "apple"]
    assert "apple" not in robot.things("kitchen table")


@pytest.mark.parametrize(
    ("request_", "is_there"),
    [
        ("fruit", True),
        ("red fruit", True),
        ("the red apple", True),
        ("green apple", False),
        ("mug", True),
        ("waving person", True),
        ("person in a red coat", True),
        ("tall person", True),
        ("sitting person in a red coat", False),
        ("Angel", True),
        ("waving Angel", True),
        ("sitting Angel", False),
    ],
)
def test_description_finds_things_and_people(robot: SimulatedRobot, request_: str, is_there: bool) -> None:  # noqa: FBT001 - a case
    robot.perform("go_to", ["kitchen"])
    assert robot.perform("is_in_room", [request_]) is is_there


def test_description_means_the_first_match(robot: SimulatedRobot) -> None:
    robot.perform("go_to", ["kitchen"])
    robot.perform("pick", ["green fruit"])
    assert robot.taken is not None
    assert robot.taken.label == "pear"


def test_skills_read_the_world(robot: SimulatedRobot) -> None:
    assert robot.things("kitchen", is_="fruit") == ["apple", "pear"]
    assert robot.things("hall") == []
    assert robot.people("kitchen", wears="red coat") == ["Angel"]
    assert robot.people("sink", is_="waving person") == ["Angel"]  # a place has the people of its room
    assert robot.people(is_="person") == ["Cy", "Angel", "Bo"]
    assert robot.traits("apple")["size"] == 2
    assert robot.value("number of cups", 0, 1) == 3
    assert robot.value("the colour", "red") == "red"
    with pytest.raises(RobotError):
        robot.things("cellar")


def test_people_can_be_moved(robot: SimulatedRobot) -> None:
    robot.move_person("Angel", "bathroom")
    assert robot.people("bathroom") == ["Angel"]
    assert robot.people("kitchen") == ["Bo"]
    robot.move_person("sitting person", "hall")
    assert robot.people("hall") == ["Cy", "Bo"]
    with pytest.raises(RobotError):
        robot.move_person("Dora", "bathroom")


def test_sampled_worlds_draw_known_things_and_people(world: World) -> None:
    counts = {len(robot_in(world, number).things("kitchen", is_="fruit")) for number in range(30)}
    assert {0, 1, 2} <= counts
    names = {name for number in range(30) for name in robot_in(world, number).people("hall", pose="waving")}
    assert names == {"Angel"}
    unknown = {name for number in range(30) for name in robot_in(world, number).things("hall", is_="toy")}
    assert unknown == {"toy", "another toy"}


def test_people_found_in_a_room_can_be_asked_there(world: World) -> None:
    answers = set()
    for number in range(20):
        robot = robot_in(world, number)
        robot.perform("go_to", ["kitchen"])
        for name in robot.people("kitchen", is_="waving person"):
            answers.add(robot.perform("ask", [name, "Tea?", (Option("yes"), Option("no"))]))
    assert answers == {0, 1}


@pytest.mark.parametrize(
    ("request_", "finds"), [("waving person", "people"), ("person", "people"), ("fruit", "things")]
)
def test_skills_and_looks_find_the_same(world: World, request_: str, finds: str) -> None:
    for number in range(30):
        robot = robot_in(world, number)
        robot.perform("go_to", ["bathroom"])
        is_there = robot.perform("is_in_room", [request_])
        assert bool(getattr(robot, finds)("bathroom", is_=request_)) is is_there
        robot.perform("go_to", ["hall"])
        if not getattr(robot, finds)("hall", is_=request_):
            assert not robot.perform("is_in_room", [request_])


def test_sampled_world_keeps_its_facts(world: World) -> None:
    for number in range(20):
        robot = robot_in(world, number)
        there = robot.things("hall", is_="fruit")
        assert robot.things("hall", is_="fruit") == there
        assert robot.perform("is_in_room", ["apple"]) is ("apple" in there)


def test_skills_read_rooms_of_a_guessed_map() -> None:
    counts = set()
    for number in range(10):
        robot = SampledRobot(RoomMap(("hall",), "hall", guessed=True), FactSampler(sample=number))
        robot.drive("loft")
        counts.add(len(robot.people("loft", is_="person")))
    assert counts == {0, 1, 2}


def test_moved_person_is_in_the_new_room(world: World) -> None:
    for number in range(10):
        robot = robot_in(world, number)
        robot.move_person("Angel", "bathroom")
        robot.perform("go_to", ["bathroom"])
        assert robot.perform("is_in_room", ["Angel"])


# --- places and house rules


def robots_with_rules(world: World, *rules: Rule) -> list[SimulatedRobot]:
    room_map = RoomMap.of(world)
    simulated = SimulatedRobot(world, SIMULATION, guard=RuleGuard(rules, room_map))
    return [simulated, SampledRobot(room_map, FactSampler(), guard=RuleGuard(rules, room_map))]


def test_rules_about_a_room_apply_at_its_places(world: World) -> None:
    stay_out = Rule("kitchen", "Stay out.", parse('not tr.Exists(goto("kitchen$"))'))
    be_silent = Rule("silent", "Be silent there.", parse('not tr.Exists(at("kitchen", say(".")))'))
    for robot in robots_with_rules(world, stay_out):
        with pytest.raises(RuleViolationError):
            robot.perform("go_to", ["sink"])
    for robot in robots_with_rules(world, be_silent):
        robot.perform("go_to", ["sink"])
        with pytest.raises(RuleViolationError):
            robot.perform("say", ["hello"])


def test_drive_to_a_place_in_the_room_does_not_leave_it(world: World) -> None:
    said = Rule("said", "Speak before you leave.", parse('tr.Exists(say("."))'), "leaving")
    start = replace(world, robot="kitchen")
    for robot in robots_with_rules(start, said):
        robot.perform("go_to", ["sink"])
        robot.perform("go_to", ["the kitchen table"])
        with pytest.raises(RuleViolationError):
            robot.perform("go_to", ["hall"])


# --- names of places, and positions of things


def test_request_with_place_and_room_means_the_place(world: World) -> None:
    for robot in (SimulatedRobot(world, SIMULATION), robot_in(world)):
        robot.perform("go_to", ["the sink in the kitchen"])
        assert robot.room == "sink"


@pytest.mark.parametrize(
    ("request_", "goal"),
    [
        ("sofa in living room", "sofa"),
        ("the sofa in the living room", "sofa"),
        ("the living room", "living room"),
        ("sofa", "sofa"),
        ("the sofa and the living room", "living room"),
    ],
)
def test_place_wins_over_its_room_for_any_length_of_names(request_: str, goal: str) -> None:
    home = World((Room("hall"), Room("living room"), Room("sofa", within="living room")), "hall")
    robots = (SimulatedRobot(home, SIMULATION), robot_in(home))
    assert [robot.room_for(request_) for robot in robots] == [goal, goal]
    assert replace(RoomMap.of(home), plain=True).room(request_) == goal


@pytest.mark.parametrize("request_", ["kitchen-hall", "the sink's owner", "hall.2", "hall-"])
def test_part_of_a_compound_word_is_not_a_name(robot: SimulatedRobot, request_: str) -> None:
    assert (robot.room_for(request_) is not None) == (request_ == "hall-")


def test_thing_picked_up_by_a_property_keeps_its_name(robot: SimulatedRobot) -> None:
    robot.perform("go_to", ["kitchen table"])
    robot.perform("pick", ["red fruit"])
    robot.perform("go_to", ["sink"])
    robot.perform("place", ["red fruit"])
    assert robot.perform("is_in_room", ["apple"])


def test_sampled_looks_agree_between_a_place_and_its_room(world: World) -> None:
    looks = set()
    for number in range(20):
        robot = robot_in(world, number)
        robot.perform("go_to", ["kitchen table"])
        found = robot.perform("is_in_room", ["apple"])
        looks.add(found)
        robot.perform("go_to", ["kitchen"])
        if found:
            assert robot.perform("is_in_room", ["apple"])
            assert robot.perform("is_in_room", ["red fruit"])
            robot.perform("pick", ["apple"])
            robot.perform("go_to", ["kitchen table"])
            assert not robot.perform("is_in_room", ["apple"])
    assert looks == {True, False}


def test_moved_person_has_left_the_old_room(world: World) -> None:
    robots = [robot_in(world, number) for number in range(20)]
    found = [robot for robot in robots if robot.perform("is_in_room", ["Angel"])]
    assert found
    for robot in found:
        robot.move_person("Angel", "bathroom")
        assert not robot.perform("is_in_room", ["Angel"])


def test_map_of_a_mission_keeps_the_room_of_each_place(world: World) -> None:
    rooms = map_from(map_data(world)).rooms
    assert {room.name: room.within for room in rooms if room.within} == {
        "kitchen table": "kitchen",
        "sink": "kitchen",
    }


def test_people_of_a_sampled_room_are_at_all_its_places(world: World) -> None:
    answers = set()
    for number in range(20):
        robot = robot_in(world, number)
        robot.perform("go_to", ["kitchen"])
        seen = robot.perform("is_in_room", ["Angel"])
        answers.add(seen)
        robot.perform("go_to", ["sink"])
        assert robot.perform("is_in_room", ["Angel"]) is seen
        assert ("Angel" in robot.people("sink")) is seen
        robot.move_person("Angel", "sink")
        assert robot.perform("is_in_room", ["Angel"])
        robot.perform("go_to", ["kitchen table"])
        assert robot.perform("is_in_room", ["Angel"])
    assert answers == {True, False}


def test_second_unknown_thing_exists_only_with_the_first(world: World) -> None:
    found = [robot_in(world, number).things("kitchen table", "banana") for number in range(40)]
    assert {*map(tuple, found)} == {(), ("banana",), ("banana", "another banana")}


@pytest.mark.parametrize("words", ["things", "objects", "thing", "item", ""])
def test_words_for_things_mean_all_things(robot: SimulatedRobot, words: str) -> None:
    assert robot.things("kitchen table", words) == ["apple", "pear", "mug"]


@pytest.mark.parametrize("words", ["pieces of fruit", "piece of red fruit"])
def test_words_for_pieces_mean_things(robot: SimulatedRobot, words: str) -> None:
    assert "apple" in robot.things("kitchen table", words)


def test_phrases_that_introduce_a_name_mean_that_person(robot: SimulatedRobot) -> None:
    assert robot.people("kitchen", "the person named Angel") == ["Angel"]
    assert robot.people("kitchen", "someone called Bo") == ["Bo"]
