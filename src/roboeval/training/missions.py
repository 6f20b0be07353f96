"""Generates missions for training, where a policy calls skills one at a time, and computes their rewards."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, Self

from codebotler.core.skills.paper import SKILLS
from codebotler.prompts.tools import agent_prompt, tools_for
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.rewards import Components, components_of, requirements_of
from roboeval.evaluation.runs.endings import TURN_LIMIT
from roboeval.suites.families.tasks import trained_prompts, trained_task
from roboeval.training.prompts import load_prompts

MAX_MISSION_CALLS = 100
"""The number of calls after which a mission ends."""


def load_missions(
    split: str = "train", *, count: int = 1_000, seed: int = 0, only: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Generate missions, each in one world of a task. Equal arguments give equal missions.

    The arguments and errors are those of `load_prompts`, and the tasks are the same.

    Returns:
        Rows with `prompt` (messages with `role` and `content`), with `tools` (functions with JSON Schemas),
        and with `family`, `seed`, `prompt_index` and `world`, which identify the mission.
    """
    rows = []
    for task in load_prompts(split, count=count, seed=seed, only=only):
        del task["opening"]
        asked = agent_prompt(trained_prompts(task["family"], task["seed"])[task["prompt_index"]])
        chat = [{"role": message.role, "content": message.text} for message in asked.messages]
        world = Random(f"world {task['seed']}").randrange(1_000_000)  # noqa: S311 - not for cryptography
        rows.append(task | {"prompt": chat, "tools": mission_tools(), "world": world})
    return rows


def mission_tools() -> list[dict[str, Any]]:
    """Return the tools that every mission offers, as functions in OpenAI's format."""
    tools = [(tool, json.loads(tool.schema)) for tool in tools_for(SKILLS)]
    return [
        {
            "type": "function",
            "function": {"name": tool.name, "description": tool.description, "parameters": schema},
        }
        for tool, schema in tools
    ]


@dataclass
class TrainingMission:
    """A mission in which a policy can `call` skills until it `is_over`. Equal calls have equal results.

    Args:
        family: the family of the task.
        seed: the seed of the task.
        prompt_index: the number of the phrasing, from 0.
        world: the index of the world among those with something to do; an index past the end wraps around.

    Raises:
        UserError: the family or prompt does not exist.
    """

    family: str
    seed: int
    prompt_index: int
    world: int

    def __post_init__(self) -> None:
        task = trained_task(self.family, self.seed)
        task.expect_prompt(self.prompt_index)
        every = requirements_of(task.suite, task.name, self.prompt_index)
        # Where all requirements hold at the start, an agent that does nothing would earn the full reward.
        worlds = [one for one in every if not all(one[1])] or every
        self._asked = worlds[self.world % len(worlds)]
        self._mission = AgentMission(task.suite, self._asked[0])
        self._calls_left = MAX_MISSION_CALLS

    @classmethod
    def begin(cls, row: Mapping[str, Any]) -> Self:
        """Begin the mission of a row of `load_missions`."""
        return cls(**{name: row[name] for name in ("family", "seed", "prompt_index", "world")})

    def call(self, name: str, arguments: str | Mapping[str, object]) -> str:
        """Call a tool with arguments (a mapping or JSON), and return the result as text."""
        if self.is_over:
            return "the mission is over"
        self._calls_left -= 1
        result = self._mission.call(name, arguments)
        if not self._calls_left:
            self.stop()
        return result

    def answer(self, text: str) -> None:
        """End the mission with the policy's final message, which does not affect the reward."""
        if not self.is_over:
            self._mission.answer(text)

    def stop(self) -> None:
        """End the mission early, as if the policy had reached the limit of calls."""
        if not self.is_over:
            self._mission.end(TURN_LIMIT)

    @property
    def is_over(self) -> bool:
        """Whether the mission has ended."""
        return self._mission.ending is not None

    @property
    def components(self) -> Components:
        """The reward so far and its components, in the world of the mission."""
        return components_of([self._mission.outcome], [self._asked])
