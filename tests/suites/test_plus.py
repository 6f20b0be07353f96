"""The suite `plus`: its tasks judge as their instructions ask, and unrelated actions change nothing."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import cycle
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

from codebotler.core.world import World
from codebotler.models.recorded import Solution
from codebotler.simulator.engine import run
from plain_words import expect_plain_words, explain_failures
from roboeval.evaluation.judging.failures import Verdict
from roboeval.evaluation.judging.judge import judge
from roboeval.linting.lint import lint
from roboeval.linting.task_findings import Verdicts, judge_solutions
from roboeval.suites.load import Suite, Task, load_suite
from roboeval.suites.solutions import solutions

HERE = Path(__file__).parent
KNOWN: list[dict[str, Any]] = yaml.safe_load((HERE / "known.yaml").read_text())
TASKS = sorted(load_suite("paper").tasks)
each_task = pytest.mark.parametrize("name", TASKS)


@cache
def plus() -> Suite:
    return load_suite("plus")


@cache
def plus_of_another_seed() -> Suite:
    return plus().with_worlds(40, 77)


def judge_programs(programs: list[str], task: Task, worlds: list[World] | None = None) -> list[list[Verdict]]:
    """Run and judge each program in all worlds of a task, or in other worlds with the same requirements."""
    scenarios = task.scenarios
    shown = worlds or [scenario.world for scenario in scenarios]
    pairs = [(program, world) for program in programs for world in shown]
    outcomes = iter([*run(pairs, workers=2, settings=plus().settings)])
    return [[judge(next(outcomes), scenario) for scenario in scenarios] for _ in programs]


def passes(several: Verdicts, prompt: int | None = None) -> bool:
    """Whether a program does what a prompt or, without a prompt, any prompt asks for."""
    prompts = range(5) if prompt is None else [prompt]
    return any(all(verdict.on(number).satisfied for verdict in several) for number in prompts)


@cache
def solution_verdicts(name: str) -> Sequence[Verdicts]:
    """Return the verdicts on the reference solutions of a task."""
    return judge_solutions(plus().tasks[name], plus(), workers=2)


def test_the_papers_suite_is_unchanged_and_plus_has_its_prompts() -> None:
    assert load_suite("paper").digest == "ea395de1c023ae42bcf293f8da46567226ecc850722a2ec3a081fb90c44b5ffb"
    assert sorted(plus().tasks) == TASKS
    for name, task in plus().tasks.items():
        assert task.prompts == load_suite("paper").tasks[name].prompts


@each_task
def test_programs_that_other_checks_misjudge_are_judged_right(name: str) -> None:
    of_task = [known for known in KNOWN if known["task"] == name]
    judged = judge_programs([known["program"] for known in of_task], plus().tasks[name])
    wrong = [
        (
            known["key"],
            known["about"],
            [(v.world, [r.text for r in v.failed]) for v in several if not v.satisfied][:3],
        )
        for known, several in zip(of_task, judged, strict=True)
        if passes(several, known.get("prompt")) != known["is_right"]
    ]
    assert wrong == []


# Here verdicts differ from those of the paper's suite; the value says whether the solution is right.
OTHERWISE = {
    "FindBackpack": {
        "puts it down under another name than it was picked up": True,
        # No instruction numbers the rooms.
        "numbers the rooms itself": False,
    },
    "GetDrink": {
        "comes back to tell me the choice before bringing the drink": True,
        "sees what there is in the kitchen before asking": True,
        "says in an office that it is done": True,
    },
    "GrilledCheese": {
        "looks for Zarko in the lobby too": True,
        "one question with the ingredients as options": False,
    },
    "CountSavory": {
        # It asks only the owner of an office.
        "knows the four offices by heart": False,
    },
    "HalloweenShopping": {
        "Counter with the owner asked by name": False,
    },
    "HalloweenList": {
        "uses a Counter and looks for the owner by name": False,
        # It says nothing where nobody is in.
        "plain loop over the rooms": False,
    },
    "LunchBreak": {
        "two lists side by side": False,
        "goes through the names with an index": False,
    },
    "LunchTime": {
        "looks for her in the other office too": True,
        "announces the errand before setting out": True,
        "her yes fits none of the friendly answers, so it counts as a no": True,
    },
    "MailDelivery": {
        "puts down the bin under another name than it was picked up": True,
    },
    "MovieMessenger": {
        "offers p.m. with full stops, which does not match what Mark answers": True,
        "looks the offices up by name and returns early": False,
        "returns to the start between Sally and Mark": True,
    },
    "SayGoodDay": {
        'says "nobody is here today" in an empty lab': True,
    },
    "StaplerDelivery": {
        "puts down something it did not pick under that name": True,
        "makes sure that there are staplers in the supply room before it starts looking": True,
        # No instruction numbers the rooms.
        "the rooms by their numbers, delivered at once": False,
    },
    "StaplerSupply": {
        # It says one sentence for all rooms, but each phrasing asks for one per room.
        "looks into every printer room and lists those without one": False,
        "a comprehension with a function that looks": False,
        "separate lists, of which only the one asked for is reported": False,
        "plain and right": False,
        "right, builds the sentence while it drives": False,
        "right, with a generator": False,
        # No instruction numbers the rooms.
        "numbers the printer rooms and lists the numbers": False,
    },
    "WeatherPoll": {
        # It waits in recursive calls, and Python's limit on recursion ends it.
        "right, calls itself for the next person": False,
    },
}


def is_right(solution: Solution, name: str) -> bool:
    return OTHERWISE.get(name, {}).get(solution.about, solution.right or solution.fails is None)


@each_task
def test_solutions_are_judged_as_declared(name: str) -> None:
    task = plus().tasks[name]
    wrong = [
        (
            one.about,
            [(v.world, v.outcome.error, [r.text for r in v.failed]) for v in several if not v.satisfied][:2],
        )
        for one, several in zip(solutions(task), solution_verdicts(name), strict=True)
        if passes(several) != is_right(one, name)
        or OTHERWISE.get(name, {}).get(one.about) == (one.fails is None)
    ]
    assert wrong == []


@each_task
def test_the_linter_finds_nothing(name: str) -> None:
    assert lint(plus().tasks[name], solution_verdicts(name)) == []


@each_task
def test_explanations_of_wrong_solutions_show_no_regex(name: str) -> None:
    found = explain_failures(one for several in solution_verdicts(name) for one in several[::5])
    assert len(found) > 10
    expect_plain_words(found)


HARMLESS = """
_drive = go_to
def go_to(room):
    _drive(room)
    is_in_room("fire extinguisher")
    time.sleep(1)
"""


WORLDS = 3
"""The distance between worlds with harmless additions."""
AROUND = [
    "say('I am on my way.'); _task(); say('All done!')",
    "_task(); say('That was no problem at all.')",
    "say('One moment, please.'); _task(); say('That was all.')",
    "_task(); say('It took me 5 minutes. Thank you, and have a nice day.')",
    "say('Off I go, it is not far.'); _task(); say('Any questions? Just ask!')",
    "_task(); say('Everything went well.')",
    "say('I will do all of that right away.'); _task(); say('I have done everything that I was asked to.')",
]


@each_task
def test_harmless_looks_pauses_and_sentences_change_nothing(name: str) -> None:
    task = plus().tasks[name]
    several = [
        (one, judged[::WORLDS])
        for one, judged in [*zip(solutions(task), solution_verdicts(name), strict=True)][::4]
    ]
    task = replace(task, scenarios=task.scenarios[::WORLDS])
    changed = [
        f"{HARMLESS}{solution.program}\n_task = task_program\ndef task_program():\n    {around}\n"
        for around, (solution, _) in zip(cycle(AROUND), several, strict=False)
    ]
    otherwise = [
        (program, [(v.world, [r.text for r in v.failed]) for v in after if not v.satisfied])
        for program, (_, before), after in zip(changed, several, judge_programs(changed, task), strict=True)
        if passes(before) != passes(after)
    ]
    assert otherwise == []


@each_task
def test_the_order_of_rooms_changes_no_verdict_on_a_right_program(name: str) -> None:
    task = plus().tasks[name]
    right = [one.program for one in solutions(task) if is_right(one, name)][::5]
    random = Random(name)
    worlds = [
        replace(s.world, rooms=tuple(random.sample(s.world.rooms, len(s.world.rooms))))
        for s in task.scenarios
    ]
    assert all(map(passes, judge_programs(right, task, worlds)))


@each_task
def test_worlds_of_another_seed_differ_and_give_the_same_verdicts(name: str) -> None:
    task = plus_of_another_seed().tasks[name]
    assert {s.world for s in task.scenarios} != {s.world for s in plus().tasks[name].scenarios}
    chosen = solutions(task)[::9]
    judged = judge_programs([one.program for one in chosen], task)
    for one, several in zip(chosen, judged, strict=True):
        assert passes(several) == is_right(one, name), one.about
