"""A request means the equal name, or else the name whose whole words it holds in the longest run."""

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.world import Person, Room, World
from codebotler.robots.simulated import SIMULATION
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.matching import meant_by
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot

ROOMS = ("kitchen", "kitchen table", "shelf", "bookshelf", "lab 1", "lab 10", "alice's office")


@pytest.mark.parametrize(
    ("request_", "rooms"),
    [
        ("kitchen table", ["kitchen table"]),
        ("the Kitchen  Table, please", ["kitchen table"]),
        ("kitchen", ["kitchen"]),
        ("the kitchens", ["kitchen"]),
        ("bookshelf", ["bookshelf"]),
        ("lab 10", ["lab 10"]),
        ("lab 101", []),
        ("lab", []),
        ("", []),
        ("Alice's office", ["alice's office"]),
        ("the shelf in the kitchen", ["kitchen", "shelf"]),
        ("the shelf at the kitchen table", ["kitchen table"]),
    ],
)
def test_request_means_the_longest_run_of_whole_words(request_: str, rooms: list[str]) -> None:
    assert meant_by(request_, ROOMS) == rooms
    assert meant_by(request_, ROOMS, plain=True) == rooms


def test_labels_of_worlds_are_regexes_and_names_of_robots_are_not() -> None:
    assert meant_by("the copy room", ["printer room|copy room", "hall"]) == ["printer room|copy room"]
    assert meant_by("Lab (2F)", ["hall", "Lab (2F)"]) == ["Lab (2F)"]
    assert meant_by("to Lab (2F) now", ["hall", "Lab (2F)"], plain=True) == ["Lab (2F)"]
    assert meant_by("labs", ["lab."], plain=True) == []


WORLD = World(
    (
        Room("hall"),
        *map(Room, ROOMS[:2]),
        Room("shelf", ("pan", "pancake", "mug", "mug"), (Person("jane", ("yes",)), Person("pat", ("no",)))),
        Room("bookshelf"),
    ),
    "hall",
)


def robots() -> list[SimulatedRobot]:
    room_map = RoomMap.of(WORLD)
    return [SimulatedRobot(WORLD, SIMULATION), SampledRobot(room_map, FactSampler())]


@pytest.mark.parametrize("robot", robots())
def test_robots_drive_to_the_room_that_the_request_means(robot: SimulatedRobot) -> None:
    for request, room in (
        ("kitchen table", "kitchen table"),
        ("bookshelf", "bookshelf"),
        ("the kitchen", "kitchen"),
        ("SHELF", "shelf"),
    ):
        robot.perform("go_to", [request])
        assert robot.room == room
    with pytest.raises(RobotError, match='"kitchen" or "shelf"') as raised:
        robot.perform("go_to", ["shelf of the kitchen"])
    assert raised.value.kind == "GoToInvalidLocation"
    assert robot.room == "shelf"


def robot_at_the_shelf() -> SimulatedRobot:
    robot = SimulatedRobot(WORLD, SIMULATION)
    robot.perform("go_to", ["shelf"])
    return robot


@pytest.mark.parametrize(
    ("request_", "is_there"),
    [
        ("pancake", True),
        ("the pan", True),
        ("pancakes", True),
        ("panda", False),
        ("somebody", True),
        ("any people", True),
        ("Jane", True),
        ("jane or pat", True),
        ("janet", False),
        ("waving person", False),
        ("person in a red coat", False),
    ],
)
def test_look_finds_things_and_people_by_whole_words(request_: str, is_there: bool) -> None:  # noqa: FBT001 - a case
    assert robot_at_the_shelf().perform("is_in_room", [request_]) is is_there


def test_things_are_picked_up_by_the_longest_name() -> None:
    robot = robot_at_the_shelf()
    robot.perform("pick", ["pancake"])
    assert robot.taken is not None
    assert robot.taken.label == "pancake"
    robot.perform("place", ["pancake"])
    with pytest.raises(RobotError, match="could mean"):
        robot.perform("pick", ["pan or mug"])
    robot.perform("pick", ["mug"])  # the two mugs are equal, so the request is not ambiguous


def test_sampled_robot_distinguishes_things_by_whole_words() -> None:
    for sample in range(20):
        robot = SampledRobot(RoomMap(("hall",), "hall"), FactSampler(sample=sample))
        robot.perform("is_in_room", ["pan"])
        robot.perform("is_in_room", ["pancake"])
        if robot.trace[0].found != robot.trace[1].found:
            break
    else:
        pytest.fail("a pan and a pancake are always found together")


def test_phrase_about_people_finds_nobody_in_an_empty_room() -> None:
    robots = [SampledRobot(RoomMap(("hall",), "hall"), FactSampler(sample=sample)) for sample in range(20)]
    alone = [robot for robot in robots if not robot.perform("is_in_room", ["person"])]
    assert {robot.perform("is_in_room", ["waving person"]) for robot in alone} == {False}
