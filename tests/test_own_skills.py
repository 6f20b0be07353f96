"""Six sets of custom skills, from the model's prompt to the robot, the benchmark and the page."""

import inspect
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from typer.testing import CliRunner

from codebotler.checking.check import check
from codebotler.checking.house_rules.file import read_rules
from codebotler.cli.app import app
from codebotler.core.cachedproperty import cached_property
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.world_file import read_world
from codebotler.missions.storage.store import read_missions
from codebotler.simulator.worlds.room_map import RoomMap
from roboeval.cli.app import app as roboeval
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite
from roboeval.suites.solutions import solutions

SETS = Path(__file__).parent.parent / "examples" / "skills"
BREAKS = {
    "drone": "take_off()",
    "gpsr": 'go_to("kitchen")\n    open_door("fridge")\n    go_to("hall")',
    "hotel_lift": "if call_lift():\n        ride_to(5)",
    "lab_bench": 'new_tip()\n    aspirate("ethanol", 20)\n    dispense("A1")',
    "quadruped": 'open_door("glass door")',
    "tidy_arm": 'tidy("pen", "bin")',
}
RULES = {
    "drone": "land",
    "gpsr": "close-doors",
    "hotel_lift": "staff-floor",
    "lab_bench": "no-ethanol-in-row-a",
    "quadruped": "knock",
    "tidy_arm": "no-pens-in-the-bin",
}
TASKS = {"gpsr": 30}  # The other sets have three tasks each.


EXPENSIVE_TESTS = {
    *("test_tasks_have_no_findings", "test_an_instruction_becomes_a_program_and_a_mission"),
    *("test_the_rule_is_shown_with_examples", "test_a_suite_is_evaluated_and_mutated_from_the_command_line"),
}
"""Tests that are marked slow for all sets but the first."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "own" in metafunc.fixturenames:
        first, *others = BREAKS
        is_expensive = metafunc.definition.name in EXPENSIVE_TESTS
        sets = [
            first,
            *(pytest.param(one, marks=[pytest.mark.slow] * (is_expensive or one in TASKS)) for one in others),
        ]
        metafunc.parametrize("own", sets, indirect=True)


@dataclass(frozen=True)
class Own:
    """A set of custom skills."""

    folder: Path

    @cached_property
    def suite(self) -> Suite:
        return load_suite(self.folder)

    @cached_property
    def skills(self) -> SkillTable:
        return skills_from(self.folder / "skills.py")

    @property
    def options(self) -> list[str]:
        return ["--skills", str(self.folder / "skills.py"), "--world", str(self.folder / "world.yaml")]

    @property
    def careful_programs(self) -> list[str]:
        """Each program once, which several phrasings of a task share."""
        return [*dict.fromkeys(one.program for one in recorded_completions("recorded:careful", self.suite))]

    def problems(self, program: str, *, with_rules: bool = False) -> list[str]:
        rules = read_rules(self.folder / "rules.yaml", self.skills) if with_rules else ()
        rooms = RoomMap.of(read_world(self.folder / "world.yaml"))
        found = check(program, room_map=rooms, skills=self.skills, house_rules=rules)
        return [problem.kind for problem in found.problems]


@pytest.fixture(name="own")
def own_(request: pytest.FixtureRequest) -> Own:
    return Own(SETS / request.param)


def run_command(*words: str, status: int = 0) -> str:
    done = CliRunner().invoke(app, [*words])
    assert done.exit_code == status, done.output
    return done.output


def test_each_set_has_its_tasks_and_at_most_ten_lines_a_skill() -> None:
    assert sorted(BREAKS) == sorted(path.name for path in SETS.iterdir() if path.is_dir())
    for name in BREAKS:
        own = Own(SETS / name)
        assert len(own.suite.tasks) == TASKS.get(name, 3)
        for skill in own.skills.rows[len(SKILLS) :]:
            assert skill.does is not None
            source, first = inspect.getsourcelines(inspect.unwrap(skill.does))
            assert first > 0
            assert len([line for line in source if line.strip()]) <= 10, skill.name


def test_right_programs_pass_and_wrong_ones_fail_with_the_stated_kind(own: Own) -> None:
    written = [(task, one) for task in own.suite.tasks.values() for one in solutions(task)]
    completions = [
        Completion(
            task=task.name, prompt=0, index=number, program=one.program, instruction=None, model="hand"
        )
        for number, (task, one) in enumerate(written)
    ]
    for (task, solution), row in zip(written, evaluate(completions, own.suite), strict=True):
        failure = row["failure"]
        assert (failure and failure["kind"]) == solution.fails, (task.name, solution.about, failure)


def test_tasks_have_no_findings(own: Own) -> None:
    done = CliRunner().invoke(roboeval, ["tasks", "--suite", str(own.folder), "--lint"])
    assert done.exit_code == 0, done.output
    assert "warning" not in done.stdout


def test_check_accepts_right_programs_and_finds_unhandled_errors(own: Own) -> None:
    declared = {kind for skill in own.skills.rows for kind, _ in skill.fails}
    for program in own.careful_programs:
        assert own.problems(program) == [], program
    for task in own.suite.tasks.values():
        for solution in solutions(task):
            if solution.fails in declared:
                assert solution.fails in own.problems(solution.program), (task.name, solution.about)


def test_a_program_that_breaks_the_house_rule_is_rejected_before_it_runs(own: Own) -> None:
    program = f"def task_program():\n    {BREAKS[own.folder.name]}\n"
    assert "RuleViolation" in own.problems(program, with_rules=True)
    for careful in own.careful_programs:
        assert own.problems(careful, with_rules=True) == [], careful


def test_an_instruction_becomes_a_program_and_a_mission(
    own: Own, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CODEBOTLER_HOME", str(tmp_path))
    task = next(iter(own.suite.tasks.values()))
    model = ["--model", f"recorded:{own.folder / 'solutions'}"]
    instruction = task.prompts[0]
    program = run_command("generate", instruction, *own.options, *model)
    assert "def task_program():" in program
    prompt = run_command("generate", instruction, *own.options, *model, "--show-prompt")
    assert all(f"def {skill}(" in prompt for skill in own.skills)
    rules = ["--rules", str(own.folder / "rules.yaml")]
    output = run_command("run", instruction, *own.options, *model, *rules, "--yes", "--speed", "0")
    (mission,) = read_missions(tmp_path)
    assert mission.state == "done", output
    shown = run_command("missions", "last", "--skills", str(own.folder / "skills.py"))
    words = {skill.verb.third for skill in own.skills.rows[len(SKILLS) :] if skill.verb}
    assert any(word in shown for word in words), shown
    run_command("missions", "last", "--mcap", str(tmp_path / "mission.mcap"))
    with (tmp_path / "mission.mcap").open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics & {f"/skill/{skill.name}" for skill in own.skills.rows[len(SKILLS) :]}


def test_the_command_shows_each_skill_and_tries_it(own: Own) -> None:
    listed: list[dict[str, Any]] = json.loads(run_command("skills", str(own.folder / "skills.py"), "--json"))
    assert [one["name"] for one in listed] == list(own.skills)
    assert all(one["tried"] for one in listed)
    shown = "".join(run_command("skills", str(own.folder / "skills.py")).split())  # Lines may be wrapped.
    assert all("".join(one["signature"].split()) in shown for one in listed[len(SKILLS) :])


def test_the_rule_is_shown_with_examples(own: Own) -> None:
    shown = run_command("rules", str(own.folder / "rules.yaml"), *own.options)
    assert "keeps it" in shown
    assert "breaks it" in shown
    assert "note:" not in shown


@pytest.mark.slow
def test_a_suite_is_evaluated_and_mutated_from_the_command_line(own: Own, tmp_path: Path) -> None:
    run = str(tmp_path / "run")
    words = ["evaluate", "recorded:hasty", "--suite", str(own.folder), "--out", run, "--json"]
    done = CliRunner().invoke(roboeval, words)
    assert done.exit_code == 0, done.output
    shown = CliRunner().invoke(roboeval, ["show", run, "--suite", str(own.folder)])
    assert shown.exit_code == 0, shown.output
    words = ["run", "--model", "recorded:careful", "--suite", str(own.folder), "--no-report"]
    words += ["--num-completions", "2"]  # a prompt has two different programs at most
    passed = CliRunner().invoke(roboeval, [*words, "--out", str(tmp_path / "careful")])
    assert "pass@1 over all prompts: 1.000" in passed.output, passed.output
    again = ["resample", str(tmp_path / "careful"), "--suite", str(own.folder), "--json"]
    checked = json.loads(CliRunner().invoke(roboeval, again).stdout)["prompts"]
    assert [prompt["accepted"] for prompt in checked] == [prompt["completions"] for prompt in checked]
    mutated = CliRunner().invoke(
        roboeval, ["mutate", "--suite", str(own.folder), "--mutants", "4", "--brief"]
    )
    assert mutated.exit_code == 0, mutated.output
    assert all(task in mutated.output for task in own.suite.tasks)
