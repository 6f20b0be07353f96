"""Random worlds: their descriptions, the worlds sampled from them, and the requirements of each."""

import ast
import re
from itertools import combinations, product
from pathlib import Path
from random import Random
from types import SimpleNamespace

import pytest

from codebotler.core.errors import UserError
from roboeval.suites.load import load_suite
from roboeval.suites.sampling.expression import ExpressionError, evaluate, iterate_loop, parse_cached
from roboeval.suites.sampling.pairwise import cover_pairs, sample_combinations
from roboeval.suites.schema import MAX_WORLDS
from roboeval.suites.suite import HouseRules, _build_suite

SUITE = "name: mine\nversion: 1\nabout: my tasks\nworlds: 12\nseed: 3\n"
TASK = """\
name: Tea
summary: Tell everybody that tea is ready.
prompts: ["Tell everybody that tea is ready."]
worlds:
  robot: hall
  rooms: [lab, office, hall]
  people:
    kim: {in: [lab, office, nowhere], answers: [["yes", "no"], {option: -1}], after_looks: [0, 2]}
    lou: {name: lou|louise, in: lab, topics: {tea: ["0|none", "2|two"]}, leaves: true}
  things:
    mug: {in: [office, nowhere]}
  may_wait_forever: count(p for p in people if p.room) < 2
  corners:
    - {about: nobody is in, set: {"*.in": nowhere}}
    - {about: lou wants two, set: {lou.topic tea: 2|two, kim.answer 1: "no"}}
let:
  here: '[p for p in people if p.room]'
  cups: 'sum(number(p.topics["tea"]) for p in here if p.name == "lou")'
checks:
  tells(room, who):
    category: SayAtLocation
    rtl: tr.Exists(at("{room}", say("{who}")))
  counts(cups):
    category: SayAtLocation
    rtl: tr.Exists(say(number({cups}, "cup")))
  looks:
    category: CheckEntityAtLocation
    rtl: tr.Exists(check(r"\\b{people}\\b"))
require:
  - tells(p.room, p.name) for p in here if p.room != "hall"
  - counts(cups) if cups
  - not counts(3)
  - looks
"""


def write_suite(folder: Path, task: str = TASK) -> Path:
    (folder / "tasks").mkdir()
    (folder / "suite.yaml").write_text(SUITE)
    (folder / "tasks" / "Tea.yaml").write_text(task)
    return folder


def test_worlds_are_sampled_from_a_description(tmp_path: Path) -> None:
    mine = load_suite(str(write_suite(tmp_path)))
    scenarios = mine.tasks["Tea"].scenarios
    assert (mine.worlds, mine.seed) == (12, 3)
    assert len(scenarios) >= 12
    assert [s.world.about for s in scenarios[:2]] == ["nobody is in", "lou wants two"]
    assert len({s.world for s in scenarios}) == len(scenarios)
    nobody, two = scenarios[:2]
    assert nobody.world.may_wait_forever
    assert not two.world.may_wait_forever
    assert [r.text for r in nobody.require] == ["not counts(3)", "looks"]
    assert [r.text for r in two.require] == [
        'tells("lab", "kim")',
        'tells("lab", "lou")',
        "counts(2)",
        "not counts(3)",
        "looks",
    ]
    (kim, lou) = two.world.rooms[0].people
    assert (kim.name, kim.answers, lou.name, lou.topics) == (
        "kim",
        ("no", -1),
        "lou|louise",
        (("tea", "2|two"),),
    )
    assert lou.leaves
    assert two.world.rooms[1].objects == ("mug",)
    assert "lou|louise" in str(two.require[-1].formula)


def test_the_robot_may_start_in_one_of_several_rooms(tmp_path: Path) -> None:
    task = (
        TASK.replace("robot: hall", "robot: [hall, lab]")
        .replace('{"*.in": nowhere}', '{"*.in": nowhere, robot: lab}')
        .replace('p.room != "hall"', "p.room != start")
        .replace('tr.Exists(check(r"\\b{people}\\b"))', 'tr.Exists(at("{start}", check("tea")))')
    )
    scenarios = load_suite(str(write_suite(tmp_path, task))).tasks["Tea"].scenarios
    starts = [scenario.world.robot for scenario in scenarios]
    assert starts[:2] == ["lab", "hall"]
    assert {*starts[2:]} == {"hall", "lab"}
    for scenario, start in zip(scenarios, starts, strict=True):
        assert f'at("{start}", check("tea"))' in str(scenario.require[-1].formula)
        assert not any(r.text.startswith(f'tells("{start}"') for r in scenario.require)
        assert start == "hall" or f"robot in {start}" in scenario.world.about or scenario is scenarios[0]


def test_a_corner_may_put_a_person_into_any_room(tmp_path: Path) -> None:
    task = TASK.replace('{"*.in": nowhere}', '{"*.in": nowhere, kim.in: hall}')
    scenarios = load_suite(str(write_suite(tmp_path, task))).tasks["Tea"].scenarios
    in_hall = [room.people for each in scenarios for room in each.world.rooms if room.name == "hall"]
    assert [len(people) for people in in_hall] == [1] + [0] * (len(scenarios) - 1)


def test_a_corner_for_all_moves_those_who_may_be_in_the_room(tmp_path: Path) -> None:
    task = TASK.replace('{"*.in": nowhere}', '{"*.in": office}')
    rooms = load_suite(str(write_suite(tmp_path, task))).tasks["Tea"].scenarios[0].world.rooms
    there = {room.name: [*room.objects, *(person.name for person in room.people)] for room in rooms}
    assert there == {"lab": ["lou|louise"], "office": ["mug", "kim"], "hall": []}


def test_a_seed_always_samples_the_same_worlds(tmp_path: Path) -> None:
    mine = load_suite(str(write_suite(tmp_path)))
    again, other, more = mine.with_worlds(12, 3), mine.with_worlds(seed=4), mine.with_worlds(40)
    assert again.digest == mine.digest == mine.with_own_worlds().digest
    assert len({mine.digest, other.digest, more.digest}) == 3
    assert len(more.tasks["Tea"].scenarios) >= 40
    assert more.with_own_worlds().digest == mine.digest
    assert other.tasks["Tea"].scenarios[2:] != mine.tasks["Tea"].scenarios[2:]
    assert other.tasks["Tea"].scenarios[:2] == mine.tasks["Tea"].scenarios[:2]


def test_other_worlds_keep_the_house_rules(tmp_path: Path) -> None:
    ruled = load_suite(write_suite(tmp_path)).with_house_rules(HouseRules("quiet", (), "0"))
    assert ruled.with_worlds(seed=4).house == ruled.house


def test_worlds_of_other_seeds_leave_the_cache(tmp_path: Path) -> None:
    mine = load_suite(write_suite(tmp_path))
    for seed in range(30):
        mine.with_worlds(seed=seed)
    assert 0 < _build_suite.cache_info().currsize < 12


def test_more_worlds_than_the_maximum_are_refused(tmp_path: Path) -> None:
    mine, most = load_suite(write_suite(tmp_path)), MAX_WORLDS
    with pytest.raises(UserError, match=f"{most + 1}.* {most:,}"):
        mine.with_worlds(most + 1)


def test_worlds_written_by_hand_cannot_be_resampled() -> None:
    with pytest.raises(UserError, match="written by hand"):
        load_suite("paper").with_worlds(200)


PHRASES = TASK.replace('say(number({cups}, "cup"))', 'say(words(r"{some}", number({cups}, "cup")))').replace(
    "checks:\n", "phrases:\n  some: [tea, cups? for]\nchecks:\n"
)


def test_checks_can_use_phrases(tmp_path: Path) -> None:
    task = load_suite(str(write_suite(tmp_path, PHRASES))).tasks["Tea"]
    counts = next(r for r in task.scenarios[1].require if r.text == "counts(2)")
    assert "(?:tea|cups? for)" in str(counts.formula)
    assert task.phrases == (("some", ("tea", "cups? for")),)


@pytest.mark.parametrize(
    ("good", "bad", "named"),
    [
        ("some:", "people:", ['"people"', "phrases"]),
        ("some:", "two words:", ['"two words"', "phrases"]),
        ("[tea, cups? for]", "[]", ['"some"', "at least"]),
    ],
)
def test_wrong_phrases_are_refused(tmp_path: Path, good: str, bad: str, named: list[str]) -> None:
    assert good in PHRASES
    with pytest.raises(UserError) as error:
        load_suite(str(write_suite(tmp_path, PHRASES.replace(good, bad))))
    assert all(name in error.value.sentence for name in named), error.value
    assert error.value.line is not None


@pytest.mark.parametrize(
    ("good", "bad", "line", "named"),
    [
        ("in: lab,", "in: attic,", 9, '"attic"'),
        ("rooms: [lab", "rooms: [(a+)+$, lab", 6, "may take too long"),
        ("lou|louise", "(a|aa)+$", 9, "may take too long"),
        ("topics: {tea:", "topics: {(a+)+$:", 9, "may take too long"),
        ("mug: {", "(a+)+$: {", 11, "may take too long"),
        ('"*.in": nowhere', '"kim.in": attic', 14, 'matches "kim.in" can be "attic"'),
        ("counts(cups) if cups", "counts(cup) if cups", 31, '"cup"'),
        ("not counts(3)", "not counts(here)", 32, "argument"),
        ("not counts(3)", "not 3", 32, "not a requirement"),
        ("not counts(3)", "counts(3", 32, "check its syntax"),
        ("not counts(3)", "missing(3)", 32, '"missing"'),
        ('p.topics["tea"]', 'p.topics["milk"]', 18, "cannot be computed"),
        ('p.topics["tea"]', '"x" * 8000000000', 18, "only whole numbers can be multiplied"),
        ("if p.room]'", "if p.age]'", 17, '".age"'),
        ("{option: -1}", "{option: 0}", 8, "no option 0"),
        ("robot: hall", "robot: [hall, attic]", 5, '"attic"'),
        ("- not counts(3)", "- {check: not counts(3) if 1 > 2, prompts: {9: tea}}", 32, "no prompt 9"),
        ("- not counts(3)", "- {check: not counts(3), prompts: {0: hat tea}}", 32, '"hat tea"'),
        ("robot: hall", "robot: [hall, nowhere]", 5, '"nowhere"'),
    ],
)
def test_mistakes_are_refused_with_their_line(
    tmp_path: Path, good: str, bad: str, line: int, named: str
) -> None:
    assert good in TASK
    folder = write_suite(tmp_path, TASK.replace(good, bad))
    with pytest.raises(UserError, match=re.escape(named)) as error:
        load_suite(str(folder))
    assert (error.value.file, error.value.line) == (folder / "tasks" / "Tea.yaml", line)


@pytest.mark.parametrize("sizes", [{"a": 3, "b": 2, "c": 4, "d": 2}, {"a": 2, "b": 2}, {"a": 5}, {}])
def test_every_pair_of_values_occurs(sizes: dict[str, int]) -> None:
    rows = cover_pairs(sizes, Random(1))
    for one, other in combinations(sizes, 2):
        pairs = {(row[one], row[other]) for row in rows}
        assert pairs == set(product(range(sizes[one]), range(sizes[other])))
    assert len(sample_combinations(sizes, 30, Random(1))) >= 30
    assert cover_pairs(sizes, Random(1)) == rows
    if len(sizes) == 1:
        assert {row["a"] for row in rows} == set(range(5))


@pytest.mark.slow
def test_every_task_of_plus_has_30_different_worlds() -> None:
    for task in load_suite("plus").tasks.values():
        assert len(task.scenarios) >= 30, task.name
        assert len({s.world for s in task.scenarios}) == len(task.scenarios), task.name
        assert len({s.world.about for s in task.scenarios}) == len(task.scenarios), task.name


KIM = SimpleNamespace(name="kim", room="lab", answers=("yes", 2), topics={"tea": "3|three"}, after_looks=0)
FACTS = {
    "people": [KIM, SimpleNamespace(name="lou", room="", answers=(), topics={}, after_looks=4)],
    "rooms": ("lab", "hall"),
    "n": 3,
}


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("count(p for p in people if p.room)", 1),
        ("[p.name for p in people if p.room in rooms or p.after_looks > 2]", ["kim", "lou"]),
        ('number(people[0].topics["tea"]) + 2 * n - 1', 8),
        ('any("yes" in p.answers for p in people) and not all(p.room for p in people)', True),
        ('f"{people[0].name} is in" if n == 3 else "no"', "kim is in"),
        ("max([1, n, 2]) // 2", 1),
        ("1 < n <= 3 != 4", True),
    ],
)
def test_expressions_are_evaluated(text: str, wanted: object) -> None:
    assert evaluate(parse_cached(text), FACTS) == wanted


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "people.__class__",
        "(lambda: 1)()",
        "[x for x in rooms for y in rooms]",
        "n ** n",
        "open",
        "1 // 0",
        "number('x')",
        "[a for a, b in people]",
        "[a for a in 'text']",
        "rooms[9]",
        "x := 3",
        "'x' * 8_000_000_000",
        "2 * rooms",
        "[n] * 2",
        f"'{'x' * 6_000}' + '{'x' * 6_000}'",
        " * ".join(["9" * 4_000] * 4),
        "[" * 14 + "1" + " for r in rooms]" * 14,
        "+".join(["1"] * 2_000),
    ],
)
def test_other_expressions_are_refused(text: str) -> None:
    with pytest.raises(ExpressionError):
        evaluate(parse_cached(text), FACTS)


def test_an_unknown_function_is_refused_with_a_list_of_functions() -> None:
    with pytest.raises(ExpressionError, match=r"the only functions are count, number, sum"):
        evaluate(parse_cached("len(people)"), FACTS)


def test_a_loop_binds_one_name() -> None:
    node = parse_cached("[p for p in people if p.room]")
    assert isinstance(node, ast.ListComp)
    assert [each["p"].name for each in iterate_loop(node.generators[0], FACTS)] == ["kim"]
