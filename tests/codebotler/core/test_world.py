import time
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.errors import UserError
from codebotler.core.text.labels import check_label
from codebotler.core.world import HALLWAY, Person, Room, World, laid_out
from codebotler.core.world_file import WorldFile, read_world
from codebotler.core.yaml_files import YamlFile

GOOD = "robot: hall\nrooms:\n  - hall\n  - lab\n"
FULL = """\
about: second floor, after lunch
robot: start_loc
rooms:
  - start_loc
  - alice's office
  - {name: kitchen, footprint: [[6, 0], [9, 0], [9, 4], [6, 4]], stand_at: [7.5, 1]}
objects: {kitchen: [mug, bottle of water]}
people: {alice's office: [{name: alice, answers: ["yes", tea]}, {name: .*}]}
may_wait_forever: true
"""


def read(text: str) -> World:
    file = YamlFile(text, "w.yaml")
    return file.validate(WorldFile).world(file)


def test_world_file_sets_every_field(tmp_path: Path) -> None:
    path = tmp_path / "w.yaml"
    path.write_text(FULL, encoding="utf-8")
    assert read_world(path) == World(
        about="second floor, after lunch",
        robot="start_loc",
        rooms=(
            Room("start_loc"),
            Room("alice's office", people=(Person("alice", ("yes", "tea")), Person(".*"))),
            Room(
                "kitchen",
                objects=("mug", "bottle of water"),
                footprint=((6, 0), (9, 0), (9, 4), (6, 4)),
                stand_at=(7.5, 1),
            ),
        ),
        may_wait_forever=True,
    )


def test_only_the_rooms_and_the_start_are_needed() -> None:
    assert read("robot: a\nrooms: [a]\n") == World((Room("a"),), "a", about="", may_wait_forever=False)


def quoting_hint(name: str, value: str) -> list[str]:
    return [name, f"is {value}", "a string in quotes"]


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        (GOOD + "robots: 3\n", 5, ['"robots"']),
        ("rooms: [hall]\n", 1, ['"robot"', "missing"]),
        ("about: x\nrobot: hall\n", 1, ['"rooms"', "missing"]),
        ("robot: 3\nrooms: [hall]\n", 1, ['"robot"', "is 3", "a string in quotes"]),
        ("robot:\nrooms: [hall]\n", 1, ['"robot"', "empty"]),
        ("rooms: [hall]\nrobot: [hall]\n", 2, ['"robot"', "is [", "a string"]),
        ("robot: ''\nrooms: [hall]\n", 1, ['"robot"', "at least 1 character"]),
        (GOOD + "about: no\n", 5, quoting_hint('"about"', "False")),
        ("robot: yes\nrooms: [hall]\n", 1, quoting_hint('"robot"', "True")),
        ("robot: hall\nrooms: hall\n", 2, ['"rooms"', 'is "', "a list"]),
        ("robot: hall\nrooms: {hall: 1}\n", 2, ['"rooms"', "is {", "a list"]),
        ("robot: hall\nrooms: []\n", 2, ['"rooms"', "at least 1"]),
        (GOOD + "  - on\n", 5, quoting_hint("this entry", "True")),
        (GOOD + "  - 12\n", 5, ["this entry", "is 12", "a string in quotes"]),
        (GOOD + "  -\n", 5, ["this entry", "empty"]),
        (GOOD + "  - ''\n", 5, ["this entry", "at least 1 character"]),
        (GOOD + "  - [a, b]\n", 5, ["this entry", "is [", "a string"]),
        (GOOD + "  - {name: a, colour: red}\n", 5, ['"colour"']),
        (GOOD + "  - {stand_at: [1, 2]}\n", 5, ['"name"', "missing"]),
        (GOOD + "  - {name: no}\n", 5, quoting_hint('"name"', "False")),
        (
            GOOD + "  - name: a\n    footprint: [[0, 0], [1, 0]]\n",
            6,
            ['"footprint"', "at least 3"],
        ),
        (
            GOOD + "  - name: a\n    footprint:\n      - [0, 0]\n      - [1, 0, 2]\n      - [1, 1]\n",
            8,
            ["this entry", "at most 2"],
        ),
        (
            GOOD + "  - name: a\n    footprint:\n      - [0, 0]\n      - [1, 0]\n      - [1]\n",
            9,
            ["this entry", "too few", "2"],
        ),
        (
            GOOD + "  - name: a\n    footprint:\n      - [0, 0]\n      - [1, b]\n      - [1, 1]\n",
            8,
            ["this entry", 'is "', "a number"],
        ),
        (GOOD + "  - name: a\n    footprint: big\n", 6, ['"footprint"', 'is "', "a list"]),
        (GOOD + "  - {name: a, stand_at: [1, .nan]}\n", 5, ["this entry", "finite"]),
        (GOOD + "  - {name: a, stand_at: [-.inf, 1]}\n", 5, ["this entry", "finite"]),
        (GOOD + "  - {name: a, stand_at: [1.0e+300, 1]}\n", 5, ["this entry", "1e+300", "1000000"]),
        (
            GOOD + "  - name: a\n    footprint: [[0, 0], [4, 0], [4, 3], [0, 3]]\n    stand_at: [4.5, 1]\n",
            7,
            ["(4.5, 1)", '"a"'],
        ),
        (GOOD + "  - {name: a, stand_at: ['1', 1]}\n", 5, ["this entry", 'is "', "a number"]),
        (GOOD + "  - hall\n", 5, ['"hall" is already listed']),
        (GOOD + "  - {name: lab}\n", 5, ['"lab" is already listed']),
        (GOOD + "  - Lab\n", 5, ['"Lab" is already listed as "lab"', "rename"]),
        ("rooms: [hall, lab]\nrobot: attic\n", 2, ["robot", '"attic"', "hall, lab"]),
        (f"robot: hall\nrooms: [{'hall, ' * 5_001}]\n", 2, ['"rooms"', "at most 5000"]),
        (GOOD + "objects: [mug]\n", 5, ['"objects"', "is [", "a mapping"]),
        (GOOD + "objects:\n", 5, ['"objects"', "empty"]),
        (GOOD + "objects:\n  lab: mug\n", 6, ['"lab"', 'is "', "a list"]),
        (GOOD + "objects:\n  lab:\n    - mug\n    - no\n", 8, quoting_hint("this entry", "False")),
        (GOOD + "objects:\n  lab:\n    - mug\n    - ''\n", 8, ["this entry", "at least 1 character"]),
        (GOOD + "objects:\n  lab: [mug]\n  attic: [mug]\n", 7, ['"attic"', "hall, lab"]),
        (
            GOOD + "people:\n  lab: [{name: a}]\n  attic: [{name: b}]\n",
            7,
            ['"attic"', "hall, lab"],
        ),
        (GOOD + "people:\n  lab:\n    - alice\n", 7, ["this entry", 'is "', "a mapping"]),
        (GOOD + "people:\n  lab: {name: a}\n", 6, ['"lab"', "is {", "a list"]),
        (GOOD + "people:\n  lab:\n    - answers: [tea]\n", 7, ['"name"', "missing"]),
        (GOOD + "people:\n  lab:\n    - name: a\n      answer: b\n", 8, ['"answer"']),
        (
            GOOD + "people:\n  lab:\n    - name: a\n      answers:\n        - tea\n        - yes\n",
            10,
            quoting_hint("this entry", "True"),
        ),
        (
            GOOD + "people:\n  lab:\n    - name: a\n      answers: tea\n",
            8,
            ['"answers"', 'is "', "a list"],
        ),
        (GOOD + "may_wait_forever: 'yes'\n", 5, ['"may_wait_forever"', 'is "yes"', "true or false"]),
        (GOOD + "may_wait_forever: 1\n", 5, ['"may_wait_forever"', "is 1", "true or false"]),
        (GOOD + "  - lab (3\n", 5, ['"lab (3"', "missing ), unterminated subpattern at position 4"]),
        (GOOD + "objects:\n  lab:\n    - mug\n    - '*'\n", 8, ['"*"', "nothing to repeat"]),
        (GOOD + "people:\n  lab:\n    - name: '*'\n", 7, ['"*"', "nothing to repeat"]),
        (
            GOOD + "people:\n  lab:\n    - name: a\n      answers:\n        - tea\n        - '[a'\n",
            10,
            ['"[a"', "unterminated character set"],
        ),
        (GOOD + "objects:\n  lab: ['a{9999999999999}']\n", 6, ['"a{9999999999999}"', "too large"]),
        ("", None, ["the file", "empty"]),
        ("- hall\n", 1, ["the file", "is [", "a mapping"]),
        (GOOD + "objects:\n  lab: [a]\n  lab: [b]\n", 7, ['"lab"', "repeated"]),
    ],
)
def test_fault_in_a_world_file_is_an_error_with_its_line(
    text: str, line: int | None, named: list[str]
) -> None:
    with pytest.raises(UserError) as caught:
        read(text)
    assert (caught.value.file, caught.value.line) == ("w.yaml", line)
    assert all(name in caught.value.sentence for name in named), caught.value


@pytest.mark.slow
def test_many_rooms_are_not_compared_with_each_other() -> None:
    rooms = "".join(f"  - room {number}\n" for number in range(5_000))
    start = time.process_time()
    assert len(read(f"robot: room 7\nrooms:\n{rooms}").rooms) == 5_000
    assert time.process_time() - start < 1.5  # comparing them takes more than two seconds


def test_error_names_the_path_of_the_world_file(tmp_path: Path) -> None:
    path = tmp_path / "w.yaml"
    path.write_text("robot: attic\nrooms: [hall]\n", encoding="utf-8")
    with pytest.raises(UserError, match='"attic"') as error:
        read_world(path)
    assert (error.value.file, error.value.line) == (path, 1)


def is_label(text: str) -> bool:
    try:
        check_label(text)
    except ValueError:
        return False
    return True


TEXTS = st.text(
    st.characters(codec="utf-8", exclude_characters="\x85\u2028\u2029"), max_size=12
) | st.sampled_from(
    ["no", "yes", "3", "null", "~", "=", "<<", "a: b", "# a", "2001-01-01", "\ta\n b ", "1e3"]
)
REGEXES = TEXTS.filter(is_label)
NAMES = REGEXES.filter(bool)
METRES = st.floats(-1e6, 1e6)
POINTS = st.tuples(METRES, METRES)
ROOMS = st.builds(
    Room,
    name=NAMES,
    objects=st.lists(NAMES, max_size=3).map(tuple),
    people=st.lists(st.builds(Person, NAMES, st.lists(REGEXES, max_size=3).map(tuple)), max_size=2).map(
        tuple
    ),
    stand_at=st.none() | POINTS,
)
MEASURED = st.builds(
    lambda room, corners, stands: replace(
        room, footprint=tuple(corners), stand_at=corners[0] if stands else None
    ),
    ROOMS,
    st.lists(POINTS, min_size=3, max_size=5),
    st.booleans(),
)


@st.composite
def worlds(draw: st.DrawFn) -> World:
    rooms = draw(st.lists(ROOMS | MEASURED, min_size=1, max_size=4, unique_by=lambda room: room.name.lower()))
    start = draw(st.sampled_from(rooms)).name
    return World(tuple(rooms), start, draw(TEXTS), may_wait_forever=draw(st.booleans()))


@given(worlds())
def test_world_written_as_a_file_reads_back_as_itself(world: World) -> None:
    assert read(world.to_yaml()) == world


def extent(room: Room) -> tuple[float, float, float, float]:
    assert room.footprint is not None
    xs, ys = zip(*room.footprint, strict=True)
    return min(xs), max(xs), min(ys), max(ys)


def is_overlapping(one: Room, other: Room) -> bool:
    (a, b, c, d), (e, f, g, h) = extent(one), extent(other)
    return a < f and e < b and c < h and g < d


CORNERS = st.integers(-50, 50).map(float)
RECTANGLES = st.tuples(CORNERS, CORNERS).map(
    lambda low: (low, (low[0] + 3, low[1]), (low[0] + 3, low[1] + 2), (low[0], low[1] + 2))
)


@given(st.lists(st.none() | RECTANGLES, min_size=1, max_size=9))
def test_layout_places_rooms_apart_and_keeps_given_footprints(
    footprints: list[tuple[tuple[float, float], ...] | None],
) -> None:
    world = World(tuple(Room(f"room {i}", footprint=given) for i, given in enumerate(footprints)), "room 0")
    rooms = laid_out(world).rooms
    new = [room for room, given in zip(rooms, footprints, strict=True) if given is None]
    old = [room for room, given in zip(rooms, footprints, strict=True) if given is not None]
    assert [room.footprint for room in old] == [given for given in footprints if given is not None]
    assert not any(is_overlapping(one, other) for one, other in combinations(new, 2))
    assert not any(is_overlapping(one, other) for one in new for other in old)
    for room in rooms:
        left, right, low, high = extent(room)
        assert room.stand_at is not None
        assert left < room.stand_at[0] < right
        assert low < room.stand_at[1] < high


def test_layout_is_a_hallway_with_rooms_on_both_sides() -> None:
    world = World((Room("a"), Room("b"), Room("c")), "a", may_wait_forever=True)
    a, b, c = laid_out(world).rooms
    assert (extent(a)[:2], extent(c)[0]) == (extent(b)[:2], extent(a)[1])
    assert extent(b)[2] - extent(a)[3] == HALLWAY
    assert laid_out(world).may_wait_forever
    assert laid_out(laid_out(world)) == laid_out(world)


def test_unplaced_rooms_lie_a_hallway_to_the_right_of_placed_ones() -> None:
    given = ((-1.0, 0.0), (7.0, 0.0), (7.0, 5.0))
    world = World((Room("new"), Room("given", footprint=given)), "new")
    assert extent(laid_out(world).rooms[0])[0] == 7 + HALLWAY


def test_room_with_only_a_standing_point_is_a_square_metre_around_it() -> None:
    world = laid_out(World((Room("new"), Room("b", stand_at=(9.0, 4.0))), "new"))
    assert extent(world.rooms[1]) == (8.5, 9.5, 3.5, 4.5)
    assert world.rooms[1].stand_at == (9.0, 4.0)
    assert extent(world.rooms[0])[0] == 9.5 + HALLWAY


def test_world_file_is_written_in_readable_yaml() -> None:
    world = World((Room("café", ("Ölkanne",), (Person("Łucja", ("tak",)),)), Room("hall")), "café", "früh")
    assert world.to_yaml() == (
        "about: früh\nrobot: café\nrooms:\n- café\n- hall\nobjects:\n  café:\n  - Ölkanne\n"
        "people:\n  café:\n  - name: Łucja\n    answers:\n    - tak\n"
    )


@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_a_point_on_a_slanted_edge_is_within(shift: float) -> None:
    room = "{{name: a, footprint: [[{0}, 0], [{1}, 0.3], [{0}, 3]], stand_at: [{2}, {3}]}}"
    room = f"robot: a\nrooms: [{room}]\n"
    ends = shift, shift + 0.7
    assert read(room.format(*ends, shift + 0.7 / 3, 0.1)).rooms[0].stand_at
    assert read(room.format(*ends, shift + 0.7, 0.3)).rooms[0].stand_at
    with pytest.raises(UserError, match="outside"):
        read(room.format(*ends, shift + 0.7 / 3 + 0.001, 0.1))


@pytest.mark.parametrize(
    ("point", "is_within"),
    [
        ((1, 1), True),
        ((5, 1), True),
        ((1, 5), True),
        ((5, 5), False),
        ((2, 4), True),
        ((0, 3), True),
        ((6, 2), True),
        ((6, 6), False),
        ((-1, 2), False),
        ((7, 0), False),
        ((2, 6.1), False),
    ],
)
def test_standing_point_must_lie_within_the_footprint(point: tuple[float, float], *, is_within: bool) -> None:
    corner = "[[0, 0], [6, 0], [6, 2], [2, 2], [2, 6], [0, 6]]"  # 2 m wide, around a corner
    text = f"robot: a\nrooms: [{{name: a, footprint: {corner}, stand_at: [{point[0]}, {point[1]}]}}]\n"
    if is_within:
        assert read(text).rooms[0].stand_at == point
    else:
        with pytest.raises(UserError, match="outside"):
            read(text)
