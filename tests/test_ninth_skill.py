"""One more skill is one function; everything else follows from it."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from codebotler.checking.check import check
from codebotler.checking.storyboard import step_text, steps_of
from codebotler.core.errors import RobotError, UserError
from codebotler.core.program import Flaw
from codebotler.core.skills.declaration import skill
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Recording, RosAction, Skill, SkillTable
from codebotler.core.skills.values import TEXT_TYPE, TRUTH_TYPE, ValueType
from codebotler.core.skills.verbs import Verb
from codebotler.core.trace import Event, Option, Outcome, RunError, Status, trace_data, trace_from
from codebotler.core.world import Person, Room, World
from codebotler.prompts import prompt_for
from codebotler.rtl import holds, parse
from codebotler.simulator.engine import run
from codebotler.simulator.worlds.robot import SimulatedRobot
from flaws import find_flaws
from other_functions import with_functions
from roboeval.suites.load import SUITES, load_suite


@skill(ros=RosAction("Wave", "/wave_server", ("string person",)), when_tried=True)
def wave(robot: SimulatedRobot, person: str) -> None:
    """Wave at a person in the room."""
    if not robot.occupants[robot.room]:
        raise RobotError("WaveNoPerson", f'nobody is here to be waved at as "{person}"')


TABLE = SKILLS.with_skill(wave)
WORLD = World((Room("hall"), Room("lab", people=(Person("alice"),))), "hall")


def test_simulated_robot_performs_it() -> None:
    robot = SimulatedRobot(WORLD, skills=TABLE)
    with pytest.raises(RobotError, match="nobody is here"):
        robot.perform("wave", ["alice"])
    robot.perform("go_to", ["lab"])
    robot.perform("wave", ["alice"])
    assert robot.trace == (Event("wave", "alice"), Event("goto", "lab"), Event("wave", "alice"))


def test_its_yes_or_no_result_is_traced_and_worded() -> None:
    verb = Verb("open", "opens", "opened", "opening", results=("it would not move", "it moved"))

    @skill(event="open", verb=verb)
    def open_door(_: SimulatedRobot, door: str) -> bool:
        """Open it."""
        return door == "glass door"

    robot = SimulatedRobot(WORLD, skills=SKILLS.with_skill(open_door))
    assert [robot.perform("open_door", [door]) for door in ("glass door", "gate")] == [True, False]
    assert [(event.text, event.found) for event in robot.trace] == [("glass door", True), ("gate", False)]
    robot.perform("say", ["done"])
    assert robot.trace[-1].found is None
    assert str(step_text(steps_of(robot.trace)[1])) == 'opened "gate": it would not move'


def test_own_question_is_shown_with_options_and_answer() -> None:
    vote = Event("vote", "tea?", (Option("yes"), Option("no")), answer="no")
    (step,) = steps_of((vote,))
    assert str(step_text(step)) == 'did vote "tea?" [yes | no] → no'
    (unanswered,) = steps_of((Event("ask", "tea?", (Option("yes"),)),))
    assert str(step_text(unanswered)) == 'asked "tea?" [yes] → no answer'


PROGRAMS = {
    "waves": "def task_program():\n    go_to('lab')\n    wave('alice')\n    wave(person='bob')\n",
    "nobody": "def task_program():\n    say('a')\n    wave('alice')\n",
    "too many": "def task_program():\n    wave('a', 'b')\n",
    "unknown name": "def task_program():\n    wave(who='a')\n",
    "no text": "def task_program():\n    wave(3)\n",
}


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Outcome]:
    pairs: Iterator[tuple[str, World]] = ((program, WORLD) for program in PROGRAMS.values())
    return dict(zip(PROGRAMS, run(pairs, workers=1, skills=TABLE), strict=True))


def test_program_calls_it_and_trace_has_it(outcomes: dict[str, Outcome]) -> None:
    assert outcomes["waves"] == Outcome(
        Status.FINISHED, (Event("goto", "lab"), Event("wave", "alice"), Event("wave", "bob"))
    )


def test_its_own_error_ends_the_run_as_a_robot_error(outcomes: dict[str, Outcome]) -> None:
    assert outcomes["nobody"] == Outcome(
        Status.ROBOT_ERROR,
        (Event("say", "a"), Event("wave", "alice")),
        RunError("WaveNoPerson", 'nobody is here to be waved at as "alice"'),
        3,
    )


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("too many", "wave() takes 1 positional argument but 2 were given"),
        ("unknown name", "wave() got an unexpected keyword argument 'who'"),
        ("no text", "wave: person must be text, not int"),
    ],
)
def test_wrong_arguments_raise_type_error_and_leave_no_event(
    outcomes: dict[str, Outcome], name: str, message: str
) -> None:
    assert outcomes[name] == Outcome(Status.PYTHON_ERROR, (), RunError("TypeError", message), 2)


def test_program_cannot_call_it_where_the_table_has_only_eight() -> None:
    (outcome,) = run([(PROGRAMS["waves"], WORLD)], workers=1)
    assert outcome.error == RunError("NameError", "name 'wave' is not defined")


def test_formula_judges_it(outcomes: dict[str, Outcome]) -> None:
    trace = outcomes["waves"].trace
    assert holds(parse('tr.Exists(wave("alice"))', skills=TABLE), trace)
    assert holds(parse('tr.ActAtFirst("lab", wave("bob"))', skills=TABLE), trace)
    assert not holds(parse('tr.Exists(wave("carol"))', skills=TABLE), trace)


def test_traces_of_skills_that_ask_or_look_are_written_and_read() -> None:
    asks = Skill(
        "vote",
        (Parameter("about"), Parameter("options", ValueType(is_list=True), is_options=True)),
        TEXT_TYPE,
        "Let all in the room vote.",
        Recording("vote", "about", "options"),
    )
    smells = Skill("smells", (Parameter("what"),), TRUTH_TYPE, "Smell.", Recording("smell", "what"))
    table = SkillTable((*SKILLS.rows, asks, smells))
    trace = (
        Event("vote", "tea?"),
        Event("vote", "tea?", (Option("a"),), "a"),
        Event("smell", "tea", found=True),
    )
    assert trace_from(trace_data(trace, table)) == trace


def test_suite_with_a_formula_of_it_draws_worlds(tmp_path: Path) -> None:
    shutil.copytree(SUITES / "plus", tmp_path / "plus")
    task = tmp_path / "plus" / "tasks" / "SayGoodDay.yaml"
    for other in {*task.parent.iterdir()} - {task}:
        other.unlink()
    task.write_text(
        task.read_text().replace(
            "rtl: not tr.Exists(goto", 'rtl: not tr.Exists(wave("bob")) and not tr.Exists(goto', 1
        )
    )
    with pytest.raises(UserError, match="wave"):
        load_suite(tmp_path / "plus")
    loaded = load_suite(tmp_path / "plus", skills=TABLE)
    assert loaded.with_worlds(10).with_own_worlds() == loaded


def test_prompt_documents_it() -> None:
    prompt = prompt_for("Wave at alice.", skills=TABLE)
    for text in (prompt.messages[0].text, prompt.text):
        assert 'def wave(person: str) -> None:\n    """Wave at a person in the room.\n\n' in text
        assert 'Example: wave("person")\n' in text


def test_a_check_in_imagined_worlds_knows_it() -> None:
    def wave_at_anybody(_: SimulatedRobot, person: str) -> None:
        assert person

    table = with_functions(TABLE, wave=wave_at_anybody)
    found = check(PROGRAMS["waves"], rooms=["hall", "lab"], skills=table)
    assert found.problems == ()
    assert found.data(TABLE)["samples"][0]["trace"][1] == ["wave", "alice"]
    assert [problem.kind for problem in check(PROGRAMS["waves"]).problems] == ["NameError", "NameError"]


def test_static_check_knows_it() -> None:
    assert find_flaws(PROGRAMS["waves"], TABLE) == ()
    assert [problem.kind for problem in find_flaws(PROGRAMS["waves"])] == ["NameError", "NameError"]
    (problem,) = find_flaws(PROGRAMS["too many"], TABLE)
    assert isinstance(problem, Flaw)
    assert (problem.line, problem.kind) == (2, "TypeError")
