"""Offers the benchmark as an Inspect task: `inspect eval codebotler/roboeval --model ...`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import anyio.to_thread
from inspect_ai import Task, model, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import CORRECT, INCORRECT, Score, Scorer, Target, accuracy, grouped, scorer, stderr
from inspect_ai.solver import Generate, Solver, TaskState, solver
from inspect_ai.tool import ToolDef, ToolInfo, ToolParams

from codebotler.core.errors import UserError
from codebotler.models.base import Reply, Usage
from codebotler.models.no_program import classify_reply
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for
from codebotler.prompts.extract import program_of
from codebotler.prompts.tools import ToolCall, tools_for
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.agents.conversation import TurnLimits
from roboeval.evaluation.agents.plan import DEFAULT_TURNS, AgentPlan
from roboeval.evaluation.engines.engine import Local
from roboeval.evaluation.judging.explanation import completion_data
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.endings import TIMEOUT
from roboeval.suites.load import Suite, load_suite

MISSION = "mission"  # the key of an agent's mission in the store of its sample
MISSION_KEYS = ("ending", "tool_errors", "turns")  # what a score shows of it

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
    *,
    mode: str = "program",
    max_turns: int | None = None,
) -> Task:
    """Ask a model for robot programs, and judge each in every world of its task. A sample is one prompt.

    Args:
        suite: the name or folder of a suite.
        tasks: the names of tasks, as a list or separated by commas; by default all.
        worlds: the number of worlds, 1 to 10,000, if the suite samples worlds.
        seed: the random seed for sampling worlds.
        mode: `program`, or `agent` for models that call skills; then a sample is one prompt in one world.
        max_turns: the maximum number of replies of an agent in a mission, 1 to 1,000; by default 300.
    """
    is_agent = mode == "agent"
    if mode not in {"program", "agent"}:
        raise UserError(f'the mode is {mode!r}; use "program" or "agent"')
    if max_turns is not None and not (is_agent and max_turns in range(1, 1_001)):
        raise UserError(f"max_turns is {max_turns!r}; use 1 to 1,000 with mode=agent, or leave max_turns out")
    our, drawn = SamplingSettings(), _suite(suite, worlds, seed)
    abouts: list[dict[str, Any]] = [
        {"task": name, "prompt": number, **world}
        for name in (tasks.split(",") if isinstance(tasks, str) else tasks or drawn.tasks)
        for number in range(len(drawn.task(name).prompts))
        for world in ([{"world": n} for n in range(len(drawn.task(name).scenarios))] if is_agent else [{}])
    ]
    samples = [
        Sample(
            id="/".join(map(str, about.values())),
            input=drawn.tasks[about["task"]].prompts[about["prompt"]],
            target=f"satisfied in {'this' if is_agent else 'every'} world",
            metadata=about,
        )
        for about in abouts
    ]
    turns = max_turns or DEFAULT_TURNS["agent"]
    return Task(
        dataset=MemoryDataset(samples, name=drawn.name),
        **({"solver": acting(suite, worlds, seed, turns)} if is_agent else {"setup": prompting(suite)}),
        scorer=verdict(suite, worlds, seed),
        config=model.GenerateConfig(temperature=our.temperature, top_p=our.top_p, max_tokens=our.max_tokens),
        version=drawn.version,
    )


def _suite(name: str, worlds: int | None, seed: int | None) -> Suite:
    return load_suite(name) if (worlds, seed) == (None, None) else load_suite(name).with_worlds(worlds, seed)


@solver
@register_as_codebotler
def prompting(suite: str = "paper") -> Solver:
    """Return a solver that builds the prompt of `roboeval generate`: skills, examples and the instruction."""
    known = load_suite(suite)
    rules = known.house_sentences

    async def prompt(state: TaskState, generate: Generate) -> TaskState:  # noqa: ARG001 - the next solver generates
        state.messages = _messages(prompt_for(state.input_text, rules=rules, skills=known.skills))
        return state

    return prompt


def _messages(prompt: Prompt) -> list[Any]:
    """Return the messages of a prompt as Inspect's."""
    kinds = [getattr(model, f"ChatMessage{message.role.title()}") for message in prompt.messages]
    return [kind(content=message.text) for kind, message in zip(kinds, prompt.messages, strict=True)]


@solver
@register_as_codebotler
def acting(suite: str, worlds: int | None, seed: int | None, max_turns: int) -> Solver:
    """Return a solver in which a model calls skills in one world, like `roboeval generate --mode agent`."""
    by = _suite(suite, worlds, seed)
    plan = AgentPlan(by, mode="agent", limits=TurnLimits(max_turns))
    offered = [
        ToolInfo(name=one.name, description=one.description, parameters=ToolParams(**json.loads(one.schema)))
        for one in tools_for(by.skills)
    ]

    async def act(state: TaskState, generate: Generate) -> TaskState:  # noqa: ARG001 - that cannot offer these tools
        key = state.metadata["task"], state.metadata["prompt"], state.metadata["world"]
        conversation, state.messages = plan.begin(key), _messages(plan.prompt(key))
        while conversation.prompt is not None:
            state.output = await model.get_model().generate(state.messages, tools=offered)
            state.messages.append(state.output.message)
            await anyio.to_thread.run_sync(conversation.add, _reply(state.output))
            # Store it after each turn because a limit of Inspect may end the sample.
            state.store.set(MISSION, conversation.data())
            if conversation.result is not None:
                state.messages += await _log_calls(state.output.message, conversation.result)
        return state

    return act


def _reply(output: Any) -> Reply:  # noqa: ANN401 - Inspect has no types here
    """Convert a reply, which `roboeval generate` would read in the same way."""
    said, reason, calls = output.message, output.stop_reason, []
    for call in said.tool_calls or ():
        call.function, call.arguments = _loggable([call.function, call.arguments])
        # Inspect's message about arguments that it cannot parse is no JSON either, so it counts as a mistake.
        calls.append(ToolCall(call.id, call.function, call.parse_error or json.dumps(call.arguments)))
    why = classify_reply(said.text, "", reason, has_code=bool(calls or said.text.strip()))
    fault = None if calls and why == "tool-call" else why
    return Reply(said.text, "", Usage(), None, reason, no_program=fault, calls=tuple(calls))


async def _log_calls(message: Any, result: str) -> list[Any]:  # noqa: ANN401 - Inspect has no types here
    """Let Inspect log the calls of a message with their result, and return it as messages.

    The mission has made the calls: Inspect would not pass on unknown tools and wrong arguments.
    """

    async def answer(**kwargs: Any) -> str:  # noqa: ANN401, ARG001 - any call gets here
        return result

    calls = [replace(call, parse_error=None) for call in message.tool_calls]
    anything = {"description": "made by the mission", "parameters": ToolParams(additionalProperties=True)}
    tools = [ToolDef(answer, call.function, max_output=0, **anything) for call in calls]
    played = await model.execute_tools([message.model_copy(update={"tool_calls": calls})], tools)
    return list(played.messages)


@scorer(metrics=[accuracy(), stderr(cluster="task"), grouped(accuracy(), "task", all=False)])
@register_as_codebotler
def verdict(suite: str = "paper", worlds: int | None = None, seed: int | None = None) -> Scorer:
    """Return a scorer that judges samples like `roboeval evaluate`: correct if they pass, else incorrect."""

    def judged(state: TaskState) -> Score:
        by, completion = _suite(suite, worlds, seed), _completion(state)
        (row,) = evaluate([completion], by, engine=Local(shared_pool()))
        data = _loggable(completion_data(row, completion, by))
        ended = {key: value for key, value in completion.more.items() if key in MISSION_KEYS}
        return Score(
            value=CORRECT if row["passed"] else INCORRECT,
            answer=data["program"],
            explanation="\n\n".join(map(_explanation, data["worlds"])),
            metadata={"failure": data["failure"], "worlds": data["worlds"], **ended},
        )

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001 - worlds define what is right
        return await anyio.to_thread.run_sync(judged, state)

    return score


def _loggable(data: Any) -> Any:  # noqa: ANN401 - of any kind that JSON has
    """Replace lone surrogates, which logs cannot contain."""
    return json.loads(json.dumps(data, ensure_ascii=False).encode(errors="replace"))


def _completion(state: TaskState) -> Completion:
    """Return what is judged: the program in the reply, or the mission of an agent."""
    if "world" in state.metadata:
        mission = state.store.get(MISSION) or {"program": "", "ending": None}
        ending = mission["ending"] or TIMEOUT  # if there is none, a limit of Inspect has ended the sample
        return Completion.of({**state.metadata, "index": 0, "mode": "agent", **mission, "ending": ending})
    reply, reasons = state.output.completion, [choice.stop_reason for choice in state.output.choices]
    said = {"raw_reply": reply, "finish_reason": reasons[0] if reasons else None}
    return Completion(**state.metadata, index=0, program=program_of(reply).source, more=said)


def _explanation(world: Mapping[str, Any]) -> str:
    ended = f"{world['world']}: {'satisfied' if world['satisfied'] else 'not satisfied'}"
    errors = [f"{error['kind']}: {error['message']}" for error in (world["error"],) if error]
    failed = [f"{each['check']}: {each['explanation']}" for each in world["failed_checks"]]
    return "\n- ".join([ended, *errors, *failed])
