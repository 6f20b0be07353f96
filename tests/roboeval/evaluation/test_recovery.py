"""Each skill call of a right program fails once, and another program continues."""

from __future__ import annotations

import asyncio
import json
from collections import defaultdict
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import RobotError
from codebotler.models.base import ModelError, Reply, Usage
from codebotler.models.recorded import RecordedModel
from codebotler.prompts import Prompt
from codebotler.simulator.worker import Worker
from command_line import roboeval
from roboeval.evaluation.recording import RecordingRobot
from roboeval.evaluation.recovery import (
    FaultResult,
    Interruption,
    find_first_right,
    find_interruptions,
    recovery_data,
    try_continuation,
    write_continuations,
)
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions, recorded_model_for
from roboeval.suites.load import Suite, load_suite


@pytest.fixture(scope="module")
def suite() -> Suite:
    """A task in one world."""
    paper = load_suite()
    task = paper.task("GetDrink")
    return replace(paper, tasks={task.name: replace(task, scenarios=task.scenarios[:1])})


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with closing(Worker()) as opened:
        yield opened


BRING = """
def task_program():
    go_to("lobby")
    drink = ask("visitor", "Water, iced tea or lemonade?", ["water", "iced tea", "lemonade"])
    go_to("kitchen")
    pick(drink)
    go_to("lobby")
    place(drink)
"""


def completion(program: str = BRING) -> Completion:
    return Completion(task="GetDrink", prompt=0, index=0, program=program)


@pytest.fixture(scope="module")
def mission(worker: Worker, suite: Suite) -> Interruption:
    """Return the mission that failed while the robot held the drink."""
    found = find_interruptions(worker, suite, completion())
    return next(one for one in found if isinstance(one, Interruption) and one.past.held)


@pytest.mark.parametrize(
    ("skill", "arguments", "kind"),
    [
        ("go_to", ["kitchen"], "GoToInvalidLocation"),
        ("ask", ["visitor", "Tea?", ("yes", "no")], "AskNoPerson"),
        ("pick", ["water"], "PickInvalidObject"),
        ("say", ["Hello"], "SkillFailed"),
        ("get_all_rooms", [], "SkillFailed"),
    ],
)
def test_a_skill_fails_once_without_an_event(
    suite: Suite, skill: str, arguments: list[Any], kind: str
) -> None:
    robot = RecordingRobot(
        suite.task("GetDrink").scenarios[0].world, suite, earlier_calls=[("say", ["a"])], fault=1
    )
    with pytest.raises(RobotError) as raised:
        robot.perform(skill, arguments)
    assert raised.value.kind == kind
    robot.perform("say", ["b"])
    assert [event.text for event in robot.trace] == ["a", "b"]


def test_each_call_fails_in_each_world(worker: Worker, suite: Suite) -> None:
    found = find_interruptions(worker, suite, completion())
    ended = [one for one in found if isinstance(one, Interruption)]
    assert [(one.result.world, one.result.call) for one in ended] == [(0, call) for call in range(6)]
    last = ended[-1]
    assert [event.kind for event in last.past.trace] == ["goto", "ask", "goto", "pick", "goto"]
    assert (last.past.place, last.past.held, last.result.shortest) == ("lobby", "water", 6)
    assert last.room_map.past == last.past.trace
    assert last.prompt(suite).last_step == last.past.steps[-1]


def test_an_error_that_the_program_handles_does_not_end_the_mission(worker: Worker, suite: Suite) -> None:
    lines = BRING.splitlines()
    program = "\n".join(
        [*lines[:2], "    try:\n        say('Hello')\n    except Exception:\n        pass", *lines[2:]]
    )
    found = find_interruptions(worker, suite, completion(program))
    handled = [one for one in found if isinstance(one, FaultResult)]
    assert [(one.world, one.call, one.end) for one in handled] == [(0, 0, "handled")]


def test_only_the_first_right_program_counts(worker: Worker, suite: Suite) -> None:
    wrong = completion("def task_program():\n    pass\n")
    found = list(find_first_right(worker, suite, [wrong, completion(), completion()]))
    assert [len(each) for each in found] == [0, 6, 0]


@pytest.mark.parametrize(
    ("rest", "end", "counts"),
    [
        (['go_to("lobby")', 'place("water")'], "passed", (6, 0)),
        (['say("Wait.")', 'go_to("lobby")', 'place("water")'], "passed", (7, 1)),
        (['place("water")'], "failed", (5, 0)),
        (['go_to("lobby")'], "rejected", (0, 0)),
    ],
)
def test_a_continuation_passes_fails_or_is_rejected(
    worker: Worker, mission: Interruption, rest: list[str], end: str, counts: tuple[int, int]
) -> None:
    program = "def task_program():\n" + "".join(f"    {line}\n" for line in rest)
    result = try_continuation(worker, load_suite(), mission, program)
    assert (result.end, (result.steps, result.repeated)) == (end, counts)
    assert bool(result.why) is (end in {"failed", "rejected"})


def test_a_mission_without_a_continuation_is_counted(worker: Worker, mission: Interruption) -> None:
    assert try_continuation(worker, load_suite(), mission, None).end == "missing"


def test_shares_are_of_missions_with_a_continuation() -> None:
    one = FaultResult("T", 0, 0, shortest=4)
    results = [
        one,
        replace(one, end="missing"),
        replace(one, end="passed", steps=5, repeated=1),
        replace(one, end="failed", steps=9, repeated=2),
        *[replace(one, end="rejected", why="w")] * 2,
    ]
    assert recovery_data(results) == {
        "faults": 6,
        "handled": 1,
        "missing": 1,
        "continued": 4,
        "passed": 0.25,
        "rejected": 0.5,
        "failed": 0.25,
        "steps": 5,
        "shortest_steps": 4,
        "repeated": 3,
    }
    assert recovery_data([one])["passed"] is None


class RefusingModel:
    """A model that counts requests, and refuses some."""

    name, settings = "m", None

    def __init__(self) -> None:
        self.asked: list[str] = []

    async def reply(self, prompt: Prompt, **_: object) -> Reply:
        await asyncio.sleep(0)
        self.asked.append(prompt.instruction)
        if prompt.instruction == "bad":
            raise ModelError("no", is_temporary=False, is_refusal=True)
        return Reply("", prompt.instruction, Usage(), None, None)

    async def close(self) -> None:
        """Do nothing."""


def test_equal_requests_are_sent_once() -> None:
    model = RefusingModel()
    prompts = [Prompt(name, (), "", (), "") for name in ("a", "bad", "a")]
    done: list[int] = []
    found = write_continuations(model, prompts, 2, lambda number, _: done.append(number))  # type: ignore[arg-type]  # Nothing reads its settings.
    assert (found, done) == (["a", None, "a"], [1, 2])
    assert sorted(model.asked) == ["a", "bad"]


@pytest.fixture(scope="module")
def faults(worker: Worker) -> list[FaultResult | Interruption]:
    """The faults in the first right program of each prompt of `paper`."""
    paper = load_suite()
    found = find_first_right(worker, paper, recorded_completions("recorded:careful", paper))
    return [fault for each in found for fault in each]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["careful", "hasty"])
def test_careful_continuations_pass_and_hasty_ones_do_not(
    worker: Worker, faults: list[FaultResult | Interruption], name: str
) -> None:
    suite = load_suite()
    model = recorded_model_for(f"recorded:{name}", suite)
    used, ends = set(), defaultdict(set)
    for one in faults:
        if isinstance(one, Interruption) and (program := _recorded_rest(model, one)) is not None:
            used.add(program)
            result = try_continuation(worker, suite, one, program)
            ends[result.task].add(result.end)
            assert result.repeated == 0 or name == "hasty", result
    assert ends.keys() == suite.tasks.keys()
    assert {end for each in ends.values() for end in each} <= (
        {"passed"} if name == "careful" else {"rejected", "failed"}
    )
    prompts = {prompt for task in suite.tasks.values() for prompt in task.prompts}
    assert used == {rest for (instruction, _), rest in model.rests.items() if instruction in prompts}


def _recorded_rest(model: RecordedModel, one: Interruption) -> str | None:
    return model.rests.get((one.past.instruction, (one.past.steps or ["nothing"])[-1]))


@pytest.mark.slow
def test_the_command_prints_shares_and_missions(tmp_path: Path) -> None:
    ended = roboeval("recover", "--tasks", "GetDrink,SayGoodDay", "--json", cwd=tmp_path)
    again = roboeval("recover", "--tasks", "GetDrink,SayGoodDay", "--json", cwd=tmp_path)
    assert (ended.status, ended.out) == (0, again.out)
    data = json.loads(ended.out)
    assert (data["faults"], data["continued"], data["passed"], data["rejected"]) == (42, 15, 1.0, 0.0)
    assert len(data["missions"]) == data["faults"]
    table = roboeval("recover", "--tasks", "GetDrink", "--model", "recorded:hasty", cwd=tmp_path)
    rows = [row.split()[:7] for row in table.out.splitlines()]
    assert ["all", "18", "0", "13", "5", "0.600", "0.400"] in rows
