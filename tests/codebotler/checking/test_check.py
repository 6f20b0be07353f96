"""Checks report errors that may do harm, excuse the others, and give equal data for equal programs."""

import json
import re
from collections.abc import Iterator
from unittest.mock import Mock

import pytest

from codebotler.checking.check import check, check_on, check_together
from codebotler.checking.problems import CheckResult
from codebotler.checking.sampled import MAX_EXTRA_WORLDS, CheckSettings, UnwantedCheckError
from codebotler.core.errors import UserError
from codebotler.core.trace import Status
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from haste import hasten

ROOMS = ("start_loc", "kitchen", "alice's office", "bob's office")
START = "def task_program():\n    "


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as started:
        yield started


class Checks:
    """Checks bodies of `task_program` on a pool that stays open."""

    def __init__(self, pool: WorkerPool) -> None:
        self.pool = pool

    def __call__(
        self,
        *lines: str,
        rooms: tuple[str, ...] | None = ROOMS,
        samples: int = 5,
        seed: int = 0,
        strict: bool = False,
    ) -> CheckResult:
        source = START + "\n    ".join(lines) + "\n"
        return check(source, rooms=rooms, samples=samples, seed=seed, strict=strict, pool=self.pool)

    def kinds(self, *lines: str, strict: bool = False) -> list[tuple[int | None, str]]:
        return [(problem.line, problem.kind) for problem in self(*lines, strict=strict).problems]


@pytest.fixture(scope="module")
def checks(pool: WorkerPool) -> Checks:
    return Checks(pool)


# --- errors


@pytest.mark.parametrize(
    ("lines", "kind", "line"),
    [
        (["x = 1 // 0"], "ZeroDivisionError", 2),
        (["x = {}", "x['a']"], "KeyError", 3),
        (["import sys", "sys.exit('no')"], "SystemExit", 3),
        (["go_to('lab')"], "GoToInvalidLocation", 2),
        (["room = 'la' + 'b'", "go_to(room)"], "GoToInvalidLocation", 3),
        (["place('mug')"], "PlaceNoObject", 2),
        (["pick('mug')", "pick('cup')"], "PickWhileHolding", 3),
        (["options = []", "ask('', 'Tea?', options)"], "AskEmptyOptions", 3),
        (["while True:", "    pass"], "TimeoutError", 3),
        (["say(mesage)"], "NameError", 2),
        (["go_to(1)"], "TypeError", 2),
        (["say('a'"], "SyntaxError", 2),
    ],
)
def test_error_in_every_world_is_a_problem(checks: Checks, lines: list[str], kind: str, line: int) -> None:
    assert checks.kinds(*lines) == [(line, kind)]


def test_a_program_without_problems_is_accepted(checks: Checks) -> None:
    found = checks("go_to('kitchen')", "pick('mug')", "go_to('start_loc')", "place('mug')")
    assert found.problems == ()
    assert [sample.outcome.status for sample in found.samples] == [Status.FINISHED] * 5
    assert [sample.number for sample in found.samples] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    "lines",
    [
        ["if 'lab' in get_all_rooms():", "    go_to('lab')"],
        ["try:", "    ask('Bob', 'Tea?', [])", "except Exception:", "    pass"],
        ["try:", "    say(mesage)", "except (KeyError, NameError):", "    pass"],
        ["import contextlib", "with contextlib.suppress(Exception):", "    go_to('lab')"],
    ],
)
def test_harmless_error_is_accepted(checks: Checks, lines: list[str]) -> None:
    assert checks.kinds(*lines) == []


@pytest.mark.parametrize(
    ("lines", "kind", "line"),
    [
        (["if False:", "    go_to('lab')"], "GoToInvalidLocation", 3),
        (["if is_in_room('mug'):", "    return", "say(mesage)"], "NameError", 4),
        (["def other():", "    go_to('lab')", "other()"], "GoToInvalidLocation", 3),
        (["try:", "    say(mesage)", "except KeyError:", "    pass"], "NameError", 3),
        (["try:", "    pass", "except Exception:", "    say(mesage)"], "NameError", 5),
        (["try:", "    say(mesage)", "finally:", "    pass"], "NameError", 3),
        (["if False:", "    break"], "SyntaxError", 3),
        (["class Guide:", "    def lead(self):", "        go_to('lab')"], "GoToInvalidLocation", 4),
    ],
)
def test_possibly_harmful_error_is_a_problem(checks: Checks, lines: list[str], kind: str, line: int) -> None:
    assert checks.kinds(*lines) == [(line, kind)]


def test_options_that_are_not_texts_are_accepted(checks: Checks) -> None:
    assert checks.kinds("say(str(ask('alice', 'How many?', [1, 2]) + 1))") == []


def test_observed_absence_is_a_problem_that_names_the_world(checks: Checks) -> None:
    found = checks("go_to('kitchen')", "is_in_room('person')", "ask('person', 'Tea?', ['Yes', 'No'])")
    (problem,) = found.problems
    assert (problem.kind, problem.line, problem.where) == ("AskNoPerson", 4, 'nobody is in "kitchen"')
    assert problem.sentence.startswith("line 4: AskNoPerson: ")
    assert problem.sentence.endswith(problem.where)
    alone = [s.number for s in found.samples if 'nobody is in "kitchen"' in s.world]
    assert list(problem.samples) == alone
    assert 0 < len(alone) < 5


def test_unobserved_absence_is_a_problem_only_in_strict_checks(checks: Checks) -> None:
    lines = ("go_to('kitchen')", "answer = ask('alice', 'Tea?', ['Yes', 'No'])", "pick('cup')", "say(answer)")
    assert checks.kinds(*lines) == []
    assert checks.kinds(*lines, strict=True) == [(3, "AskNoPerson"), (4, "PickInvalidObject")]


def test_caught_error_is_accepted(checks: Checks) -> None:
    assert checks.kinds("try:", "    go_to('lab')", "except Exception:", "    say('no lab')") == []


def test_problem_names_the_answers_that_lead_to_it(checks: Checks) -> None:
    found = checks(
        "look = is_in_room('mug')",
        "if ask('', 'Tea?', ['Yes', 'No']) == 'No':",
        "    place('tea')",
        samples=12,
    )
    (problem,) = found.problems
    assert re.findall('".+?"', problem.where) == ['"start_loc"', '"Tea?"', '"No"']


def test_problem_omits_facts_that_hold_in_every_world(checks: Checks) -> None:
    always = next(
        name
        for name in map(str, range(10_000))
        if all(FactSampler(0, n).decide("is_there", "start_loc", name).result for n in range(8))
    )
    found = checks(
        f"is_in_room('{always}')",
        "if ask('', 'Tea?', ['Yes', 'No']) == 'No':",
        "    place('tea')",
        samples=8,
    )
    assert f'"{always}" is in "start_loc"' in found.samples[0].world
    (where,) = [problem.where for problem in found.problems]
    assert re.findall('".+?"', where) == ['"start_loc"', '"Tea?"', '"No"']


def test_each_line_has_at_most_one_problem(checks: Checks) -> None:
    found = checks("say(a, b)", "go_to('lab'); say(c)")
    assert [(p.line, p.kind) for p in found.problems] == [(2, "NameError"), (3, "NameError")]
    assert all(name in found.problems[0].message for name in (" a ", " b "))
    assert '"lab"' in found.problems[1].message


def test_a_program_that_does_not_parse_is_not_run(checks: Checks) -> None:
    assert checks("say(").samples == ()


def test_program_without_a_task_has_one_problem(pool: WorkerPool) -> None:
    (problem,) = check("x = 1\n", rooms=ROOMS, pool=pool).problems
    assert (problem.kind, problem.line) == ("NameError", None)


def test_problem_suggests_the_closest_room(checks: Checks) -> None:
    for lines in (["go_to('alices office')"], ["for name in ['Alices']:", "    go_to(name + ' office')"]):
        (problem,) = checks(*lines).problems
        assert '"alice\'s office"' in problem.message


# --- waiting and searching


WAITS = ("go_to('kitchen')", "while not is_in_room('person'):", "    time.sleep(1)", "say('hello')")


@pytest.mark.slow
def test_waiting_for_a_person_is_accepted(checks: Checks) -> None:
    for seed in range(20):
        found = checks(*WAITS, samples=1, seed=seed)
        assert found.problems == ()
        ended = [sample for sample in found.samples if not sample.in_vain]
        assert {sample.outcome.status for sample in ended} == {Status.FINISHED}


@pytest.mark.slow
def test_waiting_in_many_places_ends_in_some_world(checks: Checks) -> None:
    lines = (
        "for room in ('kitchen', 'alice', 'bob', 'start'):",
        "    go_to(next(r for r in get_all_rooms() if room in r))",
        "    while not is_in_room('person'):",
        "        time.sleep(1)",
        "    while not is_in_room('mug'):",
        "        time.sleep(1)",
    )
    assert not any(checks(*lines, seed=seed).problems for seed in range(10))


def test_endless_waiting_in_every_world_is_one_problem(checks: Checks) -> None:
    found = checks("while is_in_room('mug') or True:", "    time.sleep(1)")
    assert len(found.samples) == 5 + MAX_EXTRA_WORLDS
    (problem,) = found.problems
    assert (problem.kind, problem.line) == ("TimeoutError", 2)
    assert "25 imagined worlds" in problem.message


@pytest.mark.slow
def test_endless_computation_does_not_count_as_waiting(
    checks: Checks, monkeypatch: pytest.MonkeyPatch
) -> None:
    hasten(monkeypatch)
    found = checks("for room in get_all_rooms():", "    is_in_room(room)", "sum(range(10**12))", samples=2)
    assert [problem.kind for problem in found.problems] == ["TimeoutError"]
    assert len(found.samples) == 2


def test_waiting_at_several_lines_is_one_problem(checks: Checks) -> None:
    found = checks(
        "while not is_in_room('mug'):",
        "    time.sleep(1)",
        "while True:",
        "    time.sleep(1)",
    )
    assert len({sample.outcome.line for sample in found.samples}) == 2
    assert len(found.problems) == 1


def test_endless_waiting_without_a_look_runs_once(monkeypatch: pytest.MonkeyPatch) -> None:
    worker = Worker()
    run = Mock(side_effect=worker.run_alone)
    monkeypatch.setattr(worker, "run_alone", run)
    loop = "class A: pass\n" + START + "while True:\n        time.sleep(1)\n"
    try:
        found = check_on(worker, loop, RoomMap(ROOMS, ROOMS[0]))
    finally:
        worker.close()
    assert run.call_count == 1
    assert len(found.samples) == 5
    assert "imagined worlds" not in found.problems[0].message


def test_check_says_what_the_program_takes_for_granted() -> None:
    program = "def task_program():\n    go_to('hall')\n    ask('ann', 'Tea?', ['yes'])\n"
    assert '"ann" is in "hall"' in check(program, rooms=["hall"]).assumption
    asks_if_there = program.replace("    ask", "    if is_in_room('ann'):\n        ask")
    assert check(asks_if_there, rooms=["hall"]).assumption == ""


def test_check_says_that_there_must_be_several_things() -> None:
    bring = "go_to('hall')\n    pick('mug')\n    go_to('lab')\n    place('mug')\n"
    once, twice = (f"def task_program():\n    {bring}{more}" for more in ("", f"    {bring}"))
    assert "another" not in check(once, rooms=["hall", "lab"]).assumption
    assert '"another mug" is in "hall"' in check(twice, rooms=["hall", "lab"]).assumption


def test_search_may_assume_that_the_thing_exists(checks: Checks) -> None:
    lines = (
        "for room in get_all_rooms():",
        "    go_to(room)",
        "    if is_in_room('bag'):",
        "        pick('bag')",
        "        break",
        "place('bag')",
    )
    for seed in range(10):
        assert checks(*lines, seed=seed, samples=2).problems == ()


def test_search_of_all_rooms_may_assume_that_only_one_thing_exists(checks: Checks) -> None:
    lines = (
        "for room in get_all_rooms():",
        "    go_to(room)",
        "    if is_in_room('bag'):",
        "        pick('bag')",
        "place('bag')",
    )
    for seed in range(10):
        assert checks(*lines, rooms=ROOMS[:3], seed=seed, samples=2).problems == ()


def test_single_look_does_not_count_as_a_search(checks: Checks) -> None:
    lines = ("go_to('kitchen')", "if is_in_room('mug'):", "    pick('mug')", "place('mug')")
    (problem,) = checks(*lines).problems
    assert (problem.kind, problem.where) == ("PlaceNoObject", '"mug" is not in "kitchen"')


# --- rooms


def test_rooms_are_guessed_from_the_program(checks: Checks) -> None:
    found = checks("go_to('lab')", "for n in (1, 2):", "    go_to(f'office {n}')", rooms=None)
    assert found.problems == ()
    assert found.rooms_are_guessed
    assert found.rooms == ("lab", "start_loc"), "a room that the program computes exists, but is not listed"
    assert not checks("say('a')").rooms_are_guessed


def test_program_that_visits_every_room_gets_rooms_to_visit(checks: Checks) -> None:
    found = checks("for room in get_all_rooms():", "    go_to(room)", rooms=None)
    assert found.rooms == ("room 1", "room 2", "start_loc")
    found = checks("for room in get_all_rooms():", "    if room != 'lab':", "        go_to(room)", rooms=None)
    assert found.rooms == ("lab", "room 1", "room 2", "start_loc")


def test_robot_starts_in_the_given_room_or_start_loc_or_the_first_room(pool: WorkerPool) -> None:
    source = START + "say(get_current_location())\n"

    def start_of(rooms: tuple[str, ...], start: str | None = None) -> str:
        return check(source, rooms=rooms, start=start, pool=pool).samples[0].outcome.trace[0].text

    assert start_of(ROOMS) == "start_loc"
    assert start_of(("lab", "start_loc")) == "start_loc"
    assert start_of(("lab", "hall")) == "lab"
    assert start_of(("lab", "hall"), "hall") == "hall"
    assert start_of(()) == "start_loc"
    assert start_of((), "hall") == "hall"
    assert check(source, start="hall", pool=pool).room_map.start == "hall"
    with pytest.raises(UserError, match=r'"hal".* lab, hall$'):
        start_of(("lab", "hall"), "hal")


def test_room_with_an_invalid_regex_is_refused(pool: WorkerPool) -> None:
    with pytest.raises(UserError, match=r'"c\+\+ \("'):
        check(START + "pass", rooms=["c++ ("], pool=pool)


def test_room_with_a_slow_regex_is_refused(pool: WorkerPool) -> None:
    with pytest.raises(UserError, match=r'"\(a\+\)\+\$", but searching for this text may take too long'):
        check(START + f'go_to("{"a" * 40}!")', rooms=["(a+)+$"], pool=pool)


# --- equal checks


LOOKS = (
    "for room in get_all_rooms():",
    "    go_to(room)",
    "    if is_in_room('person'):",
    "        say(ask('', 'Tea?', ['Yes', 'No', 'Later']))",
    "        pick(ask('', 'What?', ['mug', 'cup']))",
)


def test_pool_and_worker_give_the_same_check(pool: WorkerPool) -> None:
    source = START + "\n    ".join(LOOKS) + "\n"
    written = json.dumps(check(source, rooms=ROOMS, seed=4, pool=pool).data())
    worker = Worker()
    try:
        settings = CheckSettings(seed=4)
        assert json.dumps(check_on(worker, source, RoomMap(ROOMS, ROOMS[0]), settings).data()) == written
    finally:
        worker.close()


@pytest.mark.parametrize("samples", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_programs_checked_together_and_alone_have_the_same_results(samples: int) -> None:
    looks, rooms = START + "\n    ".join(LOOKS) + "\n", RoomMap(ROOMS, ROOMS[0])
    waits = START + "while not is_in_room('mug'):\n        time.sleep(1)\n"
    broken, nowhere = "def task_program(:", START + "go_to('moon')\n"
    programs = [looks, f"class A: pass\n{looks}", broken, looks, nowhere, waits]
    settings = CheckSettings(samples=samples, seed=4)
    worker = Worker()
    try:
        together = check_together(worker, [(program, rooms) for program in programs], settings)
        alone = [check_on(worker, program, rooms, settings) for program in programs]
    finally:
        worker.close()
    assert [check.data() for check in together] == [check.data() for check in alone]
    assert [together[number].problems[0].kind for number in (2, 4)] == ["SyntaxError", "GoToInvalidLocation"]
    assert together[0].samples == together[3].samples


def test_seed_determines_the_worlds(checks: Checks) -> None:
    first, again, other = (checks(*LOOKS, seed=seed).data()["samples"] for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_data_survives_the_json_round_trip(checks: Checks) -> None:
    data = checks("is_in_room('mug')", "say(a)").data()
    assert json.loads(json.dumps(data)) == data
    assert list(data) == [
        "accepted",
        "problems",
        "rooms",
        "start",
        "rooms_are_guessed",
        "seed",
        "strict",
        "contract",
        "proofs",
        "samples",
    ]
    assert not data["accepted"]
    assert list(data["samples"][0]) == ["sample", "world", "in_vain", "status", "error", "line", "trace"]


def test_problem_of_an_ambiguous_drive_lists_its_rooms() -> None:
    result = check(
        'def task_program():\n    go_to("the shelf in the kitchen")\n', rooms=["hall", "kitchen", "shelf"]
    )
    (problem,) = result.problems
    assert (problem.kind, problem.line) == ("GoToInvalidLocation", 2)
    assert '"kitchen" or "shelf"' in problem.message


def test_check_stops_when_it_is_no_longer_wanted(pool: WorkerPool) -> None:
    answers = iter([True, True, True, False])
    slow = START + "if is_in_room('cup'):\n        sum(range(10**6))\n    say('hello')\n"
    with pytest.raises(UnwantedCheckError):
        check(slow, rooms=ROOMS, pool=pool, is_wanted=lambda: next(answers))
    assert next(answers, None) is None
    assert not check(slow, rooms=ROOMS, pool=pool).problems
