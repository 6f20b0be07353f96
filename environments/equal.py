"""Compare the rewards of all environments for the same 500 completions; exit status 1 if they differ.

    python environments/equal.py trl=PYTHON verifiers=PYTHON openenv=PYTHON

Each PYTHON has one of the environments installed; this script itself needs only the core.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from roboeval.suites.families.tasks import trained_task
from roboeval.training.prompts import load_prompts, program_in
from roboeval.training.rollouts import Rollout, judge

COUNT = 500


def examples() -> list[tuple[dict[str, Any], str]]:
    """Rows of prompts, each with a completion: right, wrong and invalid programs."""
    found = []
    for number, row in enumerate(load_prompts("validation", count=COUNT)):
        task = trained_task(row["family"], row["seed"])
        programs = [task.solution, *(one.program for one in task.wrong), "pass", "def task_program("]
        program = programs[number // 17 % len(programs)]
        found.append((row, f"Like this:\n```python\n{program}\n```" if number % 2 else program))
    return found


def by_core() -> list[float]:
    """Compute the rewards with the library itself."""
    rollouts = [
        Rollout(row["family"], row["seed"], row["prompt_index"], program_in(text)) for row, text in examples()
    ]
    return [one.reward for one in judge(rollouts)]


def by_trl() -> list[float]:
    """Compute the rewards that a trainer of TRL receives."""
    from codebotler_trl import reward  # noqa: PLC0415 - installed in one environment only

    rows, texts = zip(*examples(), strict=True)
    columns = {name: [row[name] for row in rows] for name in ("family", "seed", "prompt_index", "opening")}
    return reward([[{"role": "assistant", "content": text}] for text in texts], **columns)


def by_verifiers() -> list[float]:
    """Compute the rewards in traces of verifiers."""
    import verifiers.v1 as vf  # noqa: PLC0415 - installed in one environment only
    from codebotler_verifiers import TrainingConfig, TrainingData, TrainingTaskset  # noqa: PLC0415 - installed in one environment only
    from verifiers.v1.graph import MessageNode  # noqa: PLC0415 - installed in one environment only

    tasks = TrainingTaskset(TrainingConfig(id="codebotler-verifiers", split="validation", count=COUNT))

    async def scored(task: Any, text: str) -> float:  # noqa: ANN401 - verifiers is not installed where mypy runs
        trace = vf.Trace[TrainingData](
            task=vf.TraceTask[TrainingData](type=type(task).__name__, data=task.data),
            agent=vf.AgentInfo(config=vf.AgentConfig(runtime=vf.SubprocessConfig())),
        )
        trace.nodes.append(MessageNode(message=vf.AssistantMessage(content=text), sampled=True))
        await task.score(trace)
        return trace.reward

    async def all_scored() -> list[float]:
        return [await scored(task, text) for task, (_, text) in zip(tasks.load(), examples(), strict=True)]

    return asyncio.run(all_scored())


def by_openenv() -> list[float]:
    """Compute the rewards of a session of OpenEnv."""
    from codebotler_openenv import CodebotlerAction  # noqa: PLC0415 - installed in one environment only
    from codebotler_openenv.environment import CodebotlerEnvironment  # noqa: PLC0415 - installed in one environment only

    session, found = CodebotlerEnvironment(), []
    for number, (_, text) in enumerate(examples()):
        session.reset(seed=number, split="validation")
        found.append(session.step(CodebotlerAction(completion=text)).reward)
    return found


REWARDS: dict[str, Callable[[], list[float]]] = {
    "trl": by_trl,
    "verifiers": by_verifiers,
    "openenv": by_openenv,
}


def main() -> int:
    """Compare all named environments, or print the rewards of one."""
    if sys.argv[1:2] == ["--as"]:
        print(json.dumps(REWARDS[sys.argv[2]]()))
        return 0
    expected, status = by_core(), 0
    right = sum(reward == 1 for reward in expected)
    print(f"core: {len(expected)} rewards, of which {right} are 1, and {expected.count(0)} are 0")
    for given in sys.argv[1:]:
        name, _, python = given.partition("=")
        done = subprocess.run([python, __file__, "--as", name], check=True, capture_output=True, text=True)
        same = sum(a == b for a, b in zip(json.loads(done.stdout.splitlines()[-1]), expected, strict=True))
        print(f"{name}: {same} of {COUNT} equal")
        status |= same < COUNT
    return status


if __name__ == "__main__":
    sys.exit(main())
