"""An accented letter is the same as one character (NFC) and as two (NFD), from every source."""

from pathlib import Path
from unicodedata import normalize

import pytest

from codebotler.checking.check import check
from codebotler.checking.house_rules.file import read_rules
from codebotler.core.program import parse_leniently
from codebotler.core.world import Person, Room, World
from codebotler.core.world_file import read_world
from codebotler.prompts import prompt_for
from codebotler.robots.open import open_robot
from codebotler.rtl import holds, parse
from codebotler.simulator import run

pytestmark = pytest.mark.shared_engine

NFC, NFD = "caf\u00e9", "cafe\u0301"
FORMS = ["NFC", "NFD"]
PROGRAM = """def task_program():
    go_to("café")
    if "café" in get_all_rooms() and is_in_room("crème"):
        say(ask("René", "Thé?", ["thé", "café"]))
"""
WORLD = """robot: start_loc
rooms: [start_loc, café]
objects: {café: [crème]}
people: {café: [{name: René, answers: [thé]}]}
"""


def to_form(form: str, text: str) -> str:
    return normalize(form, text)  # type: ignore[arg-type]  # one of FORMS


@pytest.mark.parametrize("ours", FORMS)
@pytest.mark.parametrize("theirs", FORMS)
def test_program_and_world_file_may_have_any_form(ours: str, theirs: str, tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(to_form(theirs, WORLD))
    outcome = run(to_form(ours, PROGRAM), read_world(tmp_path / "world.yaml"))
    assert (outcome.status, outcome.trace[-1].text) == ("finished", "thé")
    assert holds(parse(to_form(ours, 'tr.Exists(at("café", say("thé")))')), outcome.trace)
    assert not holds(parse(to_form(theirs, 'tr.Exists(say("café"))')), outcome.trace)


def test_escape_in_a_file_is_composed(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text('robot: start_loc\nrooms: [start_loc, "cafe\\u0301"]\n')
    assert read_world(tmp_path / "world.yaml").rooms[1].name == NFC


def test_world_made_in_python_is_composed() -> None:
    world = World((Room(NFD, objects=(NFD,), people=(Person(NFD, (NFD,), ((NFD, NFD),)),)),), NFD)
    room = Room(NFC, objects=(NFC,), people=(Person(NFC, (NFC,), ((NFC, NFC),)),))
    assert world == World((room,), NFC)


@pytest.mark.parametrize("ours", [NFC, NFD])
@pytest.mark.parametrize("theirs", [NFC, NFD])
def test_check_knows_the_rooms_in_any_form(ours: str, theirs: str) -> None:
    program = f'def task_program():\n    go_to("{ours}")\n'
    assert not check(program, rooms=[theirs, "hall"], start="hall", samples=1).problems
    assert check(program, rooms=["hall"], start="hall", samples=1).problems


def test_rule_and_instruction_are_composed(tmp_path: Path) -> None:
    formula = f"tr.Exists(goto('{NFD}'))"
    written = f'{{name: out, says: Stay out of the {NFD}., always: "not {formula}"}}'
    (tmp_path / "rules.yaml").write_text(f"rules:\n  - {written}\n")
    (rule,) = read_rules(tmp_path / "rules.yaml")
    assert NFC in str(rule.formula)
    assert NFC in rule.says
    assert prompt_for(f"Go to the {NFD}").instruction == f"Go to the {NFC}"


def test_tree_of_a_program_has_composed_texts() -> None:
    assert NFC in repr(parse_leniently(f"x = '{NFD}'").body[0].value.value)  # type: ignore[attr-defined]  # this tree has it


def test_robot_is_asked_for_its_rooms_in_its_own_spelling(tmp_path: Path) -> None:
    (tmp_path / "lab.py").write_text(
        "class Spot:\n"
        "    at = 'hall'\n"
        f"    def rooms(self): return ['hall', '{NFD}']\n"
        "    def go_to(self, room):\n"
        "        assert room in self.rooms()\n"
        "        self.at = room\n"
        "    def get_current_location(self): return self.at\n"
        "    def stop(self): pass\n"
    )
    robot = open_robot(f"{tmp_path / 'lab.py'}:Spot")
    robot.connect()
    try:
        assert robot.perform("get_all_rooms", ()) == ["hall", NFC]
        assert robot.perform("go_to", (NFC,)) is None
        assert robot.perform("get_current_location", ()) == NFC
    finally:
        robot.disconnect()
