"""The guard of house rules stops every forbidden action, and no program gets past it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Event, Option, Outcome, Status, Trace
from codebotler.core.world import Person, Room, World
from codebotler.rtl import Formula, holds, parse
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard, name_of
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot

WORLD = World(
    (
        Room("hall", ("mug", "glass"), (Person("ann", ("yes",)),)),
        Room("office", (), (Person("carol", ("no",)),)),
        Room("vault"),
        Room("vault room 2"),
    ),
    "hall",
)
AS_WRITTEN = SimulationSettings(literals="as-written")


def rule(formula: str, *, refuse: bool = False, name: str = "house") -> Rule:
    return Rule(name, "Do as the house wants.", parse(formula), refuse=refuse)


VAULT = rule(r'not tr.Exists(goto("vault"))', name="vault")
QUIET = rule('not tr.AtLeast(say(".*"), 3)', name="quiet")
KNOCK = rule(
    'not tr.Last(goto("office")) or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))'
)


def robot(*rules: Rule) -> SimulatedRobot:
    return SimulatedRobot(WORLD, AS_WRITTEN, guard=RuleGuard(rules))


def violate(guarded: SimulatedRobot, skill: str, *arguments: str | tuple[Option, ...]) -> RuleViolationError:
    before = guarded.trace
    with pytest.raises(RuleViolationError) as caught:
        guarded.perform(skill, arguments)
    assert guarded.trace == before or caught.value.is_late
    return caught.value


# --- judgements


def test_forbidden_action_is_not_done() -> None:
    one = robot(VAULT)
    one.perform("go_to", ["office"])
    error = violate(one, "go_to", "the vault")
    assert (one.room, error.kind, error.ends_run) == ("office", "RuleViolation", True)
    assert str(error) == 'the rule "vault" forbids going to "the vault": Do as the house wants'


def test_rule_applies_to_every_room_that_a_request_may_mean() -> None:
    one = robot(rule('not tr.Exists(goto("room 2"))'))
    one.perform("go_to", ["vault"])
    violate(one, "go_to", "the vault room 2")  # although the robot would drive to "vault"
    violate(robot(VAULT), "go_to", "the office, not the vault")


def test_rule_applies_to_the_recorded_name_of_a_thing() -> None:
    world = World((Room("hall", ("cup|mug",)),), "hall")
    as_happened = SimulationSettings(literals="as-written", events="as-happened")
    for formula in ('not tr.Exists(pick("cup"))', 'not tr.Exists(place("cup"))'):
        one = SimulatedRobot(world, as_happened, guard=RuleGuard([rule(formula)]))
        if "place" in formula:
            one.perform("pick", ["mug"])
        error = violate(one, "place" if "place" in formula else "pick", "mug")
        assert not error.is_late


def test_rule_stops_an_attempt_that_would_fail() -> None:
    one = robot(rule('not tr.Exists(pick("crown"))'))
    violate(one, "pick", "crown")
    with pytest.raises(RobotError, match='no "cup"'):
        one.perform("pick", ["cup"])


@pytest.mark.parametrize("spelling", ["crown  jewel", "crown\u00a0jewel", " crown\u2028jewel"])
def test_white_space_evades_no_rule(spelling: str) -> None:
    violate(robot(rule('not tr.Exists(pick("crown jewel"))')), "pick", spelling)
    violate(robot(rule('not tr.Exists(say("crown jewel"))')), "say", spelling)
    violate(robot(rule(f"not tr.Exists(say({spelling.strip()!r}))")), "say", spelling)


def test_white_space_in_the_name_of_a_room_evades_no_rule() -> None:
    world = World((Room("hall"), Room("tea  kitchen")), "hall")
    one = SimulatedRobot(world, guard=RuleGuard([rule('not tr.Exists(at("tea kitchen", say(".*")))')]))
    one.perform("go_to", ["tea  kitchen"])
    violate(one, "say", "hello")


def test_rule_may_require_an_earlier_action_each_time() -> None:
    one = robot(KNOCK)
    violate(one, "go_to", "office")
    one.perform("say", ["knock knock"])
    one.perform("go_to", ["office"])
    one.perform("go_to", ["hall"])
    violate(one, "go_to", "office")


def test_rule_may_depend_on_the_held_thing_and_the_addressee() -> None:
    one = robot(rule('not tr.Exists(holding("glass", goto(without("hall"))))'))
    one.perform("go_to", ["hall"])
    one.perform("pick", ["glass"])
    violate(one, "go_to", "office")
    one.perform("place", ["glass"])
    one.perform("go_to", ["office"])
    other = robot(rule('not tr.Exists(to("carol", ask(".*", ".*")))'))
    other.perform("ask", ["ann", "Tea?", (Option("yes"),)])
    violate(other, "ask", "Carol", "Tea?", (Option("yes"),))


def test_rule_about_results_is_late_unless_every_result_breaks_it() -> None:
    one = robot(rule('not tr.Exists(missed("mug"))'))
    assert one.perform("is_in_room", ["mug"]) is True
    one.perform("go_to", ["vault"])
    error = violate(one, "is_in_room", "mug")
    assert error.is_late
    assert error.ends_run
    both = rule('not tr.Exists(missed("mug")) and not tr.Exists(found("mug"))')
    assert not violate(robot(both), "is_in_room", "mug").is_late  # every result breaks this rule
    answered = robot(rule('not tr.Exists(answered("yes"))'))
    assert violate(answered, "ask", "ann", "Tea?", (Option("yes"), Option("no"))).is_late
    assert not violate(
        robot(rule('not tr.Exists(answered("yes"))')), "ask", "ann", "?", (Option("yes"),)
    ).is_late


def test_rule_about_a_regex_room_compares_the_words_of_the_request() -> None:
    world = World((Room("hall"), Room("lab [0-9]", ("knife",))), "hall")

    def guard_with(formula: str) -> SimulatedRobot:
        return SimulatedRobot(world, AS_WRITTEN, guard=RuleGuard([rule(formula)]))

    for formula in (
        'not tr.Exists(at("lab 3", pick(".*")))',
        'not tr.Exists(at("^lab 3$", pick(".*")))',
        'not tr.OnlyAfterLast(goto("lab 3")).Exists(pick(".*"))',
        'not tr.OnlyAfterLast(goto("^lab 3$")).Exists(pick(".*"))',
    ):
        three, four = guard_with(formula), guard_with(formula)
        three.perform("go_to", ["lab 3"])
        assert not violate(three, "pick", "knife").is_late
        four.perform("go_to", ["lab 4"])
        four.perform("pick", ["knife"])


def test_rule_compares_the_own_name_of_a_room() -> None:
    for formula in (
        'not tr.OnlyAfterLast(goto("^vault$")).Exists(say(".*"))',
        'not tr.Exists(at("^vault$", say(".*")))',
    ):
        one = robot(rule(formula))
        one.perform("go_to", ["the vault, please"])
        violate(one, "say", "hello")


@pytest.mark.parametrize(
    ("formula", "skill", "request_"),
    [
        ('not tr.OnlyAfterFirst(pick("^mug$")).Exists(goto(".*"))', "go_to", "office"),
        ('not tr.OnlyAfterFirst(holding("^mug$", say(".*"))).Exists(goto(".*"))', "go_to", "office"),
        ('not tr.Exists(holding("^mug$", goto(".*")))', "go_to", "office"),
        ('not tr.Exists(place("^mug$"))', "place", "the mug"),
    ],
)
def test_rule_compares_the_own_name_of_a_thing(formula: str, skill: str, request_: str) -> None:
    one = robot(rule(formula))
    one.perform("pick", ["the mug"])
    one.perform("say", ["I have it"])
    assert not violate(one, skill, request_).is_late


def test_rule_compares_the_request_of_a_failed_drive() -> None:
    one = robot(rule('not tr.OnlyAfterFirst(goto("^the attic$")).Exists(say(".*"))'))
    with pytest.raises(RobotError, match="attic"):
        one.perform("go_to", ["the attic"])
    violate(one, "say", "hello")


@pytest.mark.parametrize(
    ("label", "request_", "name"),
    [
        ("lab 2", "the lab 2, please", "lab 2"),
        ("kitchen", "k\u0131tchen", "kitchen"),
        ("lab (2)", "the Lab (2)", "lab (2)"),
        ("lab [0-9]", "lab 3", "lab 3"),
        ("cup|mug", "mug", "mug"),
        ("lab [0-9]", "", "lab [0-9]"),
    ],
)
def test_name_is_that_of_the_label_unless_it_is_a_regex(label: str, request_: str, name: str) -> None:
    assert name_of(label, request_) == name


AS_HAPPENED = SimulationSettings(literals="as-written", events="as-happened")


@pytest.mark.parametrize(
    ("settings", "name"),
    [(AS_WRITTEN, "^mug$"), (AS_HAPPENED, "^cup[|]mug$")],
    ids=["as-requested", "as-happened"],
)
def test_rule_about_a_regex_thing_compares_the_recorded_name(settings: SimulationSettings, name: str) -> None:
    world = World((Room("hall", ("cup|mug",)), Room("office")), "hall")

    def guard_with(formula: str) -> SimulatedRobot:
        return SimulatedRobot(world, settings, guard=RuleGuard([rule(formula)]))

    assert not violate(guard_with(f'not tr.Exists(pick("{name}"))'), "pick", "mug").is_late
    for formula, skill, request in (
        (f'not tr.OnlyAfterFirst(pick("{name}")).Exists(say(".*"))', "say", "I have it"),
        (f'not tr.Exists(holding("{name}", goto(".*")))', "go_to", "office"),
        (f'not tr.Exists(place("{name}"))', "place", "mug"),
    ):
        one = guard_with(formula)
        one.perform("pick", ["mug"])
        assert not violate(one, skill, request).is_late


def test_without_matches_a_room_if_none_of_its_names_has_the_word() -> None:
    world = World((Room("hall"), Room("lab [0-9]")), "hall")
    one = SimulatedRobot(world, AS_WRITTEN, guard=RuleGuard([rule('not tr.Exists(goto(without("lab 3")))')]))
    one.perform("go_to", ["lab 3"])
    violate(one, "go_to", "lab 4")


@pytest.mark.parametrize("settings", [AS_WRITTEN, AS_HAPPENED], ids=["as-requested", "as-happened"])
def test_failed_drive_counts_for_rules(settings: SimulationSettings) -> None:
    one = SimulatedRobot(WORLD, settings, guard=RuleGuard([rule('not tr.AtLeast(goto(".*"), 2)')]))
    with pytest.raises(RobotError, match="attic"):
        one.perform("go_to", ["attic"])
    violate(one, "go_to", "office")


OWN_SKILLS = """
from codebotler import Simulation, skill

@skill(verb="go to {room} by the vault", names="room")
def go_by(sim: Simulation, room: str) -> None:
    "Go to a room through the vault."
    sim.drive("vault")
    sim.drive(room)
    sim.record("say", "here I am")

@skill(verb="hop to {room}", names="room", event=None)
def hop_to(sim: Simulation, room: str) -> None:
    "Hop to a room."
    sim.drive(room)

@skill(verb="swap a glass for {what}", names="object")
def swap_for(sim: Simulation, what: str) -> None:
    "Put a glass down, and pick something up."
    sim.take("glass")
    sim.put("glass")
    sim.take(what)
"""


@pytest.mark.parametrize("settings", [AS_WRITTEN, AS_HAPPENED], ids=["as-requested", "as-happened"])
@pytest.mark.parametrize(
    ("calls", "formula", "breaks"),
    [
        (["go_by office"], 'not tr.Exists(goto("vault"))', True),
        (["go_by office"], 'not tr.Exists(say("here"))', True),
        (["go_by office"], 'not tr.Exists(at("office", say(".*")))', True),
        (["go_by office"], 'not tr.Exists(at("hall", say(".*")))', False),
        (["go_by office"], 'not tr.Exists(at("hall", goto("office")))', False),
        (["go_by office"], 'not tr.Exists(at("vault", goto("office")))', True),
        (["hop_to vault", "say hello"], 'not tr.Exists(at("vault", say(".*")))', True),
        (["hop_to vault"], 'not tr.Exists(goto("vault"))', True),
        (["go_to vault", "hop_to office", "say hello"], 'not tr.Exists(at("vault", say(".*")))', False),
        (["swap_for mug"], 'not tr.Exists(pick("glass"))', True),
        (["swap_for mug"], 'not tr.AtLeast(pick("mug"), 2)', False),
        (["swap_for mug", "go_to office"], 'not tr.Exists(holding("mug", goto(".*")))', True),
    ],
)
def test_rules_apply_inside_own_skills(
    tmp_path: Path, settings: SimulationSettings, calls: list[str], formula: str, *, breaks: bool
) -> None:
    (tmp_path / "own.py").write_text(OWN_SKILLS)
    skills = skills_from(tmp_path / "own.py")
    guard = RuleGuard([Rule("own", "So it is.", parse(formula, skills=skills))])
    one = SimulatedRobot(WORLD, settings, skills, guard=guard)
    *first, (skill, _, argument) = (call.partition(" ") for call in calls)
    for name, _, given_ in first:
        one.perform(name, [given_])
    if breaks:
        with pytest.raises(RuleViolationError):
            one.perform(skill, [argument])
    else:
        one.perform(skill, [argument])


SWITCHES = """
from codebotler import Simulation, skill

@skill(sets="on", fails={"Stuck": "it is stuck"})
def turn_on(sim: Simulation, device: str) -> None:
    "Turn on a device."
    if device == "old stove":
        sim.fail("Stuck")

@skill(clears="on", fails={"Stuck": "it is stuck"})
def turn_off(sim: Simulation, device: str) -> None:
    "Turn off a device."
    if device == "stove, stuck":
        sim.fail("Stuck")

@skill(names="room")
def glide_to(sim: Simulation, room: str) -> None:
    "Glide to a room."

@skill(event=None)
def patrol(sim: Simulation) -> None:
    "Visit a room."
    sim.drive("office")
"""
ON, OFF = ("turn_on", "stove"), ("turn_off", "stove")


@pytest.fixture(scope="module")
def switches(tmp_path_factory: pytest.TempPathFactory) -> SkillTable:
    path = tmp_path_factory.mktemp("switches") / "switches.py"
    path.write_text(SWITCHES)
    return skills_from(path)


def stove_off_rule(skills: SkillTable, *, refuse: bool = False) -> Rule:
    formula = parse('not on("stove")', skills=skills)
    return Rule("off", "Turn off the stove before you leave.", formula, "leaving", refuse)


@pytest.mark.parametrize(
    ("calls", "breaks"),
    [
        ([("go_to", "office")], False),
        ([ON, ("go_to", "office")], True),
        ([ON, ("go_to", "attic")], True),
        ([ON, OFF, ("go_to", "office")], False),
        ([ON, ("say", "hello"), ("pick", "mug")], False),
        ([ON, ("go_to", "Hall")], False),
        ([("go_to", "office"), ON, ("go_to", "office")], False),
        ([("go_to", "office"), ON, ("go_to", "hall")], True),
        ([ON, ("glide_to", "office")], True),
        ([ON, ("patrol",)], True),
        ([ON, OFF, ("patrol",)], False),
        ([("turn_on", "old stove"), ("go_to", "office")], True),
        ([ON, ("turn_off", "stove, stuck"), ("go_to", "office")], True),
    ],
)
def test_leaving_rule_stops_each_drive_out_of_a_room(
    switches: SkillTable, calls: list[tuple[str, ...]], *, breaks: bool
) -> None:
    one = SimulatedRobot(WORLD, AS_WRITTEN, switches, guard=RuleGuard([stove_off_rule(switches)]))
    *first, (skill, *arguments) = calls
    for name, *given_ in first:
        with suppress(RobotError):
            one.perform(name, given_)
    if breaks:
        assert not violate(one, skill, *arguments).is_late
    else:
        one.perform(skill, arguments)


def test_inconclusive_leaving_rule_is_broken() -> None:
    kept = Rule("tea", "No tea.", parse('not tr.Exists(ask("tea", "^no$"))'), "leaving")
    guard = RuleGuard([kept])
    one = SimulatedRobot(WORLD, AS_WRITTEN, guard=guard)
    one.perform("ask", ["ann", "tea?", (Option("1", is_text=False), Option("yes"))])
    violate(one, "go_to", "office")
    assert guard.find_first_unkept() is not None


@pytest.mark.parametrize("calls", [[ON], [ON, OFF]])
def test_leaving_rule_must_hold_at_the_end(switches: SkillTable, calls: list[tuple[str, str]]) -> None:
    guard = RuleGuard([stove_off_rule(switches)])
    one = SimulatedRobot(WORLD, AS_WRITTEN, switches, guard=guard)
    for name, argument in calls:
        one.perform(name, [argument])
    assert (guard.find_first_unkept() is None) is (OFF in calls)


def test_program_may_catch_the_refusal_of_a_leaving_rule(worker: Worker, switches: SkillTable) -> None:
    program = (
        "def task_program():\n    turn_on('stove')\n    try: go_to('office')\n"
        "    except Exception: turn_off('stove')\n    go_to('office')\n"
    )
    guard = RuleGuard([stove_off_rule(switches, refuse=True)])
    assert guard.may_refuse
    new_robot = partial(SimulatedRobot, WORLD, AS_WRITTEN, switches, guard=guard)
    outcome = worker.run_alone(program, new_robot)
    assert [event.kind for event in outcome.trace] == ["turn_on", "turn_off", "goto"]
    assert outcome.status is Status.FINISHED


FORMULAS = (
    r'not tr.Exists(goto("vault"))',
    'not tr.AtLeast(say(".*"), 2)',
    'not tr.Exists(holding("glass", goto("office")))',
    'not tr.Exists(to("carol", ask(".*", ".*")))',
    'not tr.Last(goto("office")) or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))',
    'tr.OnlyAfterFirst(pick("mug")).Exists(say("done")) or not tr.Last(goto("office"))',
)
WORK_SKILL = """
from codebotler import Simulation, skill

@skill(when_tried={tried})
def work(sim: Simulation, steps: list[str], stubborn: bool) -> None:
    "Do some steps."
    for step in steps:
        what, _, text = step.partition(" ")
        try:
            if what == "ask":
                sim.ask("", text, ["Yes ", "no"])
            else:
                getattr(sim, what)(text)
        except Exception:
            if not stubborn:
                raise
"""
STEPS = ("drive office", "drive vault", "drive attic", "take mug", "put mug", "look glass", "ask Tea?")
WORK_FORMULAS = (
    *FORMULAS,
    'not tr.Exists(at("office", ask(".*", ".*")))',
    'not tr.Exists(holding("mug", goto("office")))',
    'not tr.OnlyAfterFirst(answered("^yes$")).Exists(goto(".*"))',
    'not tr.AtLeast(missed("glass"), 2)',
    'not tr.Last(pick("mug")) or tr.BeforeLast(pick("mug")).Exists(found("glass"))',
)


@pytest.mark.parametrize("tried", [False, True])
@given(
    steps=st.lists(st.sampled_from(STEPS), max_size=7),
    formula=st.sampled_from(WORK_FORMULAS),
    stubborn=st.booleans(),
)
def test_rule_stops_an_own_skill_before_the_event_that_breaks_it(
    own_work: dict[bool, SkillTable], steps: list[str], formula: str, *, stubborn: bool, tried: bool
) -> None:
    skills = own_work[tried]
    free = SimulatedRobot(WORLD, AS_WRITTEN, skills)
    one = SimulatedRobot(WORLD, AS_WRITTEN, skills, guard=RuleGuard([rule(formula)]))
    kept = parse(formula)
    for robot_ in (free, one):
        with suppress(RobotError):
            robot_.perform("work", [tuple(steps), stubborn])
    broken = find_violation(kept, free.trace)
    if broken is None:
        assert one.trace == free.trace
        return
    assert one.trace[: broken - 1] == free.trace[: broken - 1]
    inside = [event for event in one.trace if event.kind != "work" or tried]
    if "missed" in formula:  # only the result breaks this rule
        assert len(inside) == broken
    else:
        assert stubborn or len(one.trace) == broken - 1
        assert find_violation(kept, one.trace) in {None, len(inside)}


def find_violation(kept: Formula, trace: Trace) -> int | None:
    """Return the number of events after which a rule is broken, if it is, with stripped answers."""
    seen = tuple(replace(event, answer=event.answer and event.answer.strip()) for event in trace)
    return next((n for n in range(len(seen) + 1) if not holds(kept, seen[:n])), None)


@pytest.fixture(scope="module")
def own_work(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, SkillTable]:
    folder = tmp_path_factory.mktemp("work")
    for tried in (False, True):
        (folder / f"work_{tried}.py").write_text(WORK_SKILL.format(tried=tried))
    return {tried: skills_from(folder / f"work_{tried}.py") for tried in (False, True)}


def test_rule_ends_the_run_even_if_the_skill_continues(own_work: dict[bool, SkillTable]) -> None:
    guard = RuleGuard([VAULT])
    one = SimulatedRobot(WORLD, AS_WRITTEN, own_work[False], guard=guard)
    with pytest.raises(RuleViolationError) as caught:
        one.perform("work", [("drive office", "drive vault", "drive hall"), True])
    assert not caught.value.is_late
    assert "vault" not in {event.text for event in one.trace}


def test_rule_that_ends_the_run_precedes_one_that_refuses() -> None:
    soft = rule('not tr.Exists(goto("vault"))', refuse=True)
    hard = rule('not tr.Exists(goto("vault"))')
    for rules in ((soft, hard), (hard, soft)):
        assert violate(robot(*rules), "go_to", "vault").rule is hard


def test_program_cannot_forge_a_violation(worker: Worker) -> None:
    program = "class RuleViolation(Exception): pass\ndef task_program(): raise RuleViolation('the vault')\n"
    outcome = run(worker, program, [VAULT])
    assert outcome.error is not None
    assert (outcome.status, outcome.error.kind) == (Status.PYTHON_ERROR, "Exception")


def test_option_that_is_not_text_is_refused() -> None:
    one = robot(rule('not tr.Exists(ask("tea", "^no$"))'))
    error = violate(one, "ask", "ann", "tea?", (Option("1", is_text=False),))
    message = 'the rule "vault" cannot judge asking "tea?", which offers an option that is not text: '
    assert str(error).startswith(message.replace("vault", error.rule.name))


@pytest.mark.parametrize(
    ("pattern", "option", "means_no"),
    [
        *(("^no$", option, True) for option in ("no", "No ", "\tNO\n", "\u00a0no")),
        *(
            (r"^\W*no\b", option, True)
            for option in ("no", " No", "No.", "NO!", "No, thank you", "No - later")
        ),
        *((r"^\W*no\b", option, True) for option in ('"No"', "- no", "(no)", "\u200bno", "no\nthanks")),
        *((r"^\W*no\b", option, False) for option in ("yes", "Yes, no sugar", "Nobody", "not today", "Noah")),
    ],
)
def test_pattern_for_no_matches_every_spelling(pattern: str, option: str, *, means_no: bool) -> None:
    world = World((Room("hall", (), (Person("ann", (1,)),)),), "hall")
    formula = f'not tr.OnlyAfterFirst(answered(r"{pattern}")).Exists(mention(".*"))'
    one = SimulatedRobot(world, AS_WRITTEN, guard=RuleGuard([rule(formula)]))
    one.perform("ask", ["ann", "Tea?", (Option(option), Option("maybe"))])
    if means_no:
        violate(one, "ask", "ann", "Really?", (Option("yes"),))
    else:
        one.perform("ask", ["ann", "Really?", (Option("yes"),)])


def test_guide_shows_the_pattern_for_no() -> None:
    guide = Path(__file__).parents[3] / "docs" / "house-rules.md"
    assert r'answered(r"^\W*no\b")' in guide.read_text(encoding="utf-8")


def test_rules_ignore_blanks_around_options_and_names() -> None:
    for formula in ('ask(".*", "^no$")', 'mention("^no$")', 'to("^ann$", mention(".*"))'):
        one = robot(rule(f"not tr.Exists({formula})"))
        assert not violate(one, "ask", " Ann ", "Tea?", (Option("yes"), Option("no "))).is_late


def test_rule_about_the_end_is_judged_at_the_end() -> None:
    report = Rule("report", "Report.", parse('tr.Exists(say("done"))'), "finally")
    guard = RuleGuard([report])
    assert str(guard.find_first_unkept()) == 'the rule "report" is not kept at the end: Report'
    guard.judge_result(Event("say", "done"))
    assert guard.find_first_unkept() is None


# --- in the engine


@pytest.fixture(scope="module", params=[False, True], ids=["batches", "one process per run"])
def worker(request: pytest.FixtureRequest) -> Iterator[Worker]:
    worker = Worker(one_process_per_run=request.param)
    yield worker
    worker.close()


@pytest.fixture(scope="module")
def fork_worker() -> Iterator[Worker]:
    worker = Worker(one_process_per_run=True)
    yield worker
    worker.close()


def run(worker: Worker, program: str, rules: Sequence[Rule]) -> Outcome:
    return worker.run(program, partial(robot, *rules))


def test_broken_rule_ends_the_run(worker: Worker) -> None:
    program = "def task_program():\n    go_to('office')\n    go_to('vault')\n    say('there')\n"
    outcome = run(worker, program, [VAULT])
    assert outcome.error is not None
    assert (outcome.status, outcome.error.kind, outcome.line) == (Status.ROBOT_ERROR, "RuleViolation", 3)
    assert [event.text for event in outcome.trace] == ["office"]


@pytest.mark.parametrize(
    "rest",
    [
        "    except BaseException: say('again')",
        "    except BaseException: pass",
        "    finally:\n      for n in range(9): pass",
    ],
)
def test_line_is_that_of_the_call_even_if_the_program_continues(worker: Worker, rest: str) -> None:
    program = f"def task_program():\n    try:\n        go_to('vault')\n{rest}\n    say('done')\n"
    outcome = run(worker, program, [VAULT])
    assert outcome.error is not None
    assert (outcome.error.kind, outcome.line, outcome.trace) == ("RuleViolation", 3, ())


def test_program_may_catch_a_refusal(worker: Worker) -> None:
    program = "def task_program():\n    try: go_to('vault')\n    except Exception as e: say(str(e))\n"
    outcome = run(worker, program, [rule('not tr.Exists(goto("vault"))', refuse=True)])
    assert outcome.status is Status.FINISHED
    assert [event.kind for event in outcome.trace] == ["say"]
    assert 'forbids going to "vault"' in outcome.trace[0].text


def test_broken_rule_about_the_end_is_reported(worker: Worker) -> None:
    report = Rule("report", "Report.", parse('tr.Exists(say("done"))'), "finally")
    for said, kind in (("done", None), ("hello", "RuleViolation")):
        outcome = run(worker, f"def task_program():\n    say('{said}')\n", [report])
        assert (outcome.error and outcome.error.kind) == kind
        assert len(outcome.trace) == 1


def test_remembered_calls_are_judged_by_rules(worker: Worker) -> None:
    program = "def task_program():\n    for _ in range(300): say('a')\n"
    outcome = run(worker, program, [rule('not tr.AtLeast(say("a"), 200)')])
    assert len(outcome.trace) == 199


SKILLS = {
    "go_to": st.sampled_from(["hall", "office", "vault"]).map(lambda room: f"go_to({room!r})"),
    "say": st.sampled_from(["knock", "done"]).map(lambda text: f"say({text!r})"),
    "pick": st.sampled_from(["mug", "glass", "crown"]).map(lambda thing: f"pick({thing!r})"),
    "look": st.sampled_from(["mug", "ann"]).map(lambda thing: f"is_in_room({thing!r})"),
    "ask": st.sampled_from(["ann", "carol"]).map(lambda who: f"ask({who!r}, 'Tea?', ['yes', 'no'])"),
}


@given(
    calls=st.lists(st.one_of(*SKILLS.values()), max_size=8),
    formula=st.sampled_from(FORMULAS),
    caught=st.booleans(),
)
def test_run_ends_exactly_where_a_prefix_breaks_the_rule(
    worker: Worker, calls: list[str], formula: str, *, caught: bool
) -> None:
    body = [f"try: {call}\n    except Exception: pass" if caught else call for call in calls] or ["pass"]
    program = "def task_program():\n" + "".join(f"    {line}\n" for line in body)
    free = worker.run(program, partial(SimulatedRobot, WORLD, AS_WRITTEN))
    kept = parse(formula)
    broken = next((n for n in range(len(free.trace) + 1) if not holds(kept, free.trace[:n])), None)
    outcome = run(worker, program, [rule(formula)])
    if broken is None and not (outcome.error and outcome.error.kind == "RuleViolation"):
        assert (outcome, outcome.trace) == (free, free.trace)
    else:  # an attempt without an event may also break the rule
        assert outcome.error is not None
        assert outcome.error.kind == "RuleViolation"
        assert outcome.trace == free.trace[: len(outcome.trace)]
        assert broken is None or len(outcome.trace) < broken


# --- programs that try to continue

RULE_BREAKERS: dict[str, str] = yaml.safe_load(Path(__file__).with_name("rule_breakers.yaml").read_text())


@pytest.mark.parametrize("body", RULE_BREAKERS.values(), ids=RULE_BREAKERS)
@pytest.mark.parametrize("refuse", [False, True], ids=["ends", "refuses"])
def test_no_program_breaks_a_rule(worker: Worker, body: str, *, refuse: bool) -> None:
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    forbidden = rule('not tr.Exists(goto("vault"))', refuse=refuse)
    outcome = run(worker, f"def task_program():\n{lines}", [forbidden, QUIET])
    assert not [event for event in outcome.trace if event.kind == "goto" and "vault" in event.text.lower()]
    assert refuse or outcome.error is not None or "atexit" in body  # nothing runs that function


@pytest.mark.parametrize(
    "path", sorted((Path(__file__).parents[2] / "hostile").glob("backdoors_*.py")), ids=lambda path: path.stem
)
def test_no_backdoor_bypasses_a_rule(fork_worker: Worker, path: Path) -> None:
    program = path.read_text().replace("@", "x")
    outcome = run(fork_worker, program, [rule('not tr.Exists(goto(".*")) and not tr.Exists(say(".*"))')])
    assert not [event for event in outcome.trace if event.kind in {"goto", "say"}]
    if "\n# does: " in program:  # without the rule, it would go somewhere or speak
        assert outcome.error is not None
        assert outcome.error.kind == "RuleViolation"
