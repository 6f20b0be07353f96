"""Training tasks with one reward, and its components as metrics."""

import asyncio
from collections.abc import Iterator
from dataclasses import asdict
from functools import lru_cache
from itertools import count as counting
from itertools import islice
from typing import Any, Literal, TypeAlias

import verifiers.v1 as vf
from pydantic import Field, field_validator

from codebotler_verifiers.missions import MissionState, MissionToolset, repeat_calls
from roboeval.suites.families.tasks import TRAINING_WORLDS, trained_task
from roboeval.training.missions import TrainingMission, load_missions
from roboeval.training.prompts import load_prompts, program_in
from roboeval.training.rollouts import Components, Rollout, judge

STREAM = 1_000_000
"""The distance between the first tasks of two seeds."""
IDLE = "def task_program():\n    pass\n"
SEEDS = 1_000  # The bound keeps each stream within its split.


class TrainingConfig(vf.TasksetConfig):
    """The options of the task set, under `--env.taskset.*`."""

    mode: Literal["program", "agent"] = "program"
    """Whether a policy writes a program, or calls skills as tools in one world."""
    split: Literal["train", "validation", "test"] = "train"
    """Splits share no task."""
    count: int | None = Field(None, ge=1, le=STREAM)
    """The number of tasks; unlimited by default."""
    seed: int = Field(0, ge=0, lt=SEEDS)
    """Another seed gives entirely different tasks."""
    families: list[str] = Field(default_factory=list)
    """The families; all of them by default."""
    worlds: int = Field(TRAINING_WORLDS, ge=1, le=10_000)
    """The least number of worlds in which a program is judged."""

    @field_validator("families")
    @classmethod
    def _exist(cls, families: list[str]) -> list[str]:
        load_prompts(count=1, only=families)  # pydantic reports its UserError, which is a ValueError.
        return families


class TrainingData(vf.TaskData):
    """A prompt, and the task that it belongs to. The world is None if the policy writes a program."""

    family: str
    seed: int
    prompt_index: int
    worlds: int
    world: int | None = None


TrainingTrace: TypeAlias = vf.Trace[TrainingData]
AnyTrace: TypeAlias = vf.Trace[Any, Any]  # verifiers' types do not know the state of a mission.


class TrainingTask(vf.Task[TrainingData, MissionState, vf.TaskConfig]):
    """Judge the program in the last reply, or the mission of an agent.

    A failure of the engine is raised, and verifiers records it as the error of the rollout.
    """

    @property
    def key(self) -> str:
        """The task and the phrasing, independent of their position in a stream."""
        assert self.data.id is not None
        return self.data.id

    async def setup(self, trace: AnyTrace, runtime: vf.Runtime) -> None:  # noqa: ARG002 - verifiers passes it
        """Tell the server of the tools which mission it is."""
        trace.state.row = self.data.model_dump(include={"family", "seed", "prompt_index", "world"})

    @vf.stop
    async def mission_is_over(self, trace: vf.Trace) -> bool:  # type: ignore[type-arg]  # verifiers requires this signature.
        """Whether the last call has ended the mission of an agent."""
        return self.data.world is not None and (await self._mission(trace)).is_over

    @vf.metric
    async def components(self, trace: TrainingTrace) -> dict[str, float]:
        """The components of the reward, each as a metric."""
        parts = asdict(await self._judged(trace))
        del parts["reward"]
        return parts

    @vf.reward
    async def reward(self, trace: TrainingTrace) -> float:
        """The reward: 1 if and only if the program or the mission passes."""
        return (await self._judged(trace)).reward

    async def validate(self, runtime: vf.Runtime) -> bool:  # noqa: ARG002 - programs run in the simulator
        """Whether the reference solution earns 1, and a program that does nothing earns 0."""
        data = self.data
        task = await asyncio.to_thread(trained_task, data.family, data.seed, worlds=data.worlds)
        solved, idle = [await self._parts(program) for program in (task.solution, IDLE)]
        return solved.reward == 1 and idle.reward == 0

    async def _judged(self, trace: TrainingTrace) -> Components:
        if self.data.world is None:
            return await self._parts(await asyncio.to_thread(program_in, trace.last_reply))
        mission = await self._mission(trace)
        if trace.stop_condition in {None, "agent_completed"}:
            mission.answer(trace.last_reply)
        else:
            mission.stop()
        return mission.components

    async def _mission(self, trace: AnyTrace) -> TrainingMission:
        """Repeat the calls of a trace, also those that never reached the server because they were wrong."""
        calls = [call for message in trace.assistant_messages for call in message.tool_calls or []]
        return await asyncio.to_thread(
            repeat_calls, self.data.model_dump(), [(call.name, call.arguments) for call in calls]
        )

    async def _parts(self, program: str) -> Components:
        data = self.data
        rollout = Rollout(data.family, data.seed, data.prompt_index, program)
        return await asyncio.to_thread(_components, rollout, data.worlds)


class TrainingTaskset(vf.Taskset[TrainingTask, TrainingConfig]):  # type: ignore[type-var]  # The state has another type.
    """A reproducible, possibly unlimited stream of tasks."""

    def __init__(self, config: TrainingConfig) -> None:
        super().__init__(config)
        self.INFINITE = config.count is None

    def load(self) -> Iterator[TrainingTask]:
        """Generate the tasks lazily, in the order of their seeds."""
        config = self.config
        first = config.seed * (config.count or STREAM)
        for number in islice(counting(first), config.count):
            load = load_prompts if config.mode == "program" else load_missions
            (row,) = load(config.split, count=1, seed=number, only=config.families)
            yield TrainingTask(_data(row, config.worlds), config.task)

    @classmethod
    def toolsets(cls, config: TrainingConfig) -> list[vf.Toolset[Any, Any]]:
        """The server of the tools, for agents only."""
        return [] if config.mode == "program" else [MissionToolset(vf.SharedToolsetConfig())]


def _data(row: dict[str, Any], worlds: int) -> TrainingData:
    """Convert a row of `load_prompts`; the system prompt is separate, so that verifiers can replace it."""
    system, *messages = row["prompt"]
    name, world = f"{row['family']}-{row['seed']}", row.get("world")
    return TrainingData(
        id=f"{name}-{row['prompt_index']}" + ("" if world is None else f"-{world}"),
        name=name,
        system_prompt=system["content"],
        prompt=messages,
        family=row["family"],
        seed=row["seed"],
        prompt_index=row["prompt_index"],
        worlds=worlds,
        world=world,
    )


@lru_cache(maxsize=4_096)  # The metrics and the reward of a rollout share a result.
def _components(rollout: Rollout, worlds: int) -> Components:
    (found,) = judge([rollout], worlds=worlds)
    return found
