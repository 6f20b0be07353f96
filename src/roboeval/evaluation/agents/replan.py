"""Lets a model write a program and, after each failure, another one for the rest of the mission."""

from __future__ import annotations

from dataclasses import replace

from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Outcome, RunError, Status
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import Reply
from codebotler.prompts import Prompt
from codebotler.simulator.pool import shared_pool
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.agents.conversation import Conversation, TurnLimits
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.recording import RecordingRobot
from roboeval.evaluation.recovery import rest_prompt
from roboeval.evaluation.runs.endings import ERROR, OUTSIDE_CONTRACT, TIMEOUT


class ReplanConversation(Conversation):
    """Runs a model's programs one after the other, until one of them ends without an error."""

    def __init__(self, mission: AgentMission, prompt: Prompt, limits: TurnLimits) -> None:
        super().__init__(mission, prompt, limits)
        self._first = prompt

    def _act(self, reply: Reply) -> Prompt | None:
        """Run a reply's program where the last one has stopped."""
        robot, outcome = self.mission.robot, _run(reply.program, self.mission)
        if outcome.error is None:
            self.mission.answer("")
            return None
        self.mission.mistakes[OUTSIDE_CONTRACT if robot.is_outside else outcome.error.kind] += 1
        if not _may_go_on(outcome) or self.limit is not None:
            self._end_like(outcome, outcome.error)
            return None
        why = f"{outcome.error.kind}: {outcome.error.message}"
        past = MissionPast("", self._first.instruction, "", reply.program, why, robot.trace, robot.place)
        return rest_prompt(past, self._first)

    def _end_like(self, outcome: Outcome, error: RunError) -> None:
        """End the mission as the last program ended."""
        mission = self.mission
        if mission.robot.is_outside:
            mission.end(OUTSIDE_CONTRACT)
        elif error.kind == VIOLATION:
            mission.end(ERROR)
        elif outcome.status is Status.ROBOT_ERROR:
            mission.give_up("")
        elif outcome.status is Status.TIMEOUT:
            mission.end(TIMEOUT)
        else:
            if error.kind != "Exception":  # Python's own classes may take more than a text, or quote it again
                mission.robot.lines.append(f"class {error.kind}(Exception): pass")
            mission.robot.lines.append(f"raise {error.kind}({error.message!r})")
            mission.end(ERROR)


def _may_go_on(outcome: Outcome) -> bool:
    """Whether a program failed, but neither broke a rule nor reached a limit."""
    is_failure = outcome.status in {Status.ROBOT_ERROR, Status.PYTHON_ERROR, Status.KILLED}
    return is_failure and outcome.error is not None and outcome.error.kind != VIOLATION


def _run(program: str, mission: AgentMission) -> Outcome:
    """Run a program on the robot of a mission, which cannot make its calls a second time."""
    settings, robots = mission.suite.settings, [mission.robot]
    left = settings.limits.calls - mission.robot.skill_calls  # for one program, as the mission is judged
    mission.robot.settings = replace(settings, limits=replace(settings.limits, calls=left))

    def only_robot() -> RecordingRobot:
        if not robots:
            raise EngineError("an isolated process was lost; start the command again")
        return robots.pop()

    pool = shared_pool()
    return pool.submit(lambda: pool.here().run_alone(program, only_robot)).result()
