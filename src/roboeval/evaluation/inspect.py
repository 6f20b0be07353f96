"""Offers the benchmark as an Inspect task: `inspect eval codebotler/roboeval --model ...`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import anyio.to_thread
from inspect_ai import Task, model, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import CORRECT, INCORRECT, Score, Scorer, Target, accuracy, grouped, scorer, stderr
from inspect_ai.solver import Generate, Solver, TaskState, solver

from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import prompt_for
from codebotler.prompts.extract import program_of
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.engines import Local
from roboeval.evaluation.explanation import completion_data
from roboeval.evaluation.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.suites.load import Suite, load_suite

Registered = TypeVar("Registered", bound=Callable[..., object])


def register_as_codebotler(function: Registered) -> Registered:
    """Set a function's module so that Inspect registers the function as `codebotler/...`."""
    function.__module__ = "codebotler"
    return function


@task
@register_as_codebotler
def roboeval(
    suite: str = "paper",
    tasks: str | list[str] | None = None,
    worlds: int | None = None,
    seed: int | None = None,
) -> Task:
    """Ask for programs for service robots, and judge each in every world of its task. A sample is a prompt.

    Args:
        suite: the name or folder of a suite.
        tasks: the tasks to select, by default all.
        worlds: the number of worlds, 1 to 10,000, if the suite samples worlds.
        seed: the random seed for sampling worlds.
    """
    our, drawn = SamplingSettings(), _suite(suite, worlds, seed)
    samples = [
        Sample(
            id=f"{name}/{number}",
            input=instruction,
            target="satisfied in every world",
            metadata={"task": name, "prompt": number},
        )
        for name in (tasks.split(",") if isinstance(tasks, str) else tasks or drawn.tasks)
        for number, instruction in enumerate(drawn.task(name).prompts)
    ]
    return Task(
        dataset=MemoryDataset(samples, name=drawn.name),
        setup=prompting(suite),
        scorer=verdict(suite, worlds, seed),
        config=model.GenerateConfig(temperature=our.temperature, top_p=our.top_p, max_tokens=our.max_tokens),
        version=drawn.version,
    )


def _suite(name: str, worlds: int | None, seed: int | None) -> Suite:
    return load_suite(name) if (worlds, seed) == (None, None) else load_suite(name).with_worlds(worlds, seed)


@solver
@register_as_codebotler
def prompting(suite: str = "paper") -> Solver:
    """Return a solver that builds the prompt of `roboeval generate`: skills, examples and instruction."""
    known = load_suite(suite)
    rules = known.house_sentences

    async def prompt(state: TaskState, generate: Generate) -> TaskState:  # noqa: ARG001 - the next solver generates
        state.messages = [
            getattr(model, f"ChatMessage{message.role.title()}")(content=message.text)
            for message in prompt_for(state.input_text, rules=rules, skills=known.skills).messages
        ]
        return state

    return prompt


@scorer(metrics=[accuracy(), stderr(cluster="task"), grouped(accuracy(), "task", all=False)])
@register_as_codebotler
def verdict(suite: str = "paper", worlds: int | None = None, seed: int | None = None) -> Scorer:
    """Return a scorer that judges like `roboeval evaluate`, in a separate thread."""

    def judged(state: TaskState) -> Score:
        by, reply = _suite(suite, worlds, seed), state.output.completion
        reasons = [choice.stop_reason for choice in state.output.choices]
        said = {"raw_reply": reply, "finish_reason": reasons[0] if reasons else None}
        completion = Completion(**state.metadata, index=0, program=program_of(reply).source, more=said)
        (row,) = evaluate([completion], by, engine=Local(shared_pool()))
        text = json.dumps(completion_data(row, completion, by), ensure_ascii=False)
        data = json.loads(text.encode(errors="replace"))  # logs cannot contain lone surrogates
        return Score(
            value=CORRECT if row["passed"] else INCORRECT,
            answer=data["program"],
            explanation="\n\n".join(map(_explanation, data["worlds"])),
            metadata={"failure": data["failure"], "worlds": data["worlds"]},
        )

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001 - worlds define what is right
        return await anyio.to_thread.run_sync(judged, state)

    return score


def _explanation(world: Mapping[str, Any]) -> str:
    ended = f"{world['world']}: {'satisfied' if world['satisfied'] else 'not satisfied'}"
    errors = [f"{error['kind']}: {error['message']}" for error in (world["error"],) if error]
    failed = [f"{each['check']}: {each['explanation']}" for each in world["failed_checks"]]
    return "\n- ".join([ended, *errors, *failed])
