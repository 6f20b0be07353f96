"""Compare the rewards of all environments for the same 500 completions and 200 missions of agents.

    python environments/equal.py trl=PYTHON verifiers=PYTHON openenv=PYTHON

Each PYTHON has one of the environments installed; this script itself needs only the core. The exit
status is 1 if rewards differ.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any, TypeAlias

from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.recording import SLEEP, RecordingRobot
from roboeval.suites.families.tasks import GeneratedTask, trained_task
from roboeval.training.missions import TrainingMission, load_missions
from roboeval.training.prompts import load_prompts, program_in
from roboeval.training.rollouts import Rollout, judge

TASKS, EACH, MISSIONS_EACH = 100, 5, 2  # Making a task takes longer than judging five programs.

Call: TypeAlias = tuple[str, dict[str, Any]]
Example: TypeAlias = tuple[dict[str, Any], str]
Mission: TypeAlias = tuple[dict[str, Any], list[Call]]


def examples() -> list[Example]:
    """Return rows of prompts, each with EACH completions: right, wrong and invalid programs."""
    found = []
    for number, row in enumerate(load_prompts("validation", count=TASKS)):
        task = trained_task(row["family"], row["seed"])
        programs = [task.solution, *(one.program for one in task.wrong), "pass", "def task_program("]
        for further in range(EACH):
            program = programs[(number // 17 + further) % len(programs)]
            found.append((row, f"Like this:\n```python\n{program}\n```" if further % 2 else program))
    return found


def missions() -> list[Mission]:
    """Return missions, each with MISSIONS_EACH lists of calls: of right and wrong programs, and mistakes."""
    found = []
    for number, row in enumerate(load_missions("validation", count=TASKS)):
        task = trained_task(row["family"], row["seed"])
        programs = [task.solution, *(one.program for one in task.wrong)]
        for further in range(MISSIONS_EACH):
            calls = calls_of(task, row["world"], programs[(number // 17 + further) % len(programs)])
            more: list[Call] = [("give_up", {"reason": "?"})] if number % 5 == 0 else []
            mistakes: list[Call] = [("go_to", {"location": "nowhere"})] if number % 3 == 0 else []
            found.append((row, [*mistakes, *calls, *more]))
    return found


def calls_of(task: GeneratedTask, world: int, program: str) -> list[Call]:
    """Return the calls that a program makes in a world."""
    worlds = task.suite.tasks[task.name].scenarios
    robot = RecordingRobot(worlds[world % len(worlds)].world, task.suite)
    pool = shared_pool()
    pool.submit(lambda: pool.here().run_alone(program, lambda: robot)).result()
    calls: list[Call] = []
    for name, values in robot.calls:
        if name == SLEEP:
            calls.append(("wait", {"seconds": 1}))
            continue
        names = [parameter.name for parameter in task.suite.skills[name].parameters]
        written = [[one.text for one in value] if isinstance(value, tuple) else value for value in values]
        calls.append((name, dict(zip(names, written, strict=True))))
    return calls


def judge_with_core(examples: list[Example], missions: list[Mission]) -> list[float]:
    """Compute the rewards with the library itself, first of the programs and then of the missions."""
    rollouts = [
        Rollout(row["family"], row["seed"], row["prompt_index"], program_in(text)) for row, text in examples
    ]
    rewards = [one.reward for one in judge(rollouts)]
    for row, calls in missions:
        mission = TrainingMission.begin(row)
        for call in calls:
            mission.call(*call)
        mission.answer("Done.")
        rewards.append(mission.components.reward)
    return rewards


def judge_with_trl(examples: list[Example], missions: list[Mission]) -> list[float]:
    """Compute the rewards that a trainer of TRL receives."""
    from codebotler_trl import MissionEnvironment, reward  # noqa: PLC0415 - installed in one environment only

    rows, texts = zip(*examples, strict=True)
    columns = {name: [row[name] for row in rows] for name in ("family", "seed", "prompt_index", "opening")}
    rewards = reward([[{"role": "assistant", "content": text}] for text in texts], **columns)
    for row, calls in missions:
        environment = MissionEnvironment()
        environment.reset(**row)
        for name, arguments in calls:
            getattr(environment, name)(**arguments)
        rewards += reward([[{"role": "assistant", "content": "Done."}]], environments=[environment])
    return rewards


def judge_with_verifiers(examples: list[Example], missions: list[Mission]) -> list[float]:
    """Compute the rewards in traces of verifiers."""
    import codebotler_verifiers as environment  # noqa: PLC0415 - installed in one environment only
    import verifiers.v1 as vf  # noqa: PLC0415 - installed in one environment only
    from verifiers.v1.graph import MessageNode  # noqa: PLC0415 - installed in one environment only

    def tasks(mode: str, count: int) -> Any:  # noqa: ANN401 - verifiers is not installed where mypy runs
        options = {"id": "codebotler-verifiers", "split": "validation", "mode": mode, "count": count}
        return environment.TrainingTaskset(environment.TrainingConfig(**options)).load()

    async def score(task: Any, text: str, calls: list[Call]) -> float:  # noqa: ANN401 - verifiers is not installed where mypy runs
        trace = vf.Trace[environment.TrainingData](
            task=vf.TraceTask[environment.TrainingData](type=type(task).__name__, data=task.data),
            agent=vf.AgentInfo(config=vf.AgentConfig(runtime=vf.SubprocessConfig())),
        )
        made = [vf.ToolCall(id="1", name=name, arguments=json.dumps(given)) for name, given in calls]
        messages = [
            *(vf.AssistantMessage(tool_calls=[call]) for call in made),
            vf.AssistantMessage(content=text),
        ]
        trace.nodes += [MessageNode(message=message, sampled=True) for message in messages]
        await task.score(trace)
        return trace.reward

    async def score_all() -> list[float]:
        prompts = [task for task in tasks("program", TASKS) for _ in range(EACH)]
        programs = zip(prompts, examples, strict=True)
        begun = [task for task in tasks("agent", TASKS) for _ in range(MISSIONS_EACH)]
        acted = zip(begun, missions, strict=True)
        return [
            *[await score(task, text, []) for task, (_, text) in programs],
            *[await score(task, "Done.", calls) for task, (_, calls) in acted],
        ]

    return asyncio.run(score_all())


def judge_with_openenv(examples: list[Example], missions: list[Mission]) -> list[float]:
    """Compute the rewards of a session of OpenEnv."""
    from codebotler_openenv import CodebotlerAction  # noqa: PLC0415 - installed in one environment only
    from codebotler_openenv.environment import CodebotlerEnvironment  # noqa: PLC0415 - installed in one environment only

    session, found = CodebotlerEnvironment(), []
    for number, (_, text) in enumerate(examples):
        session.reset(seed=number // EACH, split="validation")
        found.append(session.step(CodebotlerAction(completion=text)).reward)
    for number, (_, calls) in enumerate(missions):
        session.reset(seed=number // MISSIONS_EACH, split="validation", mode="agent")
        actions = [CodebotlerAction(tool=name, arguments=arguments) for name, arguments in calls]
        for action in (*actions, CodebotlerAction(answer="Done.")):
            if (step := session.step(action)).done:
                break
        found.append(step.reward)
    return found


REWARDS: dict[str, Callable[[list[Example], list[Mission]], list[float]]] = {
    "trl": judge_with_trl,
    "verifiers": judge_with_verifiers,
    "openenv": judge_with_openenv,
}


def main() -> int:
    """Compare all named environments, or print the rewards of one for what it is given."""
    if sys.argv[1:2] == ["--as"]:
        print(json.dumps(REWARDS[sys.argv[2]](*json.load(sys.stdin))))
        return 0
    given = examples(), missions()
    expected, status, text = judge_with_core(*given), 0, json.dumps(given)
    right = sum(reward == 1 for reward in expected)
    print(f"core: {len(expected)} rewards, of which {right} are 1, and {expected.count(0)} are 0")
    for argument in sys.argv[1:]:
        name, _, python = argument.partition("=")
        command = [python, __file__, "--as", name]
        done = subprocess.run(command, check=True, capture_output=True, text=True, input=text)
        same = sum(a == b for a, b in zip(json.loads(done.stdout.splitlines()[-1]), expected, strict=True))
        print(f"{name}: {same} of {len(expected)} equal")
        status |= same < len(expected)
    return status


if __name__ == "__main__":
    sys.exit(main())
