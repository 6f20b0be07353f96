"""Lets each skill call of right programs fail once, and judges the continuations that a model writes."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

from codebotler.checking.check import check_on
from codebotler.checking.problems import CheckResult
from codebotler.checking.remaining import remaining_outcomes
from codebotler.checking.repetition import with_repetition_problems
from codebotler.checking.sampled import CheckSettings
from codebotler.core.skills.kinds import PICK, PLACE
from codebotler.core.text.phrases import is_spoken
from codebotler.core.trace import Status, Trace
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import Model, ModelError
from codebotler.models.rate_limit import RateLimited
from codebotler.models.recorded import is_recorded
from codebotler.prompts import Prompt, prompt_for
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.room_map import RoomMap
from roboeval.evaluation.judging.judge import judge
from roboeval.evaluation.recording import Call, RecordingRobot
from roboeval.evaluation.runs.completions import Completion
from roboeval.suites.load import Scenario, Suite


@dataclass(frozen=True)
class FaultResult:
    """The result of a mission in which one skill call was made to fail: its end and its number of steps."""

    task: str
    world: int  # the index of its world
    call: int  # the index of the call
    shortest: int  # the number of events without the fault
    end: Literal["handled", "missing", "rejected", "failed", "passed"] = "handled"  # by the program
    why: str = ""  # the problem, error or requirement because of which the rest was rejected or failed
    steps: int = 0  # the number of events of the whole mission; 0 if no rest was run
    repeated: int = 0  # how many more times the robot spoke, picked up or put down than without the fault


@dataclass(frozen=True)
class Interruption:
    """A mission that ended when a skill call failed, with the data needed to ask a model for the rest."""

    result: FaultResult  # which mission, and which fault
    scenario: Scenario = field(repr=False)  # its world, and what its prompt asks for
    earlier_calls: Sequence[Call] = field(repr=False)  # before the fault
    trace_without_fault: Trace = field(repr=False)
    past: MissionPast = field(repr=False)  # what the mission did, and why it ended

    @property
    def room_map(self) -> RoomMap:
        """The room map, including what the mission did and saw before it ended."""
        return self.past.add_to(RoomMap.of(self.scenario.world), self.past.place)[0]

    def prompt(self, suite: Suite) -> Prompt:
        """Return the prompt that asks a model for a program for the rest of the mission."""
        rules, rooms = suite.house_sentences, self.room_map.described
        whole = prompt_for(self.past.instruction, rooms=rooms, rules=rules, skills=suite.skills)
        return rest_prompt(self.past, whole)


def rest_prompt(past: MissionPast, request: Prompt) -> Prompt:
    """Return the prompt for the rest of a mission, given its past and the prompt for the whole mission."""
    last_step = (past.done or [""])[-1]
    return request.to_continue(past.program, past.steps, past.why, past.position_text(past.place), last_step)


def find_interruptions(worker: Worker, suite: Suite, one: Completion) -> list[Interruption | FaultResult]:
    """In each world of its task, run a program once for each of its skill calls, and make that call fail.

    Returns an Interruption for each run that ended with an error, and a FaultResult for each run in which the
    program handled the error itself. The list is empty if the program is wrong without any fault.
    """
    found: list[Interruption | FaultResult] = []
    task = suite.task(one.task)
    for number, scenario in enumerate(task.scenarios):
        asked, robot = scenario.asked_by(one.prompt), RecordingRobot(scenario.world, suite)
        whole = worker.run_on(one.program, robot)
        if not judge(whole, asked).satisfied:
            return []
        for call in range(robot.skill_calls if whole.status is Status.FINISHED else 0):
            faulty = RecordingRobot(scenario.world, suite, fault=call)
            outcome = worker.run_on(one.program, faulty)
            result = FaultResult(one.task, number, call, len(whole.trace))
            if outcome.error is None:
                found.append(result)
                continue
            why, instruction = f"{outcome.error.kind}: {outcome.error.message}", task.prompts[one.prompt]
            past = MissionPast("", instruction, "", one.program, why, outcome.trace, faulty.place)
            found.append(Interruption(result, asked, tuple(faulty.calls), whole.trace, past))
    return found


def find_first_right(
    worker: Worker, suite: Suite, completions: Iterable[Completion]
) -> Iterator[list[Interruption | FaultResult]]:
    """Find interruptions only in the first right program of each task.

    Yields the result of `find_interruptions` for each completion, such as [] for a wrong program. After the
    first right program of a task, yields [] for the other completions of the task.
    """
    done: set[str] = set()
    for one in completions:
        found = [] if one.task in done else find_interruptions(worker, suite, one)
        done |= {one.task} if found else set()
        yield found


def check_rest(worker: Worker, suite: Suite, program: str, room_map: RoomMap, begun: str) -> CheckResult:
    """Check a program that completes a mission. It must not repeat steps of the first program, `begun`."""
    settings = CheckSettings(skills=suite.skills, house_rules=suite.house_rules)
    left = remaining_outcomes(begun, room_map, suite.skills, worker=worker)
    return with_repetition_problems(check_on(worker, program, room_map, settings), begun, left)


def try_continuation(worker: Worker, suite: Suite, one: Interruption, program: str | None) -> FaultResult:
    """Check and run a program that does the rest of an interrupted mission, and judge the whole mission.

    The `end` of the result is `missing` if `program` is None, and `rejected` if the check finds problems.
    """
    if program is None:
        return replace(one.result, end="missing")
    problems = check_rest(worker, suite, program, one.room_map, one.past.program).problems
    if problems:
        return replace(one.result, end="rejected", why=problems[0].sentence)
    robot = partial(RecordingRobot, one.scenario.world, suite, earlier_calls=one.earlier_calls)
    outcome = worker.run_alone(program, robot)
    verdict = judge(outcome, one.scenario)
    faults = [requirement.text for requirement in verdict.failed]
    faults += [] if outcome.error is None else [f"{outcome.error.kind}: {outcome.error.message}"]
    return replace(
        one.result,
        end="passed" if verdict.satisfied else "failed",
        why="" if verdict.satisfied else faults[0],
        steps=len(outcome.trace),
        repeated=(_effects(outcome.trace) - _effects(one.trace_without_fault)).total(),
    )


def _effects(trace: Trace) -> Counter[str]:
    return Counter(event.kind for event in trace if is_spoken(event.kind) or event.kind in {PICK, PLACE})


def write_continuations(
    model: Model, prompts: Sequence[Prompt], concurrency: int, update: Callable[[int, str], None]
) -> list[str | None]:
    """Return a program for each prompt, or None if the model refuses or has no recorded program.

    At most `concurrency` requests run at a time. Equal prompts are sent once. `update` is called with the
    number of replies and an empty text. The model is closed at the end.
    """
    limited, programs = RateLimited(model, concurrency), dict[Prompt, str | None]()

    async def write(prompt: Prompt) -> None:
        try:
            programs[prompt] = (await limited.reply(prompt, number=0)).program
        except ModelError as error:
            if not (error.is_refusal or is_recorded(model.name)):
                raise
            programs[prompt] = None
        update(len(programs), "")

    async def write_all() -> None:
        try:
            await asyncio.gather(*map(write, dict.fromkeys(prompts)))
        finally:
            await model.close()

    asyncio.run(write_all())
    return [programs[prompt] for prompt in prompts]


def recovery_data(results: Sequence[FaultResult]) -> dict[str, int | float | None]:
    """Count missions and steps. Also return shares of the continued missions, each None if there are none."""
    ends = Counter(one.end for one in results)
    passed = [one for one in results if one.end == "passed"]
    continued = len(results) - ends["handled"] - ends["missing"]
    return {
        "faults": len(results),
        "handled": ends["handled"],
        "missing": ends["missing"],
        "continued": continued,
        "passed": len(passed) / continued if continued else None,
        "rejected": ends["rejected"] / continued if continued else None,
        "failed": ends["failed"] / continued if continued else None,
        "steps": sum(one.steps for one in passed),
        "shortest_steps": sum(one.shortest for one in passed),
        "repeated": sum(one.repeated for one in results),
    }
