"""The linter of tasks: each kind of finding, with a task that has it and one that does not."""

import json
import re
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.linting.findings import Finding, render
from roboeval.linting.lint import lint
from roboeval.linting.task_findings import judge_solutions
from roboeval.suites.load import load_suite
from roboeval.suites.new_task import new_task
from roboeval.suites.solutions import solutions

Lint = Callable[..., list[Finding]]

WORLD = """
  - about: {about}
    robot: start_loc
    rooms: [kitchen, conference room, start_loc]
    objects: {{kitchen: [mug]}}
    people: {{kitchen: [{{name: ann, answers: ["yes"]}}]}}
    require: {require}
"""
SOLUTIONS = """
programs:
    - {about: does nothing, fails: SayAtLocation, program: "def task_program(): pass"}
    - {about: is right, program: "def task_program():\\n  go_to('kitchen'); say('hello')"}
"""


def head_of(formula: str, category: str = "SayAtLocation") -> str:
    return f"{{category: {category}, rtl: {json.dumps(formula)}}}"


@pytest.fixture
def linter(tmp_path: Path) -> Lint:
    """Return a function that writes a task and returns its findings, by default without those on programs."""

    def write(
        checks: dict[str, str],
        *worlds: Sequence[str],
        accepted: dict[str, str] | None = None,
        solutions: str = SOLUTIONS,
        untripped: bool = False,
        unworded: bool = False,
        replaced: tuple[str, str] = ("", ""),
        edited: Sequence[tuple[str, str]] = (),
        skills: str = "",
        matching: str = "label-in-request",
    ) -> list[Finding]:
        suite = tmp_path / f"suite{len([*tmp_path.iterdir()])}"
        (suite / "tasks").mkdir(parents=True)
        (suite / "solutions").mkdir()
        head = f"name: mine\nversion: 1\nrules: {{matching: {matching}}}\n" + "skills: [own.py]\n" * bool(
            skills
        )
        (suite / "suite.yaml").write_text(head)
        (suite / "own.py").write_text(skills)
        (suite / "solutions" / "Hello.yaml").write_text(solutions)
        lines = ["name: Hello", "summary: Greet.", "prompts: [Say hello in the kitchen.]", "checks:"]
        lines += [f"  {name}: {head_of(rtl)}" for name, rtl in checks.items()]
        lines.append("worlds:")
        for number, require in enumerate(worlds, 1):
            quoted = "[" + ", ".join("'" + text + "'" for text in require) + "]"
            lines.append(WORLD.replace(*replaced).format(about=f"number {number}", require=quoted))
        if accepted:
            lines.append("accepted:")
            lines += [f"  - {{finding: '{name}', because: {why}}}" for name, why in accepted.items()]
        text = "\n".join(lines) + "\n"
        for old, new in edited:
            assert old in text
            text = text.replace(old, new)
        (suite / "tasks" / "Hello.yaml").write_text(text)
        loaded = load_suite(str(suite))
        task = loaded.task("Hello")
        verdicts = judge_solutions(task, loaded) if untripped else []
        findings = lint(task, verdicts, loaded.settings.matching)
        wanted = {"untripped": untripped, "unworded": unworded}
        return [one for one in findings if wanted.get(one.kind, True)]

    return write


def names(findings: list[Finding]) -> list[str]:
    return [finding.name for finding in findings]


SPEAKS = 'tr.Exists(say("hello"))'
GREETS_THERE = 'tr.ActAtFirst("kitchen", say("hello"))'
GOES = 'tr.Exists(goto("kitchen"))'
STAYS = 'not tr.Exists(goto("kitchen"))'


def test_a_sound_task_has_no_finding(linter: Lint) -> None:
    assert linter({"speaks": SPEAKS, "goes": GOES}, ["speaks", "goes"], untripped=True) == []


# --- kinds


def test_a_requirement_that_cannot_hold(linter: Lint) -> None:
    (finding,) = linter({"odd": 'tr.Exists(say("a")) and not tr.Exists(say("a|b"))'}, ["odd"])
    assert finding.name == "unsatisfiable: odd"
    assert '"odd"' in finding.message
    assert "world 1" in finding.message
    assert finding.line == 13  # It is the line of the requirement.
    assert linter({"even": 'tr.Exists(say("a|b")) and not tr.Exists(say("a"))'}, ["even"]) == []


@pytest.mark.parametrize(("matching", "can_hold"), [("label-in-request", False), ("longest-name", True)])
def test_a_place_is_reached_if_the_suite_prefers_longer_names(
    linter: Lint, matching: str, *, can_hold: bool
) -> None:
    places = ("rooms: [kitchen, ", "rooms: [{{name: kitchen, places: [kitchen table]}}, ")
    formula = 'tr.Exists(at("kitchen table", place("mug")))'
    found = linter({"puts": formula}, ["puts"], replaced=places, matching=matching)
    assert ("unsatisfiable" in {one.kind for one in found}) is not can_hold


def test_requirements_that_cannot_hold_together(linter: Lint) -> None:
    checks = {"goes": GOES, "stays": STAYS, "speaks": SPEAKS}
    (finding,) = linter(checks, ["speaks", "goes", "stays"])
    assert (finding.name, finding.line) == ("unsatisfiable: goes and stays", 15)
    assert linter(checks, ["speaks", "goes"], ["stays", "speaks"]) == []


def test_a_requirement_in_an_absent_room_cannot_hold(linter: Lint) -> None:
    checks = {"greets": 'tr.ActAtFirst("lobby", say("hello"))'}
    findings = linter(checks, ["greets"])
    assert names(findings) == ["absent: lobby in greets", "unsatisfiable: greets"]
    assert [one.line for one in findings] == [13, 13]


def test_a_requirement_that_follows_from_another(linter: Lint) -> None:
    checks = {"greets": GREETS_THERE, "goes": GOES, "speaks": SPEAKS}
    (one, other) = linter(checks, ["greets", "goes", "speaks"])
    assert (one.name, other.name) == ("implied: goes", "implied: speaks")
    for name in ('"goes"', "world 1", '"greets"'):
        assert name in one.message
    assert linter(checks, ["goes", "speaks"], ["greets"]) == []


def test_a_requirement_implied_only_by_some_prompts_is_no_finding(linter: Lint) -> None:
    checks = {"greets": GREETS_THERE, "goes": GOES}
    more = ("[Say hello in the kitchen.]", "[Say hello in the kitchen., Go there.]")
    greets = "{check: greets, prompts: {0: Say hello in the kitchen}}"
    assert names(linter(checks, ["goes", "greets"])) == ["implied: goes"]
    assert linter(checks, ["goes", "greets"], edited=(more, ("'greets'", greets))) == []


def test_a_clause_that_no_check_covers(linter: Lint) -> None:
    checks = {"speaks": SPEAKS, "goes": GOES}
    lines = (
        "facts:",
        "  - {fact: where, words: [kitchen]}",
        "  - {fact: what, words: [hello]}",
        "covered_by: {where: [goes], what: [speaks]}",
        "checks:",
    )
    facts = ("checks:", "\n".join(lines))
    more = ("[Say hello in the kitchen.]", "['Say hello in the kitchen, and then come back here.']")
    (finding,) = linter(checks, ["speaks", "goes"], edited=(facts, more))
    assert finding.name == "uncovered: 0: and then come back here."
    assert linter(checks, ["speaks", "goes"], edited=(facts,)) == []
    forgotten = ("what: [speaks]", "")
    assert names(linter(checks, ["speaks", "goes"], edited=(facts, forgotten))) == ["uncovered: what"]
    reason = ("what: [speaks]", "what: it goes without saying")
    assert linter(checks, ["speaks", "goes"], edited=(facts, reason)) == []
    skipping = ("[hello]", "['hello.*here']")
    assert names(linter(checks, ["speaks", "goes"], edited=(facts, more, skipping))) == []
    between = ("and then come back here", "sing a long song, and then come back here")
    (finding,) = linter(checks, ["speaks", "goes"], edited=(facts, more, skipping, between))
    assert finding.name == "uncovered: 0: sing a long song,"
    quoted = ("'goes'", "{check: goes, prompts: {0: and then come back here}}")
    assert linter(checks, ["speaks", "goes"], edited=(facts, more, quoted)) == []


def test_a_clause_ends_with_its_sentence(linter: Lint) -> None:
    lines = (
        "facts: [{fact: where, words: [kitchen]}, {fact: what, words: [hello]}]",
        "covered_by: {where: [speaks], what: [speaks]}",
        "checks:",
    )
    facts = ("checks:", "\n".join(lines))
    for said, left in (
        ("Say hello in the kitchen. Come back.", "Come back."),
        ("Come back, then go home. Say hello in the kitchen, please.", "Come back, then go home."),
        (
            'Say "hello" in the kitchen! Then, when you are done, come back.',
            "Then, when you are done, come back.",
        ),
        ("Say hello in kitchen 2. Once it is done, come back.", "Once it is done, come back."),
    ):
        prompt = ("[Say hello in the kitchen.]", f"['{said}']")
        found = linter({"speaks": SPEAKS}, ["speaks"], edited=(facts, prompt))
        assert names(found) == [f"uncovered: 0: {left}"]


def test_a_requirement_that_follows_from_several(linter: Lint) -> None:
    asks_first = 'tr.AfterFirst(goto("kitchen")).BeforeFirst(say("hello")).Exists(ask("tea", ".*"))'
    checks = {"greets": GREETS_THERE, "asks_first": asks_first}
    checks["asks"] = 'tr.ActAtFirst("kitchen", ask("tea", ".*"))'
    (finding,) = linter(checks, ["greets", "asks_first", "asks"])
    for name in ('"asks"', "world 1", '"greets" and "asks_first"'):
        assert name in finding.message
    assert linter(checks, ["asks_first", "asks"], ["greets", "asks"]) == []


def test_a_requirement_that_always_holds(linter: Lint) -> None:
    (finding,) = linter({"any": 'tr.AtLeast(say("a"), 0)'}, ["any"])
    assert '"any" in world 1' in finding.message
    assert "without" not in finding.message
    assert finding.line == 13
    checks = {"none(x)": 'tr.AtLeast(say("{x}"), 0)', "speaks": SPEAKS}
    found = linter(checks, ["speaks"], ['none("b")', "speaks"])
    assert [(one.name, one.line) for one in found if one.kind == "implied"] == [('implied: none("b")', 22)]


def test_requirements_that_take_too_long_are_undecided(linter: Lint) -> None:
    started = time.monotonic()
    findings = linter({"many": 'tr.Count(say("a"), 1000000000)', "speaks": SPEAKS}, ["many", "speaks"])
    assert names(findings) == ["undecided: world 1", "undecided: many", "undecided: speaks"]
    assert [one.line for one in findings] == [9, 14, 14]
    assert time.monotonic() - started < 10
    assert linter({"some": 'tr.Count(say("a"), 100)'}, ["some"]) == []


def test_a_check_that_nothing_requires(linter: Lint) -> None:
    (finding,) = linter({"speaks": SPEAKS, "goes": GOES}, ["speaks"])
    assert finding.name == "unused: goes"
    assert finding.line == 6
    assert linter({"speaks": SPEAKS, "goes": GOES}, ["speaks"], ["not goes", "speaks"]) == []


def test_a_check_that_no_wrong_program_trips(linter: Lint) -> None:
    checks = {"speaks": SPEAKS, "swears": 'tr.Exists(say("darn"))'}
    (finding,) = linter(checks, ["speaks", "not swears"], untripped=True)
    assert finding.name == "untripped: not swears"
    assert finding.line == 6
    swears = SOLUTIONS.replace("pass", "say('darn')")
    assert linter(checks, ["speaks", "not swears"], solutions=swears, untripped=True) == []


def test_the_number_of_programs_that_trip_nothing_is_named(linter: Lint) -> None:
    checks = {"speaks": SPEAKS, "swears": 'tr.Exists(say("darn"))'}
    (finding,) = linter(checks, ["speaks", "not swears"], untripped=True)
    assert '"not swears"' in finding.message
    assert "1 incorrect program " in finding.message
    two = (
        SOLUTIONS
        + "    - {about: goes, fails: SayAtLocation, program: 'def task_program(): go_to(\"kitchen\")'}\n"
    )
    (finding,) = linter(checks, ["speaks", "not swears"], solutions=two, untripped=True)
    assert "2 incorrect programs" in finding.message


def test_the_untripped_form_of_a_check_required_both_ways_is_named(linter: Lint) -> None:
    speaks = SOLUTIONS.replace("pass", "say('hello')")
    found = linter({"speaks": SPEAKS}, ["speaks"], ["not speaks"], solutions=speaks, untripped=True)
    (message,) = (one.message for one in found if one.kind == "untripped")
    for name in ("2 incorrect programs", '"speaks"', '"not"'):
        assert name in message


def test_a_task_without_wrong_programs(linter: Lint) -> None:
    for file in ("programs: []", SOLUTIONS.replace("pass", "say('hello')")):
        findings = linter({"speaks": SPEAKS}, ["speaks"], solutions=file, untripped=True)
        assert [one.name for one in findings if one.kind != "misjudged"] == ["untripped: Hello"]


@pytest.mark.parametrize("text", ['"a^b"', '"$x"', r'words(r"\bno\b", without("no"))', 'words("a", "(?!)")'])
def test_a_regex_that_matches_nothing(linter: Lint, text: str) -> None:
    findings = linter({"says": f"not tr.Exists(say({text}))", "speaks": SPEAKS}, ["says", "speaks"])
    assert [one.kind for one in findings] == ["dead-regex", "implied"]
    asked = linter({"asks": f'not tr.Exists(ask(".*", {text}))', "speaks": SPEAKS}, ["asks", "speaks"])
    assert [one.kind for one in asked] == ["dead-regex", "implied"]


@pytest.mark.parametrize("text", ['words("no", without("no"))', '"^a b$"', r'" 4"', '"[^a]{3}"', '"(a)b"'])
def test_a_regex_that_matches_something(linter: Lint, text: str) -> None:
    assert linter({"says": f"tr.Exists(say({text}))"}, ["says"]) == []


@pytest.mark.parametrize(
    "text",
    [
        r"(?=.*\bten\b)(?=.*\bpercent\b)(?!.*\bno\b).+",
        r"(?=.*\btea\b)(?=.*\bready\b).*",
        r"^(?=.*\bready\b)tea",
        r"\b(alice|bob)\b.*\b(alice|bob)\b",
        r"\bten\b[^.]*\bpercent\b",
        pytest.param(r"(\bten\b.?)+\bpercent\b", marks=pytest.mark.slow),
    ],
)
def test_a_regex_of_words_at_any_distance_may_only_be_slow(linter: Lint, text: str) -> None:
    found = linter({"says": f'tr.Exists(say(r"{text}"))'}, ["says"])
    assert {one.kind for one in found} <= {"slow-regex"}


@pytest.mark.parametrize("option", ["^ yes", "yes $", "^ yes $"])
def test_options_may_have_outer_spaces(linter: Lint, option: str) -> None:
    checks = {"asks": f'not tr.Exists(ask("tea", "{option}"))', "speaks": SPEAKS}
    assert linter(checks, ["asks", "speaks"]) == []
    said = linter({"says": f'not tr.Exists(say("{option}"))', "speaks": SPEAKS}, ["says", "speaks"])
    assert [one.kind for one in said] == ["dead-regex", "implied"]


@pytest.mark.slow
def test_a_regex_that_is_slow_on_long_texts(linter: Lint) -> None:
    (finding,) = linter({"greets": 'tr.Exists(say("a.*b"))'}, ["greets"])
    assert finding.name == "slow-regex: a.*b"
    assert finding.line == 5
    assert '"greets"' in finding.message
    assert not linter({"greets": 'tr.Exists(say("a[^a]*b"))'}, ["greets"])


def test_a_regex_without_words(linter: Lint) -> None:
    checks = {"greets": 'tr.Exists(say("a[^a]*b"))', "speaks": SPEAKS}
    (finding,) = linter(checks, ["greets", "speaks"], unworded=True)
    assert (finding.name, finding.line) == ("unworded: greets", 5)
    assert "means" in finding.message
    assert "[^a]" not in finding.message
    named = ("greets: {category", "greets: {means: a greeting, category")
    assert not linter(checks, ["greets", "speaks"], unworded=True, edited=[named])


def test_an_argument_without_words(linter: Lint) -> None:
    checks = {"says(number)": 'tr.Exists(say("{number}"))', "speaks": SPEAKS}
    found = linter(checks, ['says("[^a]b")', "speaks"], unworded=True)
    assert names(found) == ["unworded: says"]


def test_a_visit_that_leads_nowhere(linter: Lint) -> None:
    found = linter({"goes": 'not tr.Exists(goto("^attic$"))', "speaks": SPEAKS}, ["goes", "speaks"])
    assert [one.kind for one in found] == ["dead-regex", "absent", "implied"]
    assert "world 1" in found[0].message
    fine = linter({"goes": 'not tr.Exists(goto("^(the )?kitchen$"))', "speaks": SPEAKS}, ["goes", "speaks"])
    assert fine == []


@pytest.mark.parametrize(
    "formula",
    [
        *('goto("lobby")', 'pick("cup")', 'place("cup")', 'check("cup")', 'goto(without("lobby"))'),
        *('holding("cup", say(".*"))', 'to("lobby", ask(".*", ".*"))'),
    ],
)
def test_something_that_is_not_in_the_world(linter: Lint, formula: str) -> None:
    found = linter({"does": f"not tr.Exists({formula})", "speaks": SPEAKS}, ["speaks", "does"])
    assert [one.subject for one in found if one.kind == "absent"] == [
        f"{re.findall('lobby|cup', formula)[0]} in does"
    ]


@pytest.mark.parametrize(
    "formula",
    [
        'goto("conference")',
        'goto("the conference room")',
        'goto(".*")',
        'goto("(attic)?")',
        'pick("mug")',
        'check("red mug")',
        'check("person")',
        'check("ann")',
        'holding("mug", say(".*"))',
        'to("ann|somebody", ask(".*", ".*"))',
        'say("lobby")',
    ],
)
def test_something_that_is_in_the_world(linter: Lint, formula: str) -> None:
    found = linter({"does": f"not tr.Exists({formula})", "speaks": SPEAKS}, ["speaks", "does"])
    assert "absent" not in [one.kind for one in found]


def test_a_person_who_is_not_in_the_world(linter: Lint) -> None:
    checks = {"greets(person)": 'tr.Exists(say("{person}"))'}
    (finding,) = linter(checks, ['not greets("bob")', 'greets("ann")'])
    assert finding.name == 'absent: bob in not greets("bob")'
    assert finding.message.count('"bob"') == 2
    assert "world 1" in finding.message


def test_a_person_of_another_room_or_named_by_another_parameter(linter: Lint) -> None:
    checks = {"greets(whom)": 'tr.Exists(say("{whom}"))'}
    assert names(linter(checks, ['not greets("bob")', 'greets("Ann")'])) == []
    kitchen, office = "rooms: [kitchen,", 'rooms: ["bob\'s office", kitchen,'
    (finding,) = linter(checks, ['not greets("Bob")', 'greets("Ann")'], replaced=(kitchen, office))
    assert finding.name == 'absent: Bob in not greets("Bob")'


OWN_SKILLS = """
from codebotler import Simulation, skill

@skill(names="object")
def count_here(sim: Simulation, what: str) -> int:
    "Count things of a kind."
    ...

@skill(names="object or person")
def lead_to(sim: Simulation, person: str, room: str) -> None:
    "Lead a person to a room."
"""


def test_own_skills_may_take_descriptions_from_a_prompt(linter: Lint) -> None:
    checks = {
        "counts": 'tr.Exists(count_here("red fruits?"))',
        "hides": 'tr.Exists(count_here("coins?"))',
        "leads(person)": 'tr.Exists(lead_to("{person}", "kitchen"))',
    }
    prompt = ("Say hello in the kitchen.", "Count the red fruit and lead the waving person to the kitchen.")
    require = ["counts", 'leads("waving person")', 'leads("ann")', "hides"]
    found = linter(checks, require, edited=[prompt], skills=OWN_SKILLS)
    assert names(found) == ["absent: coins? in hides"]


def test_one_of_several_alternatives_that_is_not_in_the_world(linter: Lint) -> None:
    assert names(linter({"goes": 'tr.Exists(goto("kitchen|attic"))'}, ["goes"])) == ["absent: attic in goes"]
    assert linter({"goes": 'tr.Exists(goto("kitchen|conference room"))'}, ["goes"]) == []
    found = linter({"says": 'tr.Exists(at("kitchn", say("hello")))'}, ["says"])
    assert "absent: kitchn in says" in names(found)


@pytest.mark.parametrize(
    ("pattern", "absent"),
    [
        ("kitchen|attic|dean's office", ["attic", "dean's office"]),
        ("^(the )?attic$", ["^(the )?attic$"]),
        ("(kitchen|attic)", []),
        ("(red|blue)? kitchen", []),
        ("[|(]?kitchen", []),
        ("kitchen|", []),
    ],
)
def test_alternatives_without_a_group(linter: Lint, pattern: str, absent: list[str]) -> None:
    found = linter({"goes": f'tr.Exists(goto("{pattern}"))'}, ["goes"])
    assert [one.subject.removesuffix(" in goes") for one in found if one.kind == "absent"] == absent


@pytest.mark.parametrize(
    ("element", "absent"),
    [
        ('say("hello bob")', ["bob"]),
        ('say(words("hello", r"\\b(ann|Bob)\\b"))', ["bob"]),
        pytest.param('say(r"(?=.*bob).*")', ["bob"], marks=pytest.mark.slow),
        ('ask("is bob in?", "yes")', ["bob"]),
        ('ask("who?", "bob|ann")', ["bob"]),
        ('say("bobsleigh")', []),
        ('say("hello ann")', []),
        ('say("carol is out")', []),
        ('say("nobody")', []),
    ],
)
def test_a_person_in_a_text_who_is_in_another_world_only(
    tmp_path: Path, element: str, absent: list[str]
) -> None:
    new_task(tmp_path, "Hello")
    path = tmp_path / "tasks" / "Hello.yaml"
    text = path.read_text().replace("[kitchen, start_loc]", '[kitchen, start_loc, "carol\'s office"]')
    text = text.replace("name: kim", "name: bob")
    first, second = text.split("  - about: nobody is in the kitchen")
    second = second.replace(
        "    require:", "    people: {kitchen: [{name: ann}]}\n    require:\n      - mentions"
    )
    check = f"checks:\n  mentions: {{category: Location, rtl: {json.dumps(f'tr.Exists({element})')}}}\n"
    first = re.sub("checks:.*\n", lambda _: check, first)
    path.write_text(f"{first}  - about: nobody is in the kitchen{second}")
    suite = load_suite(str(tmp_path))
    found = lint(suite.task("Hello"), [])
    assert [one.subject for one in found if one.kind == "absent"] == [
        f"{name} in mentions" for name in absent
    ]


def test_worlds_that_cannot_be_satisfied_do_not_require_the_same(linter: Lint) -> None:
    checks = {"goes": GOES, "stays": STAYS, "speaks": SPEAKS}
    found = linter(checks, ["goes", "stays", "speaks"], ["goes", "not goes"], ["speaks"])
    assert {one.kind for one in found} == {"unsatisfiable"}


def test_worlds_of_an_ablation_that_require_the_same(linter: Lint) -> None:
    def lint_ablation(*texts: str) -> list[str]:
        require = "\n    ".join(("require: {require}", "ablation: [" + ", ".join(texts) + "]"))
        found = linter(checks, ["speaks"], ["goes"], replaced=("require: {require}", require))
        return [each.name for each in found if each.kind == "same-worlds"]

    checks = {"speaks": SPEAKS, "goes": GOES}
    assert lint_ablation("speaks") == ["same-worlds: ablation 1 and 2"]
    assert lint_ablation() == ["same-worlds: ablation 1 and 2"]


def test_worlds_that_require_the_same(linter: Lint) -> None:
    checks = {"speaks": SPEAKS, "goes": GOES}
    (finding,) = linter(checks, ["speaks", "goes"], ["speaks"], ["goes", "speaks"])
    assert (finding.name, finding.line) == ("same-worlds: 1 and 3", 25)  # World 3 begins there.
    assert linter(checks, ["speaks"], ["not speaks"], ["goes"]) == []


# --- accepting and rendering


def test_accepted_findings(linter: Lint) -> None:
    checks = {"speaks": SPEAKS, "goes": GOES}
    (finding,) = linter(checks, ["speaks"], accepted={"unused: goes": "for later"})
    assert finding.accepted == "for later"
    (still, stale) = linter(checks, ["speaks"], accepted={"unused: gone": "for later"})
    assert (still.name, still.accepted) == ("unused: goes", None)
    assert stale.name == "stale-acceptance: unused: gone"
    assert stale.line == 17


def test_rendering(linter: Lint, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    findings = linter({"speaks": SPEAKS, "goes": GOES}, ["speaks"])
    path = findings[0].path
    monkeypatch.chdir(path.parent)
    line = f"Hello.yaml:6: warning: {findings[0].message} [unused: goes]"
    assert '"goes"' in findings[0].message
    assert render(findings) == line
    accepted = replace(findings[0], accepted="for later")
    shown, more = render([*findings, accepted]).splitlines()
    assert shown == line
    assert re.search(r"^1 accepted finding .* --accepted", more)
    assert re.search(r"^2 accepted findings .* --accepted", render([accepted, accepted]))
    accepted_line = line.replace("warning", "accepted") + ": for later"
    assert render([*findings, accepted], accepted=True) == f"{line}\n{accepted_line}"
    assert render([accepted], accepted=True) == accepted_line
    assert render([], accepted=True) == render([]) == "no findings"
    monkeypatch.chdir(tmp_path / "suite0" / "solutions")
    assert render(findings).startswith(f"{path}:6: ")


# --- misjudged solutions


@pytest.mark.parametrize(
    ("solution", "named"),
    [
        ("{about: is lazy, program: 'def task_program(): 0'}", ["pass, ", "by SayAtLocation", "world"]),
        (
            "{about: is lazy, fails: Location, program: 'def task_program(): 0'}",
            ["by Location, ", "by SayAtLocation", "world"],
        ),
        (
            "{about: greets, fails: Location, program: 'def task_program(): go_to(`kitchen`); say(`hello`)'}",
            ["by Location, ", "passes"],
        ),
    ],
)
def test_a_solution_that_does_not_end_as_declared(linter: Lint, solution: str, named: list[str]) -> None:
    solutions = SOLUTIONS + f"    - {solution}\n".replace("`", '"')
    found = linter({"speaks": SPEAKS, "goes": GOES}, ["speaks", "goes"], solutions=solutions, untripped=True)
    (finding,) = (one for one in found if one.kind == "misjudged")
    assert all(name in finding.message for name in named), finding
    assert finding.path.parts[-2] == "solutions"
    assert solution.replace("`", '"') in finding.path.read_text().splitlines()[(finding.line or 0) - 1]
    assert 'by "speaks", in world 1, "' in finding.message or "passes" in named


# --- a new task


def test_a_new_task_has_no_finding_and_judges_its_programs_as_declared(tmp_path: Path) -> None:
    new_task(tmp_path, "MakeTea")
    suite = load_suite(str(tmp_path))
    task = suite.task("MakeTea")
    assert lint(task, judge_solutions(task, suite)) == []
    rows = [
        Completion(task="MakeTea", prompt=0, index=i, program=one.program)
        for i, one in enumerate(solutions(task))
    ]
    kinds = [(row["failure"] or {"kind": None})["kind"] for row in evaluate(rows, suite, workers=1)]
    assert kinds == [one.fails for one in solutions(task)] == [None, "SayAtLocation", "SayAtLocation"]


def test_a_new_task_keeps_existing_solutions(tmp_path: Path) -> None:
    path = tmp_path / "solutions" / "MakeTea.yaml"
    path.parent.mkdir()
    path.write_text("programs: []\n")
    new_task(tmp_path, "MakeTea")
    assert path.read_text() == "programs: []\n"


FACTS = "prompts: [Say hello in the kitchen.]\nfacts: [{fact: where, words: [%s], commonsense: %s}]\n"


@pytest.mark.parametrize(
    ("word", "commonsense", "named"),
    [
        ("Kitchen", "false", None),
        ("lab", "true", None),
        ("lab", "false", ["prompt 0", '"where"']),
        ("kit.hen", "true", ["prompt 0", '"where"', '"kit.hen"', "common sense"]),
    ],
)
def test_a_fact_that_a_prompt_does_not_say(
    tmp_path: Path, word: str, commonsense: str, named: list[str] | None
) -> None:
    path = new_task(tmp_path, "MakeTea")
    head, _, _ = path.read_text().partition("prompts:")
    _, _, rest = path.read_text().partition("checks:")
    path.write_text(head + FACTS % (word, commonsense) + "checks:" + rest)
    task = load_suite(tmp_path).task("MakeTea")
    found = [one for one in lint(task, []) if one.kind == "unsaid"]
    assert [one.name for one in found] == ["unsaid: where"] * (named is not None)
    assert all(name in one.message for one in found for name in named or [])
    assert all(path.read_text().splitlines()[(one.line or 0) - 1].startswith("facts:") for one in found)
    borrowed = task.facts[0].model_copy(update={"fact": "lent", "words": ("attic",)})
    assert [
        one for one in lint(replace(task, facts=(borrowed, *task.facts)), []) if one.kind == "unsaid"
    ] == found


# --- random worlds

NAMES = [f"{letter}am" for letter in "bcdfghjklmnprtwz"]
DRAWN = f"""
name: Hello
summary: Greet everybody by name.
prompts: [Say hello to everybody by name.]
worlds:
  robot: hall
  rooms: [lab, hall]
  people: {{pat: {{in: [lab, nowhere]}}}}
let:
  names: "{NAMES}"
checks:
  greets(name):
    category: SayAtLocation
    rtl: tr.Exists(say("{{name}}"))
  may_choose(name):
    category: AskAtLocation
    rtl: tr.Exists(mention("{{name}}"))
  speaks:
    category: SayAtLocation
    rtl: tr.Exists(say("am"))
require:
  - greets(n) for n in names
  - may_choose(n) for n in names
  - speaks
"""


@pytest.fixture
def one_minute_limit() -> Iterator[None]:
    """Fail a test that would run for hours."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it has not ended after a minute"))
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("one_minute_limit")
def test_only_a_few_requirements_from_one_line_are_checked(tmp_path: Path) -> None:
    (tmp_path / "tasks").mkdir()
    (tmp_path / "suite.yaml").write_text("name: mine\nversion: 1\nworlds: 2\nseed: 1\n")
    (tmp_path / "tasks" / "Hello.yaml").write_text(DRAWN)
    findings = [one for one in lint(load_suite(str(tmp_path)).task("Hello"), []) if one.kind != "untripped"]
    assert names(findings) == ["implied: speaks"]
