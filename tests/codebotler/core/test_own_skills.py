"""Files of custom skills: the declarations that they may hold, and the error for each mistake."""

import pickle
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest

from codebotler.checking.check import check
from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.declaration import RTL_WORDS, by_name
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.kinds import INSIDE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.verbs import Verb, verb_of
from codebotler.core.text.phrases import phrase
from codebotler.core.trace import Event, Outcome, Status, trace_data, trace_from
from codebotler.core.world import Person, Room, World
from codebotler.core.world_file import read_world
from codebotler.prompts import prompt_for
from codebotler.rtl import RtlSyntaxError, holds, parse
from codebotler.rtl.syntax import LAST_LOOKS, LOOK_RESULTS, QUESTIONS, TEXT_WORDS, WRAPPED_FIELDS
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.settings import PAPER_SETTINGS
from codebotler.simulator.worlds.robot import SimulatedRobot

HEAD = "from enum import Enum\nfrom typing import Literal\nfrom codebotler import Simulation, skill\n"
TYPED_SKILLS = (
    HEAD
    + """
class Colour(Enum):
    RED = "red"
    BLUE = "blue"

@skill
def text(sim: Simulation, one: str) -> str:
    "Text."
    return one + "!"

@skill
def whole(sim: Simulation, one: int) -> int:
    "Whole."
    return one + 1

@skill
def share(sim: Simulation, one: float) -> float:
    "Share."
    return one / 2

@skill
def truth(sim: Simulation, one: bool) -> bool:
    "Truth."
    return not one

@skill
def paint(sim: Simulation, colour: Colour, where: Literal["door", "wall"]) -> Colour:
    "Paint."
    assert isinstance(colour, Colour)
    return Colour.BLUE

@skill
def many(sim: Simulation, some: list[int], others: list[Literal["a", "b"]]) -> list[str]:
    "Many."
    return [str(each) for each in some] + others

@skill
def nothing(sim: Simulation) -> None:
    "Nothing."
"""
)
WORLD = World((Room("hall"),), "hall")
FIRST_LINES = {"tame": "", "wild": "import collections\n"}


@pytest.fixture(scope="module", name="typed")
def typed_(tmp_path_factory: pytest.TempPathFactory) -> SkillTable:
    path = tmp_path_factory.mktemp("skills") / "every.py"
    path.write_text(TYPED_SKILLS)
    return skills_from(path)


@pytest.fixture(scope="module", name="pool")
def pool_() -> WorkerPool:
    return WorkerPool(1)


@pytest.fixture(scope="module", autouse=True)
def open_pool(pool: WorkerPool) -> object:
    with pool:
        yield


def run(pool: WorkerPool, skills: SkillTable, lines: Sequence[str], tameness: str) -> Outcome:
    program = FIRST_LINES[tameness] + "def task_program():\n" + "".join(f"    {line}\n" for line in lines)
    robot = partial(SimulatedRobot, WORLD, PAPER_SETTINGS, skills)
    ((outcome,),) = pool.here().run_all([(program, [robot])])
    return outcome


@pytest.mark.parametrize("tameness", FIRST_LINES)
def test_every_type_survives_the_round_trip(pool: WorkerPool, typed: SkillTable, tameness: str) -> None:
    lines = [
        "assert text('a') == 'a!'",
        "assert whole(-3) == -2",
        "assert share(3) == 1.5 and share(0.5) == 0.25",
        "assert truth(True) is False",
        "assert paint('red', 'wall') == 'blue'",
        "assert many([1, 2], ['b']) == ['1', '2', 'b']",
        "assert nothing() is None",
    ]
    outcome = run(pool, typed, lines, tameness)
    assert outcome.error is None
    assert trace_data(outcome.trace) == [
        ["text", "a"],
        ["whole", "-3"],
        ["share", "3"],
        ["share", "0.5"],
        ["truth", "true", False],
        ["paint", "red", ["wall"]],
        ["many", "1, 2", ["b"]],
        ["nothing", ""],
    ]


@pytest.mark.parametrize("tameness", FIRST_LINES)
@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        ("text(3)", "TypeError", "text: one must be text, not int"),
        ("whole(True)", "TypeError", "whole: one must be a whole number, not bool"),
        ("whole(2.0)", "TypeError", "whole: one must be a whole number, not float"),
        (
            "whole(10 ** 30)",
            "ValueError",
            "whole: one must be a number between -2**53 and 2**53",
        ),
        ("share('1')", "TypeError", "share: one must be a number, not str"),
        (
            "share(float('inf'))",
            "ValueError",
            "share: one must be a number between -2**53 and 2**53",
        ),
        (
            "share(float('nan'))",
            "ValueError",
            "share: one must be a number between -2**53 and 2**53",
        ),
        ("truth(1)", "TypeError", "truth: one must be True or False, not int"),
        ("paint('green', 'wall')", "ValueError", 'paint: colour must be "red" or "blue", not \'green\''),
        ("paint('red', 3)", "TypeError", 'paint: where must be "door" or "wall", not int'),
        ("many(['1'], [])", "TypeError", "many: some must be a list of whole numbers, not str"),
        ("many((1,), [])", "TypeError", "many: some must be a list of whole numbers, not tuple"),
        ("many([], ['c'])", "ValueError", 'many: others must be a list of "a" or "b", not \'c\''),
        ("nothing(1)", "TypeError", "nothing() takes 0 positional arguments but 1 was given"),
    ],
)
def test_wrong_argument_is_a_program_error_without_an_event(  # noqa: PLR0917 - a row of a table
    pool: WorkerPool, typed: SkillTable, tameness: str, call: str, kind: str, message: str
) -> None:
    outcome = run(pool, typed, [call], tameness)
    assert outcome.error is not None
    assert (outcome.status, outcome.error.kind, outcome.trace) == (Status.PYTHON_ERROR, kind, ())
    assert outcome.error.message.startswith(message)


def test_trace_with_several_arguments_survives_the_round_trip() -> None:
    trace = (Event("paint", "red", more=("wall",)), Event("put", "a", found=True, more=("b", "c")))
    assert trace_from(trace_data(trace)) == trace


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ('tr.Exists(paint("red"))', True),
        ('tr.Exists(paint("red", "wall"))', True),
        ('tr.Exists(paint("red", "door"))', False),
        ("tr.Exists(whole(-3))", True),
        ("tr.Exists(whole(3))", False),
        ("tr.Exists(share(0.5))", True),
        ("tr.Exists(truth(True))", True),
        ("tr.Exists(nothing())", True),
        ("tr.Exists(returned(False, truth(True)))", True),
        ("tr.Exists(returned(True, truth(True)))", False),
    ],
)
def test_formulas_compare_all_arguments_and_results(typed: SkillTable, formula: str, expected: bool) -> None:  # noqa: FBT001 - a row of a table
    trace = (
        Event("paint", "red", more=("wall",)),
        Event("whole", "-3"),
        Event("share", "0.5"),
        Event("truth", "true", found=False),
        Event("nothing", ""),
    )
    parsed = parse(formula, skills=typed)
    assert holds(parsed, trace) is expected
    assert parse(str(parsed), skills=typed) == parsed


def test_reserved_names_are_all_words_of_formulas() -> None:
    assert {*WRAPPED_FIELDS, *LOOK_RESULTS, *LAST_LOOKS, *QUESTIONS, *TEXT_WORDS, INSIDE, "tr"} == RTL_WORDS


SWITCHES = """
@skill(sets="on", fails={"Stuck": "it is stuck"})
def turn_on(sim: Simulation, device: str) -> None: "Turn on."

@skill(clears="on", fails={"Stuck": "it is stuck"})
def turn_off(sim: Simulation, device: str) -> None: "Turn off."

@skill(clears="on", when_tried=True)
def unplug(sim: Simulation, device: str) -> None: "Unplug."
"""


def test_failed_attempts_count_as_setting_a_state_but_not_as_clearing_it(tmp_path: Path) -> None:
    path = tmp_path / "switches.py"
    path.write_text(HEAD + SWITCHES)
    skills = skills_from(path)
    rows = [row.recording for row in skills.rows if row.name in {"turn_on", "turn_off", "unplug"}]
    found = [row and (row.sets, row.clears, row.judged_when_tried) for row in rows]
    assert found == [("on", "", True), ("", "on", False), ("", "on", True)]
    assert holds(parse('on("stove")', skills=skills), (Event("turn_on", "stove"),))


def test_skill_may_not_have_the_name_of_a_state_in_another_file(tmp_path: Path) -> None:
    paths = tmp_path / "switches.py", tmp_path / "on.py"
    paths[0].write_text(HEAD + SWITCHES)
    paths[1].write_text(HEAD + "@skill\ndef on(sim: Simulation) -> None: 'Be on.'")
    for files in (paths, paths[::-1]):
        with pytest.raises(UserError, match="on is the name of a skill and of a state") as caught:
            skills_from(*files)
        assert caught.value.file == str(files[1])


def test_prompt_shows_types_errors_and_an_example(tmp_path: Path) -> None:
    path = tmp_path / "doors.py"
    path.write_text(
        HEAD + '@skill(fails={"Locked": "it is locked", "Stuck": "it is stuck"}, '
        "example='open_gate(\"north\", 2)')\n"
        'def open_gate(sim: Simulation, gate: Literal["north", "south"], times: int) -> bool:\n'
        '    """Open a\n    gate.\n\n    More for people.\n    """\n'
    )
    text = prompt_for("Open it.", skills=skills_from(path)).messages[0].text
    assert (
        'def open_gate(gate: Literal["north", "south"], times: int) -> bool:\n'
        '    """Open a gate.\n\n'
        "    Fails with an exception if it is locked or if it is stuck.\n\n"
        '    Example: result = open_gate("north", 2)\n'
        '    """'
    ) in text


FAULTY_FILES = {
    "@skill\ndef wiggle(): 'Wiggle.'": "must take the simulation first, then the arguments",
    "@skill\ndef wiggle(sim, *who: str) -> None: 'Wiggle.'": "must take the simulation first, then",
    "@skill\ndef wiggle(sim, who) -> None: 'Wiggle.'": "who of wiggle has no type; write who: str",
    "@skill\ndef wiggle(sim, who: str = 'a') -> None: 'Wiggle.'": "of programs without default values",
    "@skill\ndef wiggle(sim, who: dict) -> None: 'Wiggle.'": "who of wiggle is dict",
    "@skill\ndef wiggle(sim, who: 'Nobody') -> None: 'Wiggle.'": "who of wiggle cannot be read: name",
    "@skill\ndef wiggle(sim, who: None) -> None: 'Wiggle.'": "a parameter of wiggle cannot be None",
    "@skill\ndef wiggle(sim, who: str): 'Wiggle.'": "wiggle does not say what it returns; write -> None",
    "@skill\ndef wiggle(sim, who: str) -> None: pass": "wiggle has no docstring",
    "@skill\ndef print(sim, who: str) -> None: 'Wiggle.'": "print is a reserved name",
    "@skill\ndef found(sim, who: str) -> None: 'Wiggle.'": 'formulas cannot use "found" as a name',
    "@skill(sets='holding')\ndef wiggle(sim, a: str) -> None: 'W.'": 'formulas cannot use "holding"',
    "@skill(sets='goto')\ndef wiggle(sim, a: str) -> None: 'W.'": "goto is the name of a skill and of a",
    "@skill(clears='pick')\ndef wiggle(sim, a: str) -> None: 'W.'": "pick is the name of a skill and of a",
    "@skill(sets='a b')\ndef wiggle(sim, a: str) -> None: 'W.'": 'formulas cannot use "a b" as a name',
    "@skill(clears=1)\ndef wiggle(sim, a: str) -> None: 'W.'": "the option clears cannot be 1",
    "@skill(sets='on')\ndef wiggle(sim) -> None: 'W.'": "must set or clear a state of the thing",
    "@skill(sets='on', clears='on')\ndef wiggle(sim, a: str) -> None: 'W.'": "must set or clear a state",
    "@skill(sets='on', event=None)\ndef wiggle(sim, a: str) -> None: 'W.'": "needs an event",
    "@skill\ndef go_to(sim, who: str) -> None: 'Wiggle.'": '"go_to" is the name, event or ROS action of',
    "@skill(event='goto')\ndef fly(sim, who: str) -> None: 'Fly.'": '"goto" is the name, event or',
    "@skill(verb='wiggle {to}')\ndef wiggle(sim, who: str) -> None: 'Wiggle.'": "which is not a parameter",
    "@skill(ros='Wave')\ndef wiggle(sim, who: str) -> None: 'Wiggle.'": '"Wave" is not a ROS action',
    "@skill(fails={'KeyError': 'x'})\ndef wiggle(sim, who: str) -> None: 'Wiggle.'": '"KeyError" cannot name',
    "@skill\ndef wiggle(who: str) -> None: 'Wiggle.'": "wiggle must take the simulation first, then",
    "@skill\nasync def wiggle(sim) -> None: 'Wiggle.'": "wiggle is async, but skills must be",
    "@skill(fail={})\ndef wiggle(sim) -> None: 'Wiggle.'": "@skill has no option fail; its options are verb,",
    "@skill(fails=['A'])\ndef wiggle(sim) -> None: 'Wiggle.'": "the option fails cannot be ['A']",
    "@skill(seconds='2')\ndef wiggle(sim) -> None: 'Wiggle.'": "the option seconds cannot be '2'",
    "@skill(results=('a', 'b', 'c'))\ndef wiggle(sim) -> bool: 'Wiggle.'": "the option results cannot be",
    "@skill(names={'who': 'room'})\ndef wiggle(sim, who: str) -> None: 'Wiggle.'": "the option names cannot",
    "@skill(event='a b')\ndef wiggle(sim) -> None: 'Wiggle.'": 'formulas cannot use "a b" as a name',
    "@skill\ndef wiggle(sim, who: str) -> 'int | None': 'Wiggle.'": "the result of wiggle is int | None,",
    "@skill(text='whom')\ndef wiggle(sim, who: str) -> None: 'Wiggle.'": "wiggle has no parameter whom",
    "def wiggle(sim, who: str) -> None: 'Wiggle.'": "the file declares no skill; put @skill above a function",
    "def wiggle(": "the file is not Python",
    "1 / 0": "the file cannot be run: ZeroDivisionError",
}


@pytest.mark.parametrize("source", FAULTY_FILES)
def test_faulty_file_is_an_error_with_its_line(tmp_path: Path, source: str) -> None:
    path = tmp_path / "bad.py"
    path.write_text(HEAD + source)
    with pytest.raises(UserError) as caught:
        skills_from(path)
    assert FAULTY_FILES[source] in str(caught.value)
    assert caught.value.file is not None
    assert (caught.value.line == 4) is not source.startswith(
        "def wiggle(sim"
    )  # a file without a skill has no line to name
    assert by_name("go_to") is SKILLS["go_to"]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return 3", "wiggle returned 3, but its function must return True or False"),
        ("sim.fail('Other')", 'wiggle declares no error "Other"'),
    ],
)
@pytest.mark.parametrize("tameness", FIRST_LINES)
def test_skill_that_breaks_its_declaration_is_a_user_error(
    pool: WorkerPool, tmp_path: Path, body: str, message: str, tameness: str
) -> None:
    path = tmp_path / "bad.py"
    path.write_text(HEAD + f"@skill\ndef wiggle(sim: Simulation) -> bool:\n    'Wiggle.'\n    {body}\n")
    with pytest.raises(UserError, match=message):
        run(pool, skills_from(path), ["wiggle()"], tameness)


WRONG_TRUTHS = {
    "reed('a'): 1": "reed is not a skill with an empty body",
    "open_gate('a'): true": "open_gate is not a skill with an empty body",
    "read(3): 1": "its signature is read(what: str) -> int",
    "read('a', 'b'): 1": "the arguments of read are wrong",
    "read('a'): 1.5": "read cannot return 1.5; write a whole number or Broken",
    "read('a'): Broke": "read cannot return 'Broke'; write a whole number or Broken",
    "read(a): 1": "is not a call; write it as in",
    "'read({1: 2})': 1": "is not a call; write it as in",
    "'read([{1}])': 1": "is not a call; write it as in",
    "read(what='a'): 1": "is not a call; write it as in",
    "the sun shines: [maybe]": "is a list; write a single value",
}


@pytest.mark.parametrize("truth", WRONG_TRUTHS)
def test_impossible_truth_is_refused_with_its_line(tmp_path: Path, truth: str) -> None:
    (tmp_path / "lab.py").write_text(LAB_SKILLS)
    path = tmp_path / "world.yaml"
    path.write_text(f"robot: hall\nrooms: [hall]\ntruths:\n  {truth}\n")
    with pytest.raises(UserError) as caught:
        read_world(path, skills_from(tmp_path / "lab.py"))
    assert WRONG_TRUTHS[truth] in str(caught.value)
    assert caught.value.line == 4


def test_truths_set_the_results_of_calls_in_any_quotes(tmp_path: Path) -> None:
    (tmp_path / "lab.py").write_text(LAB_SKILLS)
    path = tmp_path / "world.yaml"
    truths = "read('a'): 7\n  read(\"b\"): Broken\n  gate a is shut: true\n"
    path.write_text(f"robot: hall\nrooms: [hall]\ntruths:\n  {truths}")
    table = skills_from(tmp_path / "lab.py")
    world = read_world(path, table)
    robot = SimulatedRobot(world, skills=table)
    assert robot.perform("read", ["a"]) == 7
    with pytest.raises(RobotError, match="read: it is broken"):
        robot.perform("read", ["b"])
    with pytest.raises(RobotError, match="open_gate: it is shut"):
        robot.perform("open_gate", ["a"])
    (tmp_path / "again.yaml").write_text(world.to_yaml())
    assert read_world(tmp_path / "again.yaml", table) == world


LAB_SKILLS = (
    HEAD
    + """
@skill(fails={"Broken": "it is broken"})
def read(sim: Simulation, what: str) -> int:
    "Read."

@skill(fails={"Broken": "it is shut"})
def open_gate(sim: Simulation, gate: str) -> bool:
    "Open."
    if sim.truth(f"gate {gate} is shut"):
        sim.fail("Broken")
    return True
"""
)


@pytest.mark.parametrize("tameness", FIRST_LINES)
@pytest.mark.parametrize("body", ["return 1 / 0", "raise SystemExit(3)", "return sim.nothing"])
def test_exception_in_a_skill_ends_only_that_run(
    pool: WorkerPool, tmp_path: Path, body: str, tameness: str
) -> None:
    path = tmp_path / "bad.py"
    path.write_text(HEAD + f"@skill\ndef wiggle(sim: Simulation) -> bool:\n    'Wiggle.'\n    {body}\n")
    outcome = run(pool, skills_from(path), ["say('a')", "wiggle()"], tameness)
    assert outcome.error is not None
    assert (outcome.status, outcome.error.kind, outcome.line) == (
        Status.ROBOT_ERROR,
        "SkillFailed",
        3 + len(FIRST_LINES[tameness][:1]),
    )
    assert outcome.error.message.startswith("wiggle failed in bad.py, line 7: ")
    assert "SimulatedRobot" not in outcome.error.message


def test_minus_zero_is_zero_to_formulas(pool: WorkerPool, typed: SkillTable) -> None:
    outcome = run(pool, typed, ["share(-0.0)"], "tame")
    assert holds(parse("tr.Exists(share(0))", skills=typed), outcome.trace)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ('tr.Exists(paint("green"))', "the text is not one of red, blue"),
        ('tr.Exists(paint("red", "floor"))', "the text is not one of door, wall"),
        ('tr.Exists(whole("two"))', "expected a whole number, or a regex for it"),
        ("tr.Exists(truth(1))", "expected True or False"),
        ("tr.Exists(returned(True, whole(1)))", "returned needs a skill that returns True or False"),
        ("tr.Exists(nothing(1))", "nothing takes no argument, not 1"),
        ('tr.Exists(paint("red", "door", "x"))', "paint takes 1 to 2 arguments, not 3"),
    ],
)
def test_formulas_that_can_never_match_are_refused(typed: SkillTable, formula: str, message: str) -> None:
    with pytest.raises(RtlSyntaxError, match=message):
        parse(formula, skills=typed)


def test_file_may_import_its_neighbours_and_declares_each_name_once(tmp_path: Path) -> None:
    (tmp_path / "my_constants_of_doors.py").write_text("DOOR = 'gate'\n")
    (tmp_path / "lab.py").write_text(
        HEAD
        + "from my_constants_of_doors import DOOR\n@skill\ndef wiggle(sim) -> None: 'W.'\nalias = wiggle\n"
    )
    assert list(skills_from(tmp_path / "lab.py", tmp_path / "lab.py"))[len(SKILLS) :] == ["wiggle"]
    (tmp_path / "twice.py").write_text(HEAD + "@skill\ndef wiggle(sim) -> None: 'Wiggle.'\n" * 2)
    with pytest.raises(UserError, match="there is already a skill wiggle"):
        skills_from(tmp_path / "twice.py")


def test_two_skills_with_one_ros_action_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "lab.py"
    action = "@skill(ros='lab_msgs/Wiggle:/wiggle')\n"
    path.write_text(
        HEAD + f"{action}def wiggle(sim) -> None: 'W.'\n{action}def jiggle(sim, how: str) -> None: 'J.'\n"
    )
    with pytest.raises(UserError, match='"/wiggle" is the name, event or ROS action'):
        skills_from(path)


@pytest.mark.parametrize(
    ("call", "kind"),
    [("text(3)", "TypeError"), ("paint('green', 'wall')", "ValueError"), ("whole()", "TypeError")],
)
def test_misuse_is_a_problem_even_where_all_errors_are_caught(
    typed: SkillTable, call: str, kind: str
) -> None:
    program = f"def task_program():\n    try:\n        {call}\n    except {{}}:\n        say('no')\n"
    (problem,) = check(program.format("Exception"), rooms=["hall"], skills=typed).problems
    assert (problem.kind, problem.line) == (kind, 3)
    assert check(program.format(kind), rooms=["hall"], skills=typed).problems == ()


def test_undefined_call_is_a_problem_even_where_all_errors_are_caught() -> None:
    program = "def task_program():\n    try:\n        {}\n    except Exception:\n        say('no')\n"
    (problem,) = check(program.format("open_hatch('a')"), rooms=["hall"]).problems
    assert (problem.kind, problem.line) == ("NameError", 3)
    assert problem.message.endswith("if it is a skill of your own, name its file with --skills")
    assert check(program.format("say(hatch)"), rooms=["hall"]).problems == ()


def test_problem_names_the_skill_that_the_robot_lacks() -> None:
    program = "def task_program():\n    pick('mug')\n"
    (problem,) = check(program, rooms=["hall"], skills=SKILLS.without({"pick"})).problems
    assert (problem.kind, problem.line) == ("NameError", 2)
    assert "this robot has no `pick` skill" in problem.message


def test_events_with_fewer_arguments_than_a_formula_names_do_not_match(typed: SkillTable) -> None:
    assert not holds(parse('tr.Exists(paint("red", "wall"))', skills=typed), (Event("paint", "red"),))


def test_own_question_records_the_answer_that_it_returns(tmp_path: Path, pool: WorkerPool) -> None:
    (tmp_path / "lab.py").write_text(
        HEAD + "@skill(to='who')\ndef vote(sim, who: str, about: str, options: list[str]) -> str: 'Vote.'\n"
    )
    table = skills_from(tmp_path / "lab.py")
    outcome = run(pool, table, ["say(vote('all', 'Tea?', ['yes', 'no']))"], "tame")
    vote, said = outcome.trace
    assert (vote.text, vote.to, vote.answer) == ("tea?", "all", said.text)


def test_a_skill_may_ask_with_options_of_any_type(tmp_path: Path) -> None:
    (tmp_path / "lab.py").write_text(
        HEAD + "@skill\ndef vote(sim, who: str) -> None:\n    'Vote.'\n    sim.ask(who, 'Tea?', ['yes', 2])\n"
    )
    table = skills_from(tmp_path / "lab.py")
    guard = RuleGuard([Rule("a", "A.", parse('not tr.Exists(ask("cake", "no"))'))])
    world = World((Room("hall", (), (Person("ann", ("yes",)),)),), "hall")
    robot = SimulatedRobot(world, PAPER_SETTINGS, table, guard=guard)
    with pytest.raises(RuleViolationError, match="not text"):
        robot.perform("vote", ["ann"])
    free = SimulatedRobot(world, PAPER_SETTINGS, table)
    free.perform("vote", ["ann"])
    assert trace_data(free.trace, table) == [
        ["ask", "Tea?", ["yes", {"no text": "2"}], "yes"],
        ["vote", "ann"],
    ]


def test_verb_phrase_uses_the_arguments_of_its_event(tmp_path: Path) -> None:
    (tmp_path / "lab.py").write_text(
        HEAD
        + "@skill(verb='put {item} into {box}', text='box')\n"
        + "def stow(sim, item: str, box: str) -> None: 'Put.'\n"
    )
    table = skills_from(tmp_path / "lab.py")
    robot = SimulatedRobot(WORLD, skills=table)
    robot.perform("stow", ["pen", "drawer"])
    assert robot.trace == (Event("stow", "drawer", more=("pen",)),)
    assert phrase(robot.trace[0], "past") == "put pen into drawer"


def test_pickled_skills_load_in_another_process(tmp_path: Path) -> None:
    path = tmp_path / "every.py"
    path.write_text(TYPED_SKILLS)
    table = skills_from(path)
    code = "import pickle, sys; print(*pickle.loads(sys.stdin.buffer.read()))"
    done = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(table), capture_output=True, check=True
    )
    assert done.stdout.decode().split() == [*SKILLS, *list(table)[len(SKILLS) :]]
    assert pickle.loads(pickle.dumps(table)) == table


@pytest.mark.parametrize(
    ("template", "parameters", "forms"),
    [
        ("open {door}", ["door"], ("open", "opens", "opened", "opening")),
        ("switch on {lamp}", ["lamp"], ("switch on", "switches on", "switched on", "switching on")),
        ("carry {thing}", ["thing"], ("carry", "carries", "carried", "carrying")),
        ("grip {thing}", ["thing"], ("grip", "grips", "gripped", "gripping")),
        ("take {lift}", ["lift"], ("take", "takes", "took", "taking")),
        ("land", [], ("land", "lands", "landed", "landing")),
        ("tie {knot}", ["knot"], ("tie", "ties", "tied", "tying")),
    ],
)
def test_verb_is_conjugated(template: str, parameters: list[str], forms: tuple[str, str, str, str]) -> None:
    assert verb_of(template, parameters, ("no", "yes")) == Verb(*forms)


def test_verb_template_may_hold_arguments_anywhere() -> None:
    verb = verb_of("pour {ml} ml of {liquid} into {target}", ["liquid", "ml", "target"], ("no", "yes"))
    assert verb.with_object(verb.past, ["water", "20", "the cup"]) == "poured 20 ml of water into the cup"


GLIDE_SKILL = (
    HEAD
    + """
@skill(names="room", text="room")
def glide(sim: Simulation, speed: int, room: str) -> None: "Glide to a room at some speed."
"""
)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        ("glide(2, 'bobs office')", 2),
        ("glide(2, room='bobs office')", 2),
        ("glide(2, 'bobs ' + 'office')", 2),
        ('glide(2, "bob\'s office")', None),
        ("try: glide(2, 'bobs office')\n    except Exception: pass", None),
    ],
)
def test_room_argument_of_an_own_skill_is_checked_like_that_of_go_to(
    tmp_path: Path, call: str, line: int | None
) -> None:
    (tmp_path / "own.py").write_text(GLIDE_SKILL)
    skills = skills_from(tmp_path / "own.py")
    program = f"def task_program():\n    {call}\n"
    found = check(program, rooms=["hall", "bob's office"], skills=skills).problems
    driving = program.replace("glide(2, ", "go_to(").replace("room=", "location=")
    expected = check(driving, rooms=["hall", "bob's office"], skills=skills).problems
    assert [one.line for one in found] == ([] if line is None else [line])
    assert [(one.kind, one.message) for one in found] == [(one.kind, one.message) for one in expected]
    assert all('"bob\'s office"' in one.message for one in found) or "+" in call


def test_guessed_rooms_include_those_of_own_skills(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(GLIDE_SKILL)
    skills = skills_from(tmp_path / "own.py")
    found = check("def task_program():\n    glide(2, 'lab')\n", skills=skills)
    assert (found.problems, "lab" in found.rooms) == ((), True)
