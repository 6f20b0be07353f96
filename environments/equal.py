"""Do all environments give the same rewards for the same 500 completions? Ends with 1 if one does not.

    python environments/equal.py trl=PYTHON verifiers=PYTHON openenv=PYTHON

Each PYTHON has one of the environments; the Python that runs this needs the core only.
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


def asked() -> list[tuple[dict[str, Any], str]]:
    """Rows of prompts, each with a completion: right programs, wrong ones, and what is none."""
    found = []
    for number, row in enumerate(load_prompts("validation", count=COUNT)):
        task = trained_task(row["family"], row["seed"])
        programs = [task.solution, *(one.program for one in task.wrong), "pass", "def task_program("]
        program = programs[number // 17 % len(programs)]
        found.append((row, f"Like this:\n```python\n{program}\n```" if number % 2 else program))
    return found


def by_core() -> list[float]:
    """The rewards that the library gives."""
    rollouts = [
        Rollout(row["family"], row["seed"], row["prompt_index"], program_in(text)) for row, text in asked()
    ]
    return [one.reward for one in judge(rollouts)]


def by_trl() -> list[float]:
    """The rewards that a trainer of TRL sees."""
    from codebotler_trl import reward  # noqa: PLC0415 - is installed in one environment only

    rows, texts = zip(*asked(), strict=True)
    columns = {name: [row[name] for row in rows] for name in ("family", "seed", "prompt_index", "opening")}
    return reward([[{"role": "assistant", "content": text}] for text in texts], **columns)


def by_verifiers() -> list[float]:
    """The rewards in traces of verifiers."""
    import verifiers.v1 as vf  # noqa: PLC0415 - the same
    from codebotler_verifiers import TrainingConfig, TrainingData, TrainingTaskset  # noqa: PLC0415 - the same
    from verifiers.v1.graph import MessageNode  # noqa: PLC0415 - the same

    tasks = TrainingTaskset(TrainingConfig(id="codebotler-verifiers", split="validation", count=COUNT))

    async def scored(task: Any, text: str) -> float:  # noqa: ANN401 - has no types here
        trace = vf.Trace[TrainingData](
            task=vf.TraceTask[TrainingData](type=type(task).__name__, data=task.data),
            agent=vf.AgentInfo(config=vf.AgentConfig(runtime=vf.SubprocessConfig())),
        )
        trace.nodes.append(MessageNode(message=vf.AssistantMessage(content=text), sampled=True))
        await task.score(trace)
        return trace.reward

    async def all_scored() -> list[float]:
        return [await scored(task, text) for task, (_, text) in zip(tasks.load(), asked(), strict=True)]

    return asyncio.run(all_scored())


def by_openenv() -> list[float]:
    """The rewards of a session of OpenEnv."""
    from codebotler_openenv import CodebotlerAction  # noqa: PLC0415 - the same
    from codebotler_openenv.environment import CodebotlerEnvironment  # noqa: PLC0415 - the same

    session, found = CodebotlerEnvironment(), []
    for number, (_, text) in enumerate(asked()):
        session.reset(seed=number, split="validation")
        found.append(session.step(CodebotlerAction(completion=text)).reward)
    return found


WAYS: dict[str, Callable[[], list[float]]] = {"trl": by_trl, "verifiers": by_verifiers, "openenv": by_openenv}


def main() -> int:
    """Compare all that are named, or print what one of them gives."""
    if sys.argv[1:2] == ["--as"]:
        print(json.dumps(WAYS[sys.argv[2]]()))
        return 0
    expected, status = by_core(), 0
    right = sum(reward == 1 for reward in expected)
    print(f"core: {len(expected)} rewards, of which {right} are 1, and {expected.count(0)} are 0")
    for given in sys.argv[1:]:
        name, _, python = given.partition("=")
        done = subprocess.run([python, __file__, "--as", name], check=True, capture_output=True, text=True)
        same = sum(a == b for a, b in zip(json.loads(done.stdout.splitlines()[-1]), expected, strict=True))
        print(f"{name}: {same} of {COUNT} the same")
        status |= same < COUNT
    return status


if __name__ == "__main__":
    sys.exit(main())
