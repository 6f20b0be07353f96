"""Task and suite files: valid ones, and a sentence for each way in which they can be wrong."""

import copy
import pickle
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.rtl import parse
from codebotler.rtl.reasoning.alphabet import elements
from roboeval.suites.load import load_suite
from roboeval.suites.new_task import new_task
from small_suite import SUITE, TASK, write_suite


def test_a_requirement_is_its_check_with_the_arguments_filled_in(tmp_path: Path) -> None:
    goes, not_bye = load_suite(write_suite(tmp_path)).task("T").scenarios[0].require
    assert goes.formula == parse('tr.Exists(goto("kitchen"))')
    assert not_bye.formula == parse('not tr.Exists(say("bye"))')
    assert (not_bye.text, not_bye.check, not_bye.category) == ('not says("bye")', "says", "SayAtLocation")


def test_a_requirement_may_apply_to_some_prompts_only(tmp_path: Path) -> None:
    task = TASK.replace("[p]", "[p, Please say  bye to nobody.]").replace(
        """not says("bye")]""", """{check: 'not says("bye")', prompts: {1: say bye to NOBODY}}]"""
    )
    assert task != TASK
    (scenario,) = load_suite(write_suite(tmp_path, task)).task("T").scenarios
    goes, not_bye = scenario.require
    assert (goes.words, not_bye.words) == ((), ((1, "say bye to NOBODY"),))
    assert [scenario.asked_by(prompt).require for prompt in range(2)] == [(goes,), (goes, not_bye)]


def test_a_check_says_what_its_texts_mean(tmp_path: Path) -> None:
    task = TASK.replace("says(what): {", 'says(what): {means: "that {what} is over, at {start}", ')
    assert task != TASK
    suite = load_suite(write_suite(tmp_path, task))
    _, not_bye = suite.task("T").scenarios[0].require
    (said,) = elements(not_bye.formula)
    assert said.means == "that bye is over, at kitchen"
    (tmp_path / "plain").mkdir()
    assert suite.digest == load_suite(write_suite(tmp_path / "plain", TASK)).digest


def test_a_check_may_name_where_the_robot_starts(tmp_path: Path) -> None:
    task = TASK.replace('goto("kitchen")', 'at("{start}", check("x"))')
    goes, _ = load_suite(write_suite(tmp_path, task)).task("T").scenarios[0].require
    assert goes.formula == parse('tr.Exists(at("kitchen", check("x")))')


def test_a_negated_disjunction_is_negated_as_a_whole(tmp_path: Path) -> None:
    task = TASK.replace(
        """'tr.Exists(say("{what}"))'""", """'tr.Exists(say("a")) or tr.Exists(say("{what}"))'"""
    )
    requirement = load_suite(write_suite(tmp_path, task)).task("T").scenarios[0].require[1]
    assert requirement.formula == parse('not (tr.Exists(say("a")) or tr.Exists(say("bye")))')


@pytest.mark.parametrize(
    ("old", "new", "line", "named"),
    [
        ("summary: s\n", "", 1, '"summary"'),
        ("name: T", "name: U", 1, 'named "U"'),
        ("prompts: [p]", "prompts: []", 3, '"prompts"'),
        ("category: Location", "category: Place", 5, '"Place"'),
        ("goes:", "2 goes:", 5, '"2 goes"'),
        ("says(what)", '"says(what, )"', 6, '"says(what, )"'),
        ('"kitchen"))', '"kitchen")', 5, 'the check "goes" is not valid'),
        ("goto(", "gote(", 5, 'the check "goes" is not valid'),
        ("goto(", "inside(", 5, "only house rules can use it"),
        ("goes: {", "goes: {means: {go: there}, ", 5, '"go"'),
        ("goes: {", "goes: {means: 'that {it} is', ", 5, '"it" is not a parameter'),
        ("[goes,", "[gose,", 11, 'no check "gose"'),
        ("[goes,", '[goes("x"),', 11, 'the check "goes" takes no argument'),
        ('says("bye")', "says(bye)", 11, "not a requirement"),
        ('says("bye")', 'says(what="bye")', 11, "not a requirement"),
        (
            'says("bye")]\n',
            'says("bye")]\n    ablation: []\n  - {about: b, robot: r, rooms: [r], require: [goes]}\n',
            7,
            "ablation",
        ),
        ("[goes,", "[{check: goes, prompts: {0: hello}},", 11, '"hello"'),
        ("[goes,", "[{check: goes, prompts: {1: p}},", 11, "there is no prompt 1"),
        ("[goes,", f"[{{check: goes, prompts: {{'{2**61 - 1}': p}}}},", 11, "less than 10000"),
        ("[goes,", "[{check: goes, prompts: {}},", 11, '"prompts" is {}, but'),
        ("[goes,", "[{prompts: {0: p}},", 11, '"check" is missing'),
        ("[goes,", "[{check: goes, prompt: {0: p}},", 11, '"prompt" is unknown'),
        ("prompts: [p]", "prompts: [p]\ncovered_by: {f: [goes]}", 4, 'no fact "f"'),
        (
            "prompts: [p]",
            "prompts: [p]\nfacts:\n  - {fact: f, words: [p]}\ncovered_by: {f: goes}",
            6,
            "[goes]",
        ),
        (
            "prompts: [p]",
            "prompts: [p]\nfacts:\n  - {fact: f, words: [p]}\ncovered_by: {f: []}",
            6,
            "at least 1",
        ),
        ("says(what)", "says(start)", 6, '"start"'),
        ("[goes,", "[{check: goes, prompts: {0: ''}},", 11, "at least 1"),
        (
            "prompts: [p]",
            "prompts: [p]\nfacts:\n  - {fact: f, words: [p]}\ncovered_by: {f: [went]}",
            6,
            'no check "went"',
        ),
        ('say("{what}")', 'say("{waht}")', 6, '"waht"'),
        ("tr.Exists(goto(", 'tr.Exists(goto("{room}",', 5, '"room"'),
        ('say("{what}")', 'say("x{3}")', 6, "{what}"),
        (
            'says("bye")]\n',
            'says("bye")]\n  - robot: r\n    about: one\n    rooms: [r]\n    require: [goes]\n',
            13,
            '"one"',
        ),
        (
            'says("bye")]\n',
            'says("bye")]\n  - robot: r\n    about: " One "\n    rooms: [r]\n    require: [goes]\n',
            13,
            '" One "',
        ),
        ("require: [goes,", "demand: [goes,", 11, '"demand" is unknown'),
        ("robot: kitchen", "robot: hall", 9, '"hall"'),
        (
            "prompts: [p]",
            'prompts: [p]\nfacts:\n  - {fact: f, words: ["("]}',
            5,
            '"(", but this text is not a valid regular expression',
        ),
        ("rooms: [kitchen", "rooms: [(a+)+$, kitchen", 10, '"(a+)+$", but searching for this text may take'),
        ("summary: s", "summary: s\nsummary: t", 3, '"summary"'),
        ("summary: s", "summary: [s", 3, "YAML"),
    ],
)
def test_a_wrong_task_file_names_its_line(tmp_path: Path, old: str, new: str, line: int, named: str) -> None:
    assert old in TASK
    with pytest.raises(UserError) as caught:
        load_suite(write_suite(tmp_path, TASK.replace(old, new, 1)))
    assert (caught.value.file, caught.value.line) == (tmp_path / "tasks" / "T.yaml", line)
    assert named in caught.value.sentence
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("suite", "line", "named"),
    [
        ("name: mine\nversion: one\n", 2, ['"version"', "whole number"]),
        (
            "name: mine\nversion: 1\nrules: {limits: {seconds: .inf}}\n",
            3,
            ['"seconds"', "finite"],
        ),
        (SUITE + "rules: {limits: {calls: yes}}\n", 3, ['"calls"', "whole number"]),
        (
            SUITE + "rules: {limits: {ticks: 1000000001}}\n",
            3,
            ['"ticks"', "1000000001", "1000000000"],
        ),
        (
            SUITE + "worlds: 10001\n",
            3,
            ['"worlds"', "10001", "10000"],
        ),
        (
            SUITE + "rules: {clock_starts: 5}\n",
            3,
            ['"clock_starts" is 5', "1970"],
        ),
        (
            SUITE + "rules:\n  clock_starts: 2024-01-01T12:00:00\n",
            4,
            ['"clock_starts"', "2024", "1970 to 2099"],
        ),
        (
            SUITE + "rules:\n  clock_starts: 9999-12-31T23:59:59Z\n",
            4,
            ['"clock_starts"', "9999", "1970 to 2099"],
        ),
        (SUITE + "rules: {literals: loud}\n", 3, ['"literals"', '"loud"']),
        (SUITE + "rules: {gravity: 9.81}\n", 3, ['"gravity"']),
        (SUITE + "rules: {skill_seconds: 2}\n", 3, ['"skill_seconds" is 2']),
        (SUITE + "rules: {limits: {calls: 0}}\n", 3, ['"calls" is 0']),
        (
            "version: 1\nname: my-ablation\n",
            2,
            ['"my-ablation"', '"-ablation"'],
        ),
        ("", None, ["empty"]),
    ],
)
def test_a_wrong_suite_file_names_its_line(
    tmp_path: Path, suite: str, line: int | None, named: list[str]
) -> None:
    with pytest.raises(UserError) as caught:
        load_suite(write_suite(tmp_path, suite=suite))
    assert (caught.value.file, caught.value.line) == (tmp_path / "suite.yaml", line)
    assert all(name in caught.value.sentence for name in named), caught.value


def test_a_clock_may_start_at_any_offset(tmp_path: Path) -> None:
    suite = load_suite(
        write_suite(tmp_path, suite=SUITE + "rules:\n  clock_starts: 2024-01-01T12:00:00+02:00\n")
    )
    assert suite.settings.clock_starts.timestamp() == 1_704_103_200


def test_an_unknown_suite_is_refused() -> None:
    with pytest.raises(UserError, match=r'"nonsense"; .*paper, plus'):
        load_suite("nonsense")


def test_the_hash_depends_on_checks_and_rules_but_not_on_comments(tmp_path: Path) -> None:
    digests = []
    for number, task in enumerate([TASK, "# a comment\n" + TASK, TASK.replace('"bye"', '"good bye"')]):
        folder = tmp_path / str(number)
        folder.mkdir()
        digests.append(load_suite(write_suite(folder, task)).digest)
    assert digests[0] == digests[1] != digests[2]
    folder = tmp_path / "stricter"
    folder.mkdir()
    assert load_suite(write_suite(folder, suite=SUITE + "rules: {limits: {calls: 7}}\n")).digest != digests[0]


def test_a_new_task_is_complete_and_cannot_be_started_again(tmp_path: Path) -> None:
    folder = tmp_path / "my suite"
    new_task(folder, "MakeTea")
    suite = load_suite(str(folder))
    required = [[r.text for r in scenario.require] for scenario in suite.task("MakeTea").scenarios]
    assert required == [["announces_tea"], ['visits("kitchen")', "not announces_tea"]]
    (folder / "tasks" / "MakeTea.yaml").write_text("mine")
    with pytest.raises(UserError, match="already"):
        new_task(folder, "MakeTea")
    assert (folder / "tasks" / "MakeTea.yaml").read_text() == "mine"


@pytest.mark.parametrize("name", ["../x", "", "makeTea", "Make Tea", "Make-Tea", "Tee\n", "T\u00e4ufer"])
def test_a_wrong_name_for_a_new_task_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match="not a task name"):
        new_task(tmp_path, name)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("folder", "name"),
    [("My Suite", "my-suite"), ("plus", "my-plus"), ("3", "mine"), ("tea-ablation", "tea"), ("茶", "mine")],
)
def test_a_new_suite_is_named_after_its_folder_if_possible(tmp_path: Path, folder: str, name: str) -> None:
    new_task(tmp_path / folder, "MakeTea")
    assert load_suite(str(tmp_path / folder)).name == name


def test_a_new_suite_within_another_is_refused(tmp_path: Path) -> None:
    new_task(tmp_path / "lab", "MakeTea")
    with pytest.raises(UserError, match="subfolder of a suite") as error:
        new_task(tmp_path / "lab" / "tasks", "MakeCoffee")
    assert error.value.file == tmp_path / "lab" / "tasks"
    assert [path.name for path in (tmp_path / "lab" / "tasks").iterdir()] == ["MakeTea.yaml"]


def test_a_suite_is_read_again_only_when_its_files_change(tmp_path: Path) -> None:
    folder = write_suite(tmp_path)
    before = load_suite(folder)
    assert load_suite(folder) is before
    (tmp_path / "tasks" / "T.yaml").write_text(TASK.replace("about: one", "about: another"))
    after = load_suite(folder)
    assert [scenario.world.about for scenario in after.task("T").scenarios] == ["another"]
    (tmp_path / "tasks" / "U.yaml").write_text(TASK.replace("name: T", "name: U"))
    assert [*load_suite(folder).tasks] == ["T", "U"]


def test_the_rules_of_the_paper() -> None:
    suite = load_suite("paper")
    assert (suite.settings.limits.seconds, suite.settings.limits.calls, suite.settings.limits.ticks) == (
        3600,
        1000,
        200_000,
    )
    assert suite.settings.literals == "lowercase"
    assert suite.settings.clock_starts.isoformat() == "2024-01-01T12:00:00+00:00"


@pytest.mark.parametrize("name", ["paper", pytest.param("plus", marks=pytest.mark.slow)])
def test_a_suite_can_be_copied_pickled_and_hashed(name: str) -> None:
    suite = load_suite(name)
    again = pickle.loads(pickle.dumps(suite))
    assert {suite, again, copy.deepcopy(suite)} == {suite}
    if suite.worlds is not None:
        assert again.with_worlds(9, 5) == suite.with_worlds(9, 5)
