"""Missions for training: agents act in one world of a task and earn what a program would earn there."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.prompts.tools import agent_prompt
from roboeval.evaluation.agents.mission import MAX_MISTAKES, AgentMission
from roboeval.evaluation.rewards import Share, requirements_of, total
from roboeval.suites.families.suite import FIRST_SEEDS
from roboeval.suites.families.tasks import trained_task
from roboeval.training.missions import MAX_MISSION_CALLS, TrainingMission, load_missions, mission_tools
from roboeval.training.prompts import load_prompts

FAMILY = "AnnounceInOrder"  # Its solutions have no branches.
FAMILIES = [FAMILY, "BringThing"]


@pytest.fixture
def row() -> dict[str, Any]:
    return load_missions(count=1, only=[FAMILY])[0]


def right_calls(row: dict[str, Any]) -> list[tuple[str, dict[str, str]]]:
    program = trained_task(row["family"], row["seed"]).solution
    rooms, message = re.findall(r"\[.*\]", program)[0], re.findall(r'say\("(.*)"\)', program)[0]
    each = [(("go_to", {"location": room}), ("say", {"message": message})) for room in json.loads(rooms)]
    return [call for calls in each for call in calls]


def act(row: dict[str, Any], calls: list[tuple[str, dict[str, str]]]) -> TrainingMission:
    mission = TrainingMission.begin(row)
    for name, arguments in calls:
        mission.call(name, arguments)
    return mission


def test_missions_belong_to_the_tasks_of_prompts_and_are_reproducible() -> None:
    for split in FIRST_SEEDS:
        rows, tasks = (load(split, count=6, only=FAMILIES) for load in (load_missions, load_prompts))
        identity = ("family", "seed", "prompt_index")
        assert [[one[name] for name in identity] for one in rows] == [
            [one[name] for name in identity] for one in tasks
        ]
        assert rows == load_missions(split, count=6, only=FAMILIES)


def test_rows_have_the_prompt_and_the_tools_of_an_agent(row: dict[str, Any]) -> None:
    instruction = trained_task(row["family"], row["seed"]).prompts[row["prompt_index"]]
    asked = agent_prompt(instruction)
    assert row["prompt"] == [{"role": one.role, "content": one.text} for one in asked.messages]
    assert row["tools"] == mission_tools()
    functions = [tool["function"] for tool in row["tools"]]
    assert [(one["name"], json.dumps(one["parameters"])) for one in functions] == [
        (tool.name, tool.schema) for tool in asked.tools
    ]


def test_seeds_draw_all_worlds_of_a_task() -> None:
    rows = load_missions(count=300, only=[FAMILY])
    drawn = {one["world"] % 8 for one in rows}
    assert drawn == set(range(8))


def test_numbers_of_worlds_wrap_around(row: dict[str, Any]) -> None:
    task = trained_task(row["family"], row["seed"])
    number = len(task.suite.tasks[task.name].scenarios)
    first, again = (act({**row, "world": world}, right_calls(row)[:2]) for world in (1, 1 + number))
    assert first.call("get_current_location", {}) == again.call("get_current_location", {})
    assert first.components == again.components


def test_results_are_those_of_an_agents_mission(row: dict[str, Any]) -> None:
    task = trained_task(row["family"], row["seed"])
    number = row["world"] % len(task.suite.tasks[task.name].scenarios)
    mission, agent = (
        TrainingMission.begin(row),
        AgentMission(task.suite, task.suite.tasks[task.name].scenarios[number].asked_by(0)),
    )
    calls: list[Any] = [("get_all_rooms", ""), ("fly", "{}"), ("go_to", "{}"), *right_calls(row)]
    for name, arguments in calls:
        assert mission.call(name, arguments) == agent.call(name, arguments)
    asked = requirements_of(task.suite, task.name, row["prompt_index"])[number]
    assert mission.components.reward == total([Share.of(agent.outcome, *asked)])


def test_the_right_calls_earn_1_and_none_earn_0(row: dict[str, Any]) -> None:
    calls = right_calls(row)
    right, part, idle = (act(row, some) for some in (calls, calls[:2], []))
    for mission in (right, part, idle):
        assert not mission.is_over
        mission.answer("Done.")
        assert mission.is_over
    assert (right.components.reward, right.components.passed) == (1, 1)
    assert 0 < part.components.reward < 1
    assert idle.components.reward == 0
    assert idle.components.requirements > 0
    assert part.components.without_errors == part.components.rules_kept == part.components.parses == 1


def test_a_mission_ends_at_the_limit_of_calls_with_half_the_reward(row: dict[str, Any]) -> None:
    calls = right_calls(row)
    mission = act(row, calls)
    for _ in range(MAX_MISSION_CALLS - len(calls)):
        assert not mission.is_over
        mission.call("wait", {"seconds": 1})
    assert mission.is_over
    assert (mission.components.reward, mission.components.without_errors) == (0.5, 0)


@pytest.mark.slow
def test_doing_nothing_earns_0() -> None:
    rows = load_missions(count=60, only=["CollectThings", "SwapThings"])
    assert max(TrainingMission.begin(row).components.reward for row in rows) == 0


def test_calls_after_the_end_change_nothing(row: dict[str, Any]) -> None:
    calls = right_calls(row)
    stopped, mistaken = act(row, calls[:2]), TrainingMission.begin(row)
    stopped.stop()
    for _ in range(MAX_MISTAKES):
        mistaken.call("fly", {})
    for mission in (stopped, mistaken):
        assert mission.is_over
        before = mission.components
        results = {mission.call(*call) for call in calls}
        mission.answer("Done.")
        assert len(results) == 1
        assert mission.components == before


def test_a_mission_that_does_not_exist_is_refused(row: dict[str, Any]) -> None:
    for wrong in ({"family": "LunchTime"}, {"prompt_index": 99}, {"seed": -1}):
        with pytest.raises(UserError):
            TrainingMission.begin({**row, **wrong})
