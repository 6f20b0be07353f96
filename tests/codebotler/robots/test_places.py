"""Places are read from a plain file or, by a few lines of YAML, from files of other tools."""

import math
import re
from pathlib import Path
from textwrap import dedent

import pytest

from codebotler.core.errors import UserError
from codebotler.core.yaml_files import YamlFile
from codebotler.missions.storage.map_event import map_data
from codebotler.robots.places import Places, read_places

PLAIN = """\
frame: odom
places:
  kitchen: {x: 2, y: 1, yaw: 1.5, polygon: [[0, 0], [4, 0], [4, 4], [0, 4]]}
  pantry: {polygon: [[0, 0], [1, 0], [1, 1], [0, 1]]}
  dock: {x: 9, y: 9}
"""


def read(folder: Path, mapping: str, content: str = PLAIN, name: str = "places.yaml") -> Places:
    (folder / name).write_text(content)
    robot = YamlFile(f"robot: ros2\nplaces: {mapping}\n", folder / "robot.yaml")
    assert isinstance(robot.data, dict)
    return read_places(robot.data["places"], robot)


def points(places: Places) -> dict[str, tuple[float, float, float]]:
    return {one.name: (one.x, one.y, one.yaw) for one in places.places}


@pytest.fixture
def plain(tmp_path: Path) -> Places:
    return read(tmp_path, "places.yaml")


def test_plain_file_needs_no_mapping(plain: Places) -> None:
    assert plain.frame == "odom"
    assert points(plain) == {"kitchen": (2, 1, 1.5), "pantry": (0.5, 0.5, 0), "dock": (9, 9, 0)}
    assert [one.polygon and len(one.polygon) for one in plain.places] == [4, 4, None]


def test_place_is_found_by_name_polygon_or_distance(plain: Places) -> None:
    kitchen, pantry, dock = plain.places
    assert (plain.named(" Kitchen "), plain.named("kitch")) == (kitchen, None)
    assert (plain.room_at(3, 3), plain.room_at(0.5, 0.9), plain.room_at(9, 9)) == (kitchen, pantry, None)
    assert (plain.nearest(6, 6), plain.nearest(0, 0)) == (dock, pantry)


def test_map_draws_a_point_as_a_square_around_it(plain: Places) -> None:
    kitchen, _, dock = map_data(plain.world("dock"))["rooms"]
    assert (kitchen["footprint"], kitchen["stand_at"]) == (((0, 0), (4, 0), (4, 4), (0, 4)), (2, 1))
    assert dock["footprint"] == ((8.5, 8.5), (9.5, 8.5), (9.5, 9.5), (8.5, 9.5))
    assert plain.world("dock").robot == "dock"


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("[1, 2]", (1, 2, 0)),
        ("[1, 2, 90]", (1, 2, math.pi / 2)),
        ("[1, 2, 5, 0, 0, 1, 1]", (1, 2, math.pi / 2)),
        ("{x: 1, y: 2, yaw: 90, z: 7}", (1, 2, math.pi / 2)),
        ("{x: 1e-05, y: '2'}", (1e-05, 2, 0)),
        (
            "{position: {x: 1, y: 2, z: 0}, orientation: {x: 0, y: 0, z: -2, w: 2}}",
            (1, 2, -math.pi / 2),
        ),
        ("{position: [1, 2, 0], orientation: {x: 0, y: 0, z: 1, w: 0}}", (1, 2, math.pi)),
    ],
)
def test_poses_of_usual_shapes_are_read(
    tmp_path: Path, entry: str, expected: tuple[float, float, float]
) -> None:
    places = read(tmp_path, '{file: places.yaml, each: "*", yaw: degrees}', f"hall: {entry}\n")
    assert points(places)["hall"] == pytest.approx(expected)


def test_parts_of_a_pose_may_lie_apart(tmp_path: Path) -> None:
    mapping = '{file: places.yaml, each: "*", pose: [at.1, at.0, heading]}'
    places = read(tmp_path, mapping, "hall: {at: [2, 1], heading: 0.5}\n")
    assert points(places) == {"hall": (1, 2, 0.5)}


def test_stars_in_a_path_make_the_name(tmp_path: Path) -> None:
    content = "floors: {ground: {rooms: {hall: [0, 0]}}, first: {rooms: {hall: [1, 1]}}}\n"
    each = "each: floors.*.rooms.*"
    assert [*points(read(tmp_path, f"{{file: places.yaml, {each}}}", content))] == [
        "ground hall",
        "first hall",
    ]
    mapping = f'{{file: places.yaml, {each}, name: "hall on the * floor"}}'
    assert "hall on the first floor" in points(read(tmp_path, mapping, content))


def test_entries_without_a_name_or_of_another_kind_are_left_out(tmp_path: Path) -> None:
    content = """{"a": [{"id": 0, "at": [1, 2], "kind": "node"}, {"at": [3, 4], "kind": "node"},
    {"id": "", "at": [5, 6], "kind": "node"}, {"id": 7, "at": [[1, 2], [3, 4]], "kind": "edge"}]}"""
    mapping = "{file: g.json, each: a.*, name: id, pose: at, where: {kind: node}}"
    assert points(read(tmp_path, mapping, content, "g.json")) == {"0": (1, 2, 0)}


def test_pixels_become_metres_also_in_polygons(tmp_path: Path) -> None:
    content = "hall: {x: 10, y: 20, polygon: [[0, 0], [40, 0], [40, 40]]}\n"
    image = "resolution: 0.05, origin: [-4, 2], height: 100"
    (hall,) = read(tmp_path, f'{{file: places.yaml, each: "*", {image}}}', content).places
    assert (hall.x, hall.y) == pytest.approx((-3.5, 6))
    assert hall.polygon is not None
    assert hall.polygon[0] == pytest.approx((-4, 7))
    assert hall.polygon[2] == pytest.approx((-2, 5))
    places = read(tmp_path, '{file: places.yaml, each: "*", resolution: 0.05}', "hall: [10, 20]\n")
    assert points(places)["hall"] == pytest.approx((0.5, -1, 0))  # In RMF, y points down.


def test_places_come_from_several_files(tmp_path: Path) -> None:
    (tmp_path / "more.yaml").write_text("lab: [1, 1]\n")
    content = "places: {hall: {x: 0, y: 0}}\n"
    assert [*points(read(tmp_path, '[places.yaml, {file: more.yaml, each: "*"}]', content))] == [
        "hall",
        "lab",
    ]
    with pytest.raises(UserError, match=r'line 2: .*"odom".*"map"'):
        read(tmp_path, '[places.yaml, {file: more.yaml, each: "*", frame: odom}]', content)


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        ("places:\n  a: {x: .nan, y: 1}\n", 2, ['"a"', "nan"]),
        ("places:\n  a: {x: 1, y: 1, yaw: .inf}\n", 2, ['"a"', "inf"]),
        ("places:\n  a: {x: 1}\n", 2, ['"a"']),
        ("places:\n  a: {}\n", 2, ['"a"']),
        ("places:\n  a: {x: 1, y: 1}\n  A: {x: 2, y: 1}\n", 3, ['"A"', '"a"', "case", "skip: [A]"]),
        ("places:\n  a: {x: 1, y: 1, yw: 2}\n", 2, ["yw"]),
        ("places:\n  a: {x: 1, y: 1, polygon: [[0, 0], [1, 1]]}\n", 2, ['"a"', "three"]),
        ("places:\n  a: {x: 1, y: 1, polygon: 7}\n", 2, ['"a"', "three"]),
        ("places:\n  a: {x: 1, y: 1, polygon: [[0, 0], [1, 1], [2, z]]}\n", 2, ['"a"', "'z'"]),
        ("places:\n  a: {polygon: [[0, 0], [9, 0], [9, 9], [8, 9], [8, 1], [0, 1]]}\n", 2, ['"a"', "middle"]),
        (f"places:\n  a: {{x: 1, y: 1{'0' * 400}}}\n", 2, ['"a"']),
        ("places: {}\n", 2, ["robot.yaml", "places.*"]),
        ("rooms: {}\n", 1, ["places"]),
    ],
)
def test_errors_name_the_place_and_its_line(
    tmp_path: Path, content: str, line: int, words: list[str]
) -> None:
    with pytest.raises(UserError) as caught:
        read(tmp_path, "places.yaml", content)
    assert caught.value.line == line
    assert [word for word in words if word not in str(caught.value)] == []


@pytest.mark.parametrize(
    "mapping", ["", "[]", "7", "{file: places.yaml, yaw: deg}", "{file: places.yaml, eech: a}", "none.yaml"]
)
def test_faulty_mappings_are_refused(tmp_path: Path, mapping: str) -> None:
    with pytest.raises(UserError):
        read(tmp_path, mapping)


# --- files of other tools

MAPPINGS = {
    "arena.yaml": """
  - {file: FILE, each: arena.rooms.*, pose: pose, polygon: room_polygon}
  - {file: FILE, each: arena.rooms.*.beacons.*, pose: near_pose}
""",
    "areas.json": """
  - {file: FILE, each: "*", pose: safe_place, skip: [bedroom]}
  - {file: FILE, each: "*.desk", name: "* desk"}
  - {file: FILE, each: "*.door", name: "* door"}
""",
    "graph.geojson": """
  file: FILE
  each: features.*
  name: properties.metadata.label
  pose: geometry.coordinates
""",
    "waypoints.yaml": "{file: FILE, each: waypoints.*, name: name, yaw: degrees, skip: [reception]}",
    "building.yaml": """
  file: FILE
  each: vertices.*
  name: 3
  pose: [0, 1]
  resolution: 0.05
  origin: [-4.0, -3.5]
  height: 420
""",
}
EXPECTED: dict[str, dict[str, tuple[float, float, float]]] = {
    "arena.yaml": {
        "kitchen": (2.9, 4.6, math.pi / 2),
        "living room": (6, 3.1, 0),
        "hallway": (2, 1.9, 0.785413),
        "kitchen sink": (4.4, 7.1, 0),
        "kitchen dishwasher": (1.6, 7.2, math.pi),
    },
    "areas.json": {
        "office": (-3.6, 3.4, -0.416795),
        "entrance": (-0.5, 1.6, 0),
        "storage": (3.25, 3, 0),
        "office desk": (-1.8, 3.2, 0.161582),
        "entrance door": (-0.1, 1, math.pi),
    },
    "graph.geojson": {"dock": (0, 0, 0), "packing station": (2.5, 6, 0), "shelf 12": (7, 6, 0)},
    "waypoints.yaml": {
        "Reception": (1.25, -0.4, math.pi / 2),
        "lab 1": (6.8, 2.2, math.pi),
        "lab 2": (6.9, 7.3, math.pi),
    },
    "building.yaml": {
        "lobby": (2, 13.1, 0),
        "meeting room a": (11.525, 12.99, 0),
        "mail room": (1.92, 2.605, 0),
    },
}


def read_case(corpus: Path, name: str, mapping: str) -> Places:
    path = corpus / "cases" / "places" / name
    robot = YamlFile(f"places: {mapping.replace('FILE', str(path))}", Path("robot.yaml"))
    assert isinstance(robot.data, dict)
    return read_places(robot.data["places"], robot)


@pytest.mark.parametrize("name", MAPPINGS)
def test_files_of_other_tools_are_read_by_short_mappings(corpus: Path, name: str) -> None:
    places = points(read_case(corpus, name, MAPPINGS[name]))
    assert [*places] == [*EXPECTED[name]]
    for one, pose in EXPECTED[name].items():
        assert places[one] == pytest.approx(pose, abs=1e-4)


@pytest.mark.parametrize(("name", "left_out"), [("areas.json", "bedroom"), ("waypoints.yaml", "reception")])
def test_ambiguous_place_is_refused_unless_it_is_skipped(corpus: Path, name: str, left_out: str) -> None:
    with pytest.raises(UserError, match=rf"{name}, line \d+: .*skip: \[{left_out}\]"):
        read_case(corpus, name, MAPPINGS[name].replace(f", skip: [{left_out}]", ""))


RMF = """\
coordinate_system: reference_image
levels:
  L1:
    vertices:
      - [100, 50, 0, ""]
      - [200, 300, 0, pantry, {is_holding_point: [4, true]}]
"""
NAV2 = """\
{"type": "FeatureCollection", "features": [
  {"type": "Feature", "properties": {"id": 4, "metadata": {"name": "dock"}},
   "geometry": {"type": "Point", "coordinates": [1.5, 2]}},
  {"type": "Feature", "properties": {"id": 9, "metadata": {"name": "lane"}, "startid": 4, "endid": 5},
   "geometry": {"type": "LineString", "coordinates": [[1.5, 2], [7, 2]]}}]}
"""
GRAPH = "levels: {L1: {lanes: [], vertices: [[1, 2, {name: ''}], [3, -4, {name: lounge}]]}}\n"
GUIDE = Path(__file__).parents[3] / "docs" / "nav2.md"


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("office.building.yaml", RMF, {"pantry": (1.74, -2.61, 0)}),
        ("0.yaml", GRAPH, {"lounge": (3, -4, 0)}),
        ("graph.geojson", NAV2, {"dock": (1.5, 2, 0)}),
    ],
)
def test_mappings_in_the_guide_read_their_files(
    tmp_path: Path, name: str, content: str, expected: dict[str, tuple[float, float, float]]
) -> None:
    section = GUIDE.read_text().partition("\n## Places\n")[2]
    (block,) = (one for one in re.findall(r"```yaml\n(.*?)```", section, re.DOTALL) if name in one)
    (tmp_path / "nav_graphs").mkdir()
    (tmp_path / ("nav_graphs" if name == "0.yaml" else "") / name).write_text(content)
    robot = YamlFile(dedent(block), tmp_path / "robot.yaml")
    assert isinstance(robot.data, dict)
    places = points(read_places(robot.data["places"], robot))
    assert [*places] == [*expected]
    assert all(places[one] == pytest.approx(pose) for one, pose in expected.items())
