"""Replays real programs as an agent's calls, and compares the verdicts with those of the programs.

Each skill call of a program in a world becomes a tool call, which a server on loopback sends to the real chat
client; each sleep becomes a call of `wait`. A program that ends in an error gives up, and one that reaches a
limit makes its last call again until the agent reaches a limit. In each world, the verdicts, the failed
requirements and the robot's errors must be the same. The turns and tokens of the run must be those that the
server counted.

The programs are those of CODEBOTLER_CORPUS, or else the recorded ones. PART=10 takes each tenth, SUITE=plus
another suite, and DIRECT=1 leaves out the server, which is much faster.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

sys.path += [str(Path(__file__).parents[1] / "tests" / part) for part in ("roboeval", "codebotler/models")]

from agent_server import INPUT_TOKENS, OUTPUT_TOKENS, Turn, instruction_of, serve
from codebotler.core.trace import Option, Outcome, Status
from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import Argument
from roboeval.evaluation.agents.conversation import TurnLimits
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.agents.plan import AgentPlan
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.generating.generate import GenerationProgress, Pace, generate_run
from roboeval.evaluation.judging.failures import Verdict
from roboeval.evaluation.judging.judge import evaluate, judge
from roboeval.evaluation.recording import SLEEP, RecordingRobot
from roboeval.evaluation.runs.completions import Completion, CompletionKey
from roboeval.evaluation.runs.endings import TIMEOUT
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.rows import Row, key_of
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Scenario, Suite, load_suite
from server import Request

PART = int(os.environ.get("PART", "1"))
MAX_TURNS = 100
GIVE_UP: Turn = [("give_up", {"reason": "The program ended in an error."})]


@dataclass(frozen=True)
class Replay:
    """The outcome of a program in a world, and the turns of an agent that makes the same calls."""

    outcome: Outcome
    verdict: Verdict
    turns: Sequence[Turn]

    @property
    def signature(self) -> tuple[object, ...]:
        """The parts of the verdict that must be equal for an agent."""
        error = self.outcome.error
        kind = error.kind if error and self.outcome.status is Status.ROBOT_ERROR else None
        return self.verdict.satisfied, [one.text for one in self.verdict.failed], kind


def programs(suite: Suite) -> Iterator[tuple[str, str]]:
    """Yield tasks and programs."""
    corpus = os.environ.get("CODEBOTLER_CORPUS")
    if corpus is None:
        found = [(one.task, one.program) for one in recorded_completions("recorded:hasty", suite)]
    else:
        lines = (Path(corpus) / "corpus" / "programs.jsonl").read_text().splitlines()
        found = [(row["task"], row["program"]) for row in map(json.loads, lines)]
    yield from (one for one in found[::PART] if one[0] in suite.tasks)


def replay(worker: Worker, suite: Suite, program: str, scenario: Scenario) -> Replay:
    """Run a program, and write its calls as turns."""
    robots: list[RecordingRobot] = []

    def new_robot() -> RecordingRobot:
        robots.append(RecordingRobot(scenario.world, suite))
        return robots[-1]

    outcome = worker.run_alone(program, new_robot)
    turns: list[Turn] = []
    now = 0.0
    for name, arguments in robots[-1].calls if robots else ():
        if name == SLEEP:
            until = float(arguments[0])  # type: ignore[arg-type]  # a number of seconds
            turns.append([("wait", {"seconds": until - now})])
            now = until
        else:
            given = zip(suite.skills[name].parameters, map(as_json, arguments), strict=True)
            turns.append([(name, {parameter.name: value for parameter, value in given})])
    is_limit = outcome.status is Status.TIMEOUT
    if not is_limit:
        turns.append("Done." if outcome.error is None else GIVE_UP)
    elif not turns:
        turns.append([("wait", {"seconds": 1})])
    return Replay(outcome, judge(outcome, scenario), turns)


def as_json(value: Argument) -> object:
    """Write an argument as JSON does."""
    if not isinstance(value, tuple):
        return value
    return [each.text if isinstance(each, Option) else each for each in value]


class ReplayPlan(AgentPlan):
    """Plans the missions of some replays."""

    wanted: Sequence[CompletionKey] = ()

    def keys(self) -> list[CompletionKey]:
        """Return the keys of the replays."""
        return [*type(self).wanted]


def send_turns(suite: Suite, replays: dict[CompletionKey, Replay]) -> tuple[list[Completion], Iterator[Row]]:
    """Let a server send the turns to the chat client, and return the completions and their judgements."""
    scripts = {(suite.tasks[key[0]].prompts[0], key[2]): one.turns for key, one in replays.items()}
    agent, server = serve(lambda request: scripts[instruction_of(request), seed_of(request)])
    ReplayPlan.wanted = list(replays)
    os.environ.setdefault("OPENAI_API_KEY", "none")
    with server, tempfile.TemporaryDirectory() as folder:
        model = open_model("openai-chat:replay", SamplingSettings(base_url=server.url, seed=0))
        plan = ReplayPlan(suite, None, 1, mode="agent", limits=TurnLimits(MAX_TURNS))
        run, started = RunFolder(Path(folder)), time.monotonic()
        progress = generate_run(run, plan, model, Pace(16), on_progress=show)
        assert progress.missing is None, progress.missing
        completions = [*run.read(suite)]
        turns, answered = sum(one.turns for one in completions), sum(agent.answered.values())
        print(
            f"\n{turns:,} turns; the server counted {answered:,} requests, {len(agent.answered):,} different"
        )
        tokens = {name: turns * each for name, each in TOKENS.items()}
        assert turns == answered == len(agent.answered)
        assert dict(progress.usage) == tokens, (progress.usage, tokens)
        print(f"tokens as the server counted: {tokens}; {time.monotonic() - started:.0f} s")
        return completions, iter(
            [*evaluate_run(run, suite, ablated=False, tasks=None, redo=False, workers=2)]
        )


TOKENS = {"input_tokens": INPUT_TOKENS, "output_tokens": OUTPUT_TOKENS}


def seed_of(request: Request) -> int:
    """Return the index of the completion that a request is for."""
    return int(request.body["seed"])


def show(progress: GenerationProgress) -> None:
    """Print how many missions are over."""
    if progress.done % 25 == 0:
        print(f"\r{progress.done:,} of {progress.total:,} missions", end="", flush=True)


def make_calls(suite: Suite, replays: dict[CompletionKey, Replay]) -> tuple[list[Completion], Iterator[Row]]:
    """Make the calls without a client."""
    completions = []
    for (task, prompt, index), one in replays.items():
        world = index % len(suite.tasks[task].scenarios)
        mission = AgentMission(suite, suite.tasks[task].scenarios[world].asked_by(prompt))
        for turn in one.turns:
            if mission.ending is None:
                mission.answer(turn) if isinstance(turn, str) else mission.call(turn[0][0], turn[0][1])  # type: ignore[arg-type]  # arguments
        if mission.ending is None:
            mission.end(TIMEOUT)
        assert mission.ending is not None
        more = {"mode": "agent", "world": world, "ending": mission.ending, "no_program": None}
        completions.append(
            Completion(task=task, prompt=prompt, index=index, program=mission.program, more=more)
        )
    return completions, evaluate(completions, suite, workers=2)


def main() -> int:
    """Print how many runs differ."""
    suite, worker = load_suite(os.environ.get("SUITE", "paper")), Worker()
    replays: dict[CompletionKey, Replay] = {}
    numbers: dict[str, Iterator[int]] = {}
    for task, program in programs(suite):
        number = numbers.setdefault(task, count())
        for scenario in suite.tasks[task].scenarios:
            replays[task, 0, next(number)] = replay(worker, suite, program, scenario.asked_by(0))
    worker.close()
    print(f"{len(replays):,} runs of programs in the worlds of {suite.name}")
    completions, rows = (make_calls if os.environ.get("DIRECT") else send_turns)(suite, replays)
    wrong = 0
    for row in rows:
        verdict = row["verdicts"][0]
        error = verdict["error"]["kind"] if verdict["error"] and verdict["status"] == "robot-error" else None
        found = verdict["satisfied"], verdict["failed_checks"], error
        if found != (expected := replays[key_of(row)].signature):
            wrong += 1
            print(key_of(row), found, expected)
    endings = Counter(one.mission.ending for one in completions if one.mission is not None)
    print(f"{len(completions):,} missions; how they ended: {dict(endings)}")
    print(f"{wrong:,} differ from their programs")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
