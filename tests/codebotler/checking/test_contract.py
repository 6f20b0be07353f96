"""A contract allows everything that a program does in any world, and little else."""

import unicodedata
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.checking.check import check, with_contract_problems
from codebotler.checking.contracts.file import contract_from, contract_yaml, read_contract
from codebotler.checking.contracts.text import contract_rows, contract_sentence
from codebotler.checking.problems import CheckResult
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import ValueType
from codebotler.core.text.text_template import ANY_TEXT, TextTemplate
from codebotler.rtl import parse
from codebotler.simulator.guard.contract import Contract, RequestedCall, SkillBound
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worlds.room_map import RoomMap

ROOMS = RoomMap(("start_loc", "printer room 1", "printer room 2", "café", "lab"), "start_loc", plain=True)
PRINTERS = """
def task_program():
    missing = []
    for room in get_all_rooms():
        if "printer" in room:
            go_to(room)
            if not is_in_room("stapler"):
                missing.append(room)
    go_to("start_loc")
    say(f"There is no stapler in {', '.join(missing)}")
"""
BRING = """
def task_program():
    go_to("lab")
    if ask("Ann", "Coffee?", ["yes", "no"]) == "yes":
        go_to("café")
        pick("coffee")
        go_to("lab")
        place("coffee")
"""


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as started:
        yield started


@pytest.fixture
def contracts(pool: WorkerPool) -> "Contracts":
    return Contracts(pool)


class Contracts:
    """Derives contracts of programs."""

    def __init__(self, pool: WorkerPool) -> None:
        self.pool = pool

    def check(self, program: str, *rules: Rule) -> CheckResult:
        return check(program, room_map=ROOMS, pool=self.pool, house_rules=rules, explores=True)

    def __call__(self, program: str) -> Contract:
        contract = self.check(program).contract
        assert contract is not None
        return contract


def texts_of(contract: Contract, skill: str) -> dict[str, list[str]]:
    """Return the texts that a contract allows for each argument of a skill."""
    texts = contract.skills[skill].texts
    return {name: [*map(str, some)] for name, some in texts}


def test_contract_allows_the_rooms_that_the_program_may_enter(contracts: Contracts) -> None:
    contract = contracts(PRINTERS)
    assert set(texts_of(contract, "go_to")["location"]) == {
        "printer room 1",
        "printer room 2",
        "start_loc",
    }
    assert texts_of(contract, "say") == {"message": ["There is no stapler in {}"]}
    assert texts_of(contract, "is_in_room") == {"entity": ["stapler"]}
    assert contract.skills["go_to"].at_most == 3
    assert set(contract.skills) == {"go_to", "is_in_room", "say"}
    assert not contract.objection(RequestedCall("get_all_rooms", ()))


def test_contract_limits_where_things_are_picked_up_and_put_down(contracts: Contracts) -> None:
    contract = contracts(BRING)
    assert contract.skills["pick"].places == ("café",)
    assert contract.skills["place"].places == ("lab",)
    assert texts_of(contract, "ask") == {"person": ["Ann"], "question": ["Coffee?"], "options": ["no", "yes"]}


def test_incomplete_exploration_allows_anything(
    contracts: Contracts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.checking.exploration.MAX_RUNS", 1)
    contract = contracts(PRINTERS)
    assert texts_of(contract, "go_to") == {"location": ["{}"]}
    assert texts_of(contract, "is_in_room") == {"entity": ["stapler"]}
    assert contract.skills["go_to"].at_most is None
    assert "any room" in contract_sentence(contract, SKILLS)


def test_texts_that_depend_on_the_clock_are_unbounded(contracts: Contracts) -> None:
    contract = contracts("import datetime\ndef task_program():\n    say(str(datetime.datetime.now()))\n")
    assert texts_of(contract, "say") == {"message": ["{}"]}


@pytest.mark.parametrize("limit", ["MAX_TEXTS", "MAX_CHARACTERS"])
def test_more_texts_than_a_person_reads_are_unbounded(
    contracts: Contracts, monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    program = "def task_program():\n    for number in range(4):\n        say(''.join(['a', str(number)]))\n"
    assert len(texts_of(contracts(program), "say")["message"]) == 4
    monkeypatch.setattr(f"codebotler.checking.contracts.of_program.{limit}", 3)
    assert texts_of(contracts(program), "say") == {"message": ["{}"]}


@pytest.mark.parametrize("text", ["a" * 2_001, "{}".join("abcdefghijklmnopqrstuvw")])
def test_a_text_that_would_allow_any_text_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="too long"):
        contract_from({"say": {"message": [text]}}, SKILLS)
    assert contract_from({"say": {"message": ["{}"]}}, SKILLS).skills["say"].texts[0][1] == (ANY_TEXT,)


def test_a_branch_that_only_a_changing_world_reaches_is_allowed(contracts: Contracts) -> None:
    program = """
def task_program():
    if is_in_room("mug") != is_in_room("mug"):
        go_to("lab")
"""
    assert texts_of(contracts(program), "go_to") == {"location": ["lab"]}


@pytest.mark.parametrize(
    ("skill", "texts", "place"),
    [
        ("go_to", [["lab"], ["Lab"], [" lab "], ["café"], [unicodedata.normalize("NFD", "café")]], ""),
        ("pick", [["coffee"], ["COFFEE"]], "café"),
        ("ask", [["Ann"]], ""),
    ],
)
def test_call_within_the_contract_is_accepted(
    contracts: Contracts, skill: str, texts: list[list[str]], place: str
) -> None:
    contract = contracts(BRING)
    rest = (("Coffee?",), ("yes", "no")) if skill == "ask" else ()
    for text in texts:
        assert not contract.objection(RequestedCall(skill, (tuple(text), *rest), place))


@pytest.mark.parametrize(
    "call",
    [
        RequestedCall("go_to", (("printer room 1",),)),
        RequestedCall("go_to", (("lab", "printer room 1"),)),
        RequestedCall("pick", (("coffee",),), "lab"),
        RequestedCall("pick", (("coffee",),), ""),
        RequestedCall("pick", (("coffee cup",),), "café"),
        RequestedCall("say", (("hello",),)),
        RequestedCall("ask", (("Bob",), ("Coffee?",), ("yes", "no"))),
        RequestedCall("ask", (("Ann",), ("Tea?",), ("yes", "no"))),
        RequestedCall("ask", (("Ann",), ("Coffee?",), ("yes", "never"))),
        RequestedCall("open_door", ((),)),
    ],
)
def test_call_outside_the_contract_is_refused(contracts: Contracts, call: RequestedCall) -> None:
    assert contracts(BRING).objection(call)


def test_program_with_dynamic_attributes_may_do_anything(contracts: Contracts) -> None:
    contract = contracts("def task_program():\n    getattr('a', 'lower')()\n    say('hello')\n")
    assert {"say", "go_to", "pick"} <= set(contract.skills)
    assert texts_of(contract, "go_to") == {"location": ["{}"]}


def test_more_calls_than_the_contract_allows_are_refused(contracts: Contracts) -> None:
    contract, call = contracts(BRING), RequestedCall("pick", (("coffee",),), "café")
    assert not contract.objection(call, 0)
    assert contract.objection(call, 1)


def test_beyond_returns_only_what_the_other_contract_lacks(contracts: Contracts) -> None:
    before, after = contracts(BRING), contracts(BRING.replace('place("coffee")', 'say("Here you are")'))
    assert not before.excess_over(before).skills
    assert set(after.excess_over(before).skills) == {"say"}
    assert set(before.excess_over(after).skills) == {"place"}
    wider = contracts(BRING.replace('["yes", "no"]', '["yes", "no", "later"]')).excess_over(before)
    assert texts_of(wider, "ask") == {"person": ["Ann"], "question": ["Coffee?"], "options": ["later"]}


def test_contract_survives_the_round_trip_through_a_file(contracts: Contracts, tmp_path: Path) -> None:
    (file := tmp_path / "contract.yaml").write_text(contract_yaml(contracts(BRING)))
    assert read_contract(file) == contracts(BRING)
    hard = Contract({"say": SkillBound((("message", (TextTemplate(("{a}: ", " %")),)),))})
    file.write_text(contract_yaml(hard))
    assert read_contract(file) == hard


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("version: 2\nskills: {}", 1),
        ("version: 1\nskills:\n  fly: {}", 3),
        ("version: 1\nskills:\n  say: {text: any}", 3),
        ("version: 1\nskills:\n  say: {}", 3),
        ("version: 1\nskills:\n  say:\n    message: ['{x}']", 4),
        ("version: 1\nskills:\n  say:\n    message: any\n    at most: 0", 5),
        ("version: 1\nskills:\n  say:\n    message: all", 4),
        ("version: 1\nskills:\n  say:\n    message: any\n    at most: -3", 5),
        ("version: 1\nskills:\n  say:\n    message: [3]", 4),
        ("version: 1\nskills:\n  pick: {obj: any, in: kitchen}", 3),
    ],
)
def test_invalid_file_is_refused_with_its_line(tmp_path: Path, text: str, line: int) -> None:
    (file := tmp_path / "contract.yaml").write_text(text)
    with pytest.raises(UserError) as error:
        read_contract(file)
    assert error.value.line == line


def test_a_program_beyond_a_contract_has_a_problem(contracts: Contracts) -> None:
    found = contracts.check(BRING)
    assert not with_contract_problems(found, contracts(BRING), SKILLS).problems
    problems = with_contract_problems(found, contracts(PRINTERS), SKILLS).problems
    assert {problem.kind for problem in problems} == {"OutsideContract"}


def test_rule_is_proved_or_has_a_world_that_breaks_it(contracts: Contracts) -> None:
    rules = [
        Rule(name, name, parse(f'not tr.Exists(goto("{room}"))'))
        for name, room in (("cafe", "café"), ("printer", "printer room 1"))
    ]
    found = contracts.check(BRING, *rules)
    assert [proof.verdict for proof in found.proofs] == ["possible", "never"]
    number = found.proofs[0].sample
    assert number is not None
    assert found.samples[number].outcome.error is not None
    assert [problem.rule for problem in found.problems] == ["cafe"]


@pytest.mark.parametrize("last", ["try: say('a')\n    finally: say('b')", "say('a')"])
def test_a_proof_says_whether_it_holds_if_skills_fail(contracts: Contracts, last: str) -> None:
    rule = Rule("cafe", "cafe", parse('not tr.Exists(goto("café"))'))
    (proof,) = contracts.check(f"def task_program():\n    {last}\n", rule).proofs
    assert (proof.verdict, proof.if_skills_fail) == ("never", "finally" not in last)


def test_a_program_that_does_not_compile_has_no_contract(contracts: Contracts) -> None:
    assert contracts.check("def task_program(:").contract is None


def test_calls_that_depend_on_a_changing_world_have_no_limits(contracts: Contracts) -> None:
    program = """
def task_program():
    for _ in range(3):
        go_to("lab")
        if is_in_room("mug"):
            pick("mug")
            return
"""
    pick = contracts(program).skills["pick"]
    assert (pick.places, pick.at_most) == (None, None)


def test_problem_names_the_number_of_calls_beyond_the_contract(contracts: Contracts) -> None:
    found = contracts.check(BRING)
    bound = contracts(BRING).skills["go_to"]
    tighter = Contract({**contracts(BRING).skills, "go_to": replace(bound, at_most=1)})
    (problem,) = with_contract_problems(found, tighter, SKILLS).problems
    assert "at most 3 times" in problem.message


def test_after_a_problem_a_robot_may_get_further_than_the_check(contracts: Contracts) -> None:
    found = contracts.check("def task_program():\n    go_to('cellar')\n    go_to('lab')\n    say('a')\n")
    assert found.contract is not None
    assert found.contract.skills["go_to"].at_most is None
    assert texts_of(found.contract, "say") == {"message": ["a"]}


def test_sentence_always_shows_the_gaps_of_templates() -> None:
    many = [TextTemplate((letter,)) for letter in "abcdefgh"]
    long = TextTemplate(("x" * 200, "y"))
    hidden = Contract({"say": SkillBound((("message", (*many, long)),))})
    assert "[...]" in contract_sentence(hidden, SKILLS)
    spaced = Contract({"say": SkillBound((("message", (TextTemplate(("a mug in ", "\n and more")),)),))})
    assert '"a mug in [...] and more"' in contract_sentence(spaced, SKILLS)
    whole = contract_sentence(hidden, SKILLS, is_short=False)
    assert all(f'"{letter}"' in whole for letter in "abcdefgh")
    anything = Contract({"go_to": SkillBound((("location", (*many, TextTemplate((" ", "")))),))})
    assert "any room" in contract_sentence(anything, SKILLS)


def test_an_unknown_room_is_never_allowed_by_name() -> None:
    call = RequestedCall("pick", (("mug",),), "")
    assert SkillBound((("obj", (ANY_TEXT,)),), ("",)).objection(call)
    assert not SkillBound((("obj", (ANY_TEXT,)),)).objection(call)


def test_empty_person_is_shown_as_anybody() -> None:
    nothing = (TextTemplate(("",)),)
    asks = SkillBound((("person", nothing), ("question", nothing), ("options", nothing)))
    ((_, words, _),) = contract_rows(Contract({"ask": asks}), SKILLS)
    assert words == 'anybody "" with ""'


def test_contract_also_limits_skills_without_events(contracts: Contracts) -> None:
    silent = Skill("take_photo", (), ValueType(None), "Take a photo.", is_idle=True)
    found = replace(contracts.check(BRING), contract=Contract({"take_photo": SkillBound()}))
    assert with_contract_problems(found, Contract({}), SKILLS.with_skill(silent)).problems


@pytest.mark.parametrize("is_idle", [True, False])
def test_what_a_custom_skill_may_do_is_not_denied(pool: WorkerPool, is_idle: bool) -> None:  # noqa: FBT001 - a parameter
    """Neither contracts nor rules see inside such a skill, unless it declares that it moves nothing."""
    skills = SKILLS.with_skill(
        Skill("tidy_up", (), ValueType(None), "Tidy up.", is_idle=is_idle, does=lambda _: None)
    )
    rule = Rule("cafe", "cafe", parse('not tr.Exists(goto("café"))'))
    program = "def task_program():\n    tidy_up()\n"
    found = check(program, room_map=ROOMS, pool=pool, house_rules=(rule,), explores=True, skills=skills)
    assert found.contract is not None
    assert ("drives nowhere" in contract_sentence(found.contract, skills)) == is_idle
    assert [proof.verdict for proof in found.proofs] == ["never" if is_idle else "unknown"]


def test_computed_text_is_unbounded_if_a_question_is_asked_twice(contracts: Contracts) -> None:
    poll = """
def task_program():
    votes = [ask("", "Hot?", ["yes", "no"]) for _ in range({count})]
    say(str(100 * votes.count("yes") // len(votes)).zfill(3))
"""
    once, twice = (dict(contracts(poll.format(count=n)).skills["say"].texts)["message"] for n in (1, 2))
    assert {str(one) for one in once} == {"000", "100"}
    assert twice == (ANY_TEXT,)  # another person may answer, which makes "050" possible


def test_quotes_in_a_text_cannot_forge_a_sentence(contracts: Contracts) -> None:
    found = contracts('def task_program():\n    say(\'a". It asks nobody. "\')\n    say("b")\n')
    assert "\"a'. It asks nobody. '\"" in contract_sentence(found, SKILLS)
