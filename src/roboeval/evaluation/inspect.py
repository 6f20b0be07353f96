"""The benchmark as a task of Inspect: `inspect eval codebotler/roboeval --model ...`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import anyio.to_thread
from inspect_ai import Task, model, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import CORRECT, INCORRECT, Score, Scorer, Target, accuracy, grouped, scorer, stderr
from inspect_ai.solver import Generate, Solver, TaskState, solver

from codebotler.models.base import Settings
from codebotler.prompts import prompt_for
from codebotler.reply import program_of
from codebotler.simulator.warm import warm
from roboeval.evaluation.completions import Completion
from roboeval.evaluation.engines import Local
from roboeval.evaluation.explanation import completion_data
from roboeval.evaluation.judge import evaluate
from roboeval.suites.load import Suite, load_suite

Registered = TypeVar("Registered", bound=Callable[..., object])


def of_codebotler(function: Registered) -> Registered:
    """Have Inspect call it `codebotler/...`: it takes the name of the package that the module says."""
    function.__module__ = "codebotler"
    return function


@task
@of_codebotler
def roboeval(
    suite: str = "paper",
    tasks: str | list[str] | None = None,
    worlds: int | None = None,
    seed: int | None = None,
) -> Task:
    """Programs for service robots, each judged in every world of its task; a sample is a prompt.

    Args:
        suite: the name of a suite that ships with the package, or its folder.
        tasks: some tasks only.
        worlds: how many worlds to draw, 1 to 10,000, for a suite whose worlds are drawn.
        seed: from which to draw them.
    """
    our, drawn = Settings(), _suite(suite, worlds, seed)
    names = tasks.split(",") if isinstance(tasks, str) else tasks or list(drawn.tasks)
    return Task(
        dataset=MemoryDataset([one for name in names for one in _samples(drawn, name)], name=drawn.name),
        setup=asking(),
        scorer=verdict(suite, worlds, seed),
        config=model.GenerateConfig(temperature=our.temperature, top_p=our.top_p, max_tokens=our.max_tokens),
        version=drawn.version,
    )


def _suite(name: str, worlds: int | None, seed: int | None) -> Suite:
    return load_suite(name) if (worlds, seed) == (None, None) else load_suite(name).with_worlds(worlds, seed)


def _samples(suite: Suite, task: str) -> list[Sample]:
    return [
        Sample(
            id=f"{task}/{number}",
            input=instruction,
            target="satisfied in every world",
            metadata={"task": task, "prompt": number},
        )
        for number, instruction in enumerate(suite.task(task).prompts)
    ]


@solver
@of_codebotler
def asking() -> Solver:
    """Ask as `roboeval generate` does: with the skills and some examples before the instruction."""

    async def ask(state: TaskState, generate: Generate) -> TaskState:  # noqa: ARG001 - comes later
        messages = prompt_for(state.input_text).messages
        state.messages = [
            getattr(model, f"ChatMessage{said.role.title()}")(content=said.text) for said in messages
        ]
        return state

    return ask


@scorer(metrics=[accuracy(), stderr(cluster="task"), grouped(accuracy(), "task", all=False)])
@of_codebotler
def verdict(suite: str = "paper", worlds: int | None = None, seed: int | None = None) -> Scorer:
    """What `roboeval evaluate` says of the program in a reply, in a thread beside the event loop."""

    def judged(state: TaskState) -> Score:
        by, program = _suite(suite, worlds, seed), program_of(state.output.completion).source
        completion = Completion(**state.metadata, index=0, program=program)
        (row,) = evaluate([completion], by, engine=Local(warm()))
        told = json.dumps(completion_data(row, completion, by), ensure_ascii=False).encode(errors="replace")
        data = json.loads(told)  # a log cannot hold half of a surrogate pair
        return Score(
            value=CORRECT if row["passed"] else INCORRECT,
            answer=data["program"],
            explanation="\n\n".join(map(_in_words, data["worlds"])),
            metadata={"failure": data["failure"], "worlds": data["worlds"]},
        )

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001 - each world says what is right
        return await anyio.to_thread.run_sync(judged, state)

    return score


def _in_words(world: Mapping[str, Any]) -> str:
    ended = f"{world['world']}: {'satisfied' if world['satisfied'] else 'not satisfied'}"
    errors = [f"{error['kind']}: {error['message']}" for error in (world["error"],) if error]
    failed = [f"{each['check']}: {each['explanation']}" for each in world["failed_checks"]]
    return "\n- ".join([ended, *errors, *failed])
