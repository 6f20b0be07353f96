"""Lets a model write a program and, after each failure, another one for the rest of the mission."""

from __future__ import annotations

from collections.abc import Sequence

from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Outcome, Status
from codebotler.missions.past import MissionPast
from codebotler.models.base import Reply
from codebotler.prompts import Prompt
from codebotler.prompts.tools import GIVE_UP
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.agents.conversation import Conversation, TurnLimits
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.recovery import SLEEP, Call, RecordingRobot, rest_prompt
from roboeval.evaluation.runs.endings import OUTSIDE_CONTRACT, TIMEOUT


class ReplanConversation(Conversation):
    """Runs a model's programs one after the other, until one of them ends without an error.

    All calls of the programs are made in the mission at its end.
    """

    def __init__(self, mission: AgentMission, prompt: Prompt, limits: TurnLimits) -> None:
        super().__init__(mission, prompt, limits)
        self._first = prompt
        self._calls: Sequence[Call] = ()

    def end(self, ending: str, why: str = "") -> None:
        """End the mission for a reason outside of it, after the calls so far."""
        self._make_calls()
        self.prompt = None
        if self.mission.ending is None:
            self.mission.end(ending, why)

    def _act(self, reply: Reply) -> Prompt | None:
        """Run a reply's program where the last one has stopped."""
        robot, outcome = _run(reply.program, self.mission, self._calls)
        self._calls = robot.calls
        if not _may_go_on(outcome) or self.limit is not None:
            self._end_like(outcome)
            return None
        assert outcome.error is not None, "the mission may go on only after an error"
        why = f"{outcome.error.kind}: {outcome.error.message}"
        self.mission.mistakes[outcome.error.kind] += 1
        instruction = self._first.instruction
        past = MissionPast("", instruction, "", reply.program, why, outcome.trace, robot.place)
        return rest_prompt(past, self._first)

    def _make_calls(self) -> None:
        """Make all calls in the mission. Their errors are counted already."""
        mission, mistakes = self.mission, self.mission.mistakes.copy()
        for name, arguments in self._calls:
            if name == SLEEP:
                mission.sleep_until(float(arguments[0]))  # type: ignore[arg-type]  # a number of seconds
            else:
                mission.repeat(mission.suite.skills[name], arguments)
        mission.mistakes = mistakes

    def _end_like(self, outcome: Outcome) -> None:
        """Make all calls in the mission, and end it as the last program ended."""
        self._make_calls()
        mission = self.mission
        if outcome.error is not None:
            is_outside = mission.ending == OUTSIDE_CONTRACT
            mission.mistakes[OUTSIDE_CONTRACT if is_outside else outcome.error.kind] += 1
        if mission.ending is not None:
            return
        if outcome.error is None:
            mission.answer("")
        elif outcome.status is Status.ROBOT_ERROR:
            mission.call(GIVE_UP, {})
        elif outcome.status is Status.TIMEOUT:
            mission.end(TIMEOUT)
        else:
            mission.crash(outcome.error.kind, outcome.error.message)


def _may_go_on(outcome: Outcome) -> bool:
    """Whether a program failed, but neither broke a rule nor reached a limit."""
    is_failure = outcome.status in {Status.ROBOT_ERROR, Status.PYTHON_ERROR, Status.KILLED}
    return is_failure and outcome.error is not None and outcome.error.kind != VIOLATION


def _run(program: str, mission: AgentMission, made: Sequence[Call]) -> tuple[RecordingRobot, Outcome]:
    """Run a program on a robot that has made some calls already."""
    robots: list[RecordingRobot] = []

    def new_robot() -> RecordingRobot:
        world, contracts = mission.scenario.world, mission.contracts
        robots.append(RecordingRobot(world, mission.suite, made=made, contracts=contracts))
        return robots[-1]

    pool = shared_pool()
    outcome = pool.submit(lambda: pool.here().run_alone(program, new_robot)).result()
    if not robots:  # the program does not parse
        new_robot()
    return robots[-1], outcome
