"""Candidates run in the same imagined worlds, and those that do the same are one cluster."""

from collections.abc import Iterator

import pytest

from codebotler.candidates.clusters import (
    RANDOM_WORLDS,
    SETTLED_WORLDS,
    CandidateClusters,
    cluster_candidates,
    conflicts_in_worlds,
    shared_rooms,
)
from codebotler.candidates.question import question_about
from codebotler.checking.problems import CheckResult
from codebotler.checking.sampled import CheckSettings
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.room_map import RoomMap

ROOMS = RoomMap(("hall", "kitchen", "lab"), "hall")
NO_LAB = Rule("no-lab", "Never go to the lab.", parse('not tr.Exists(goto("lab"))'))

LOOKS = """
def task_program():
    go_to("kitchen")
    found = is_in_room("mug")
    go_to("hall")
    say("There is a mug" if found else "There is no mug")
"""
LOOKS_TOO = """
def task_program():
    start = get_current_location()
    go_to("kitchen")
    if is_in_room("the mug"):
        text = "I found a mug."
    else:
        text = "I did not find a mug."
    go_to(start)
    say(text)
"""
GUESSES = 'def task_program():\n    go_to("kitchen")\n    go_to("hall")\n    say("There is a mug")\n'
LOST = 'def task_program():\n    go_to("cellar")\n'
ASKS = """
def task_program():
    go_to("kitchen")
    likes = ask("{who}", "{question}", {options})
    go_to("hall")
    say("They like tea" if likes.lower() == "tea" else "They like coffee")
"""
TEA = ASKS.format(who="", question="What do you like?", options='["tea", "coffee"]')
COFFEE = ASKS.format(who="person", question="Coffee or tea?", options='["Coffee", "Tea"]')


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    started = Worker()
    cluster_candidates(started, [LOOKS], CheckSettings(), ROOMS)  # This starts the processes.
    yield started
    started.close()


def cluster(
    worker: Worker, *programs: str, rooms: RoomMap | None = ROOMS, rules: tuple[Rule, ...] = ()
) -> CandidateClusters:
    return cluster_candidates(worker, programs, CheckSettings(house_rules=rules), rooms)


def test_programs_that_do_the_same_share_a_cluster_and_the_largest_is_first(worker: Worker) -> None:
    found = cluster(worker, GUESSES, LOOKS, LOOKS_TOO, LOOKS_TOO)
    assert [(one.size, one.programs) for one in found.clusters] == [(3, (LOOKS_TOO, LOOKS)), (1, (GUESSES,))]
    assert (found.total, found.rejected) == (4, ())


def test_each_cluster_has_a_run_for_each_world(worker: Worker) -> None:
    first, second = cluster(worker, LOOKS, GUESSES).clusters
    assert len(first.samples) == len(second.samples) == len(first.behaviours) == len(second.behaviours)
    assert [one.number for one in second.samples] == [*range(len(first.samples))]
    assert any(one != other for one, other in zip(first.behaviours, second.behaviours, strict=True))
    assert any(one == other for one, other in zip(first.behaviours, second.behaviours, strict=True))


def test_an_answer_does_not_depend_on_the_words_of_the_question(worker: Worker) -> None:
    found = cluster(worker, TEA, COFFEE)
    assert [one.size for one in found.clusters] == [2]
    said = {claims for one in found.clusters[0].behaviours for _, claims in one.said}
    assert len(said) == 2, "both answers are tried"


def test_further_worlds_try_facts_that_no_random_world_has(worker: Worker) -> None:
    options = [f"{number} cups" for number in range(12)]
    asks = f'def task_program():\n    say(ask("", "How many cups?", {options}))\n'
    (found,) = cluster(worker, asks).clusters
    assert len({one.said for one in found.behaviours}) == len(options)


def test_who_is_asked_is_not_there_if_another_program_finds_nobody(worker: Worker) -> None:
    visit = "def task_program():\n    for room in get_all_rooms():\n        go_to(room)\n        {}\n"
    asks = visit.format("say(ask('zoe', 'Tea?', ['yes']))")
    looks = visit.format("if is_in_room('zoe'): say(ask('zoe', 'Tea?', ['yes']))")
    found = cluster(worker, asks, looks, rooms=RoomMap(("hall", "lab"), "hall"))
    question = question_about(found)
    assert question is not None
    assert any("zoe" in fact for fact in question.facts)
    assert any("does not finish" in option.difference for option in question.options)


PARTY = """def task_program():
    for name in ["ann", "bob", "eve"]:
        go_to(f"{name}'s office")
        %s
    go_to("hall")
    say(%s)
"""


def test_options_of_a_question_do_not_contradict_each_other(worker: Worker) -> None:
    """Another candidate that is not shown may do so, since it offers other answers to the same question."""
    ask = "last = ask(name, 'Do you come?', [%s])"
    asks = PARTY % (ask % "'yes', 'no', 'maybe'", "f'Eve says {last}.'")
    report = PARTY % (ask % "'yes', 'no', 'maybe'", "f'It is {last} for 3 people.'")
    looks = PARTY % (f"last = 'out'\n        if is_in_room(name): {ask % '1, 2'}", "f'Last: {last}.'")
    first_looks = looks.replace("1, 2", "'yes', 'no', 'maybe'")
    rooms = RoomMap(("hall", *(f"{name}'s office" for name in ("ann", "bob", "eve"))), "hall")
    question = question_about(
        cluster(worker, asks, asks, report, report, first_looks, first_looks, looks, rooms=rooms)
    )
    assert question is not None
    assert not any(" is not in " in fact for fact in question.facts), "people who answer are there"


def test_a_failure_is_shown_where_others_find_a_person_elsewhere(worker: Worker) -> None:
    """This holds even if most worlds contain no contradiction."""
    here = PARTY.replace('["ann", "bob", "eve"]', '["bob"]') % (
        "answer = ask(name, 'How many?', ['yes', 'no'])",
        "f'1 {answer}'",
    )
    missing = "        if not is_in_room(name):\n            %s\n            return\n        answer"
    look = here.replace("        answer", missing.replace("            return\n", "") % "go_to('den')")
    give_up = here.replace("        answer", missing % "say('Bob is out')").replace("f'1", "f'2")
    rooms = RoomMap(("hall", "bob's office", "den"), "hall")
    question = question_about(cluster(worker, here, here, look, look, give_up, give_up, rooms=rooms))
    assert question is not None
    assert any("does not finish" in option.difference for option in question.options)


def test_a_person_is_in_one_room_in_some_world(worker: Worker) -> None:
    search = "def task_program():\n    for room in get_all_rooms():\n        go_to(room)\n        {}\n"
    warn = search.format("if is_in_room('zoe') or is_in_room('omar'): say('Mind the floor')")
    warn_all = search.format("is_in_room('zoe'); is_in_room('omar'); say('Mind the floor')")
    rooms = RoomMap(tuple(f"room {number}" for number in range(12)), "room 0", people=("Zoe", "Omar"))
    found = cluster(worker, warn, warn_all, rooms=rooms)
    conflicts = conflicts_in_worlds(found.clusters, found.people)
    assert min(conflicts[number] for number in range(RANDOM_WORLDS)) > 0, "somebody is in several rooms"
    worlds = range(RANDOM_WORLDS + SETTLED_WORLDS)
    assert [conflicts[number] for number in worlds[RANDOM_WORLDS:]] == [0] * SETTLED_WORLDS
    for one in found.clusters:
        assert [sample.number for sample in one.samples] == [*worlds]
        assert len(one.behaviours) == len(worlds)


def test_rejected_candidates_are_dropped(worker: Worker) -> None:
    found = cluster(worker, LOST, LOOKS, LOST)
    assert [one.programs for one in found.clusters] == [(LOOKS,)]
    assert len(found.rejected) == 2


@pytest.mark.slow
def test_house_rules_reject_candidates(worker: Worker) -> None:
    visits = 'def task_program():\n    go_to("lab")\n'
    assert cluster(worker, visits, LOOKS).rejected == ()
    assert len(cluster(worker, visits, LOOKS, rules=(NO_LAB,)).rejected) == 1


def test_the_first_candidate_is_kept_if_all_are_rejected(worker: Worker) -> None:
    found = cluster(worker, LOST, "def task_program(:", "")
    assert [(one.program, one.size) for one in found.clusters] == [(LOST, 1)]
    assert len(found.rejected) == 2


def test_without_a_map_all_programs_share_the_rooms_that_they_name(worker: Worker) -> None:
    drives = 'def task_program():\n    go_to("{}")\n    go_to(get_current_location())\n'
    found = cluster(worker, drives.format("attic"), drives.format("the attic"), LOOKS, rooms=None)
    assert sorted(one.size for one in found.clusters) == [1, 2]


def test_without_a_map_rooms_with_computed_names_are_shared_too(worker: Worker) -> None:
    computes = 'def task_program():\n    for n in (1, 2):\n        go_to(f"conference room {n}")\n'
    lists = "def task_program():\n    for one in get_all_rooms():\n"
    lists += "        if 'conference room' in one:\n            go_to(one)\n"
    (found,) = cluster(worker, computes, lists, rooms=None).clusters
    assert found.size == 2


def test_a_program_that_lists_rooms_gets_two_of_each_kind() -> None:
    lists = "def task_program():\n    for room in get_all_rooms():\n        go_to(room)\n"
    rooms = ("office", "start_loc"), ("the lab 1", "lab")
    checks = [CheckResult((), (), RoomMap(one, "start_loc")) for one in rooms]
    alone = shared_rooms(["def task_program():\n    pass"], checks, CheckSettings())
    assert alone.rooms == ("office", "lab 1", "start_loc")
    both = shared_rooms([lists], checks, CheckSettings())
    assert both.rooms == ("office", "lab 1", "office 2", "lab 2", "start_loc")
    assert both.start == "start_loc"
