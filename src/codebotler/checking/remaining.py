"""Find what an interrupted program would still do after the steps that the robot has done."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import partial

from codebotler.checking.sampled import CheckSettings, first_samplers
from codebotler.core.errors import RobotError
from codebotler.core.skills.calling import SKILL_FAILED
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome, Status, attempted_event
from codebotler.simulator.pool import shared_pool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.robot import Argument, Result
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot


def remaining_outcomes(
    begun: str, room_map: RoomMap, skills: SkillTable, *, first: int = 0, worker: Worker | None = None
) -> tuple[Outcome, ...]:
    """Return what an interrupted program would still do, with one outcome per world where it does not fail.

    The result is empty if the program always fails, or does not repeat the steps in `room_map.past`.

    Args:
        begun: the source of the interrupted program.
        room_map: the rooms, and in `past` the steps that the robot has done.
        skills: the robot's skills.
        first: the number of these steps that the robot had done before the program began.
        worker: a worker that no other thread uses; by default one of the shared pool.
    """
    if worker is None:
        pool = shared_pool()
        return pool.call(lambda: remaining_outcomes(begun, room_map, skills, first=first, worker=pool.here()))
    settings, found = CheckSettings(skills=skills), []
    robots: list[RepeatingRobot] = []  # of all runs, since a run is repeated if its process is lost

    def begin(sampler: FactSampler) -> RepeatingRobot:
        robots.append(RepeatingRobot(room_map, sampler, settings, first))
        return robots[-1]

    for sampler in first_samplers(settings):
        outcome = worker.run_alone(begun, partial(begin, sampler))
        if outcome.status in {Status.FINISHED, Status.TIMEOUT} and not robots[-1].left:
            found.append(outcome)
    return tuple(found)


class RepeatingRobot(SampledRobot):
    """A robot that first replays the recorded results of earlier steps, then acts in a sampled world."""

    def __init__(self, room_map: RoomMap, sampler: FactSampler, how: CheckSettings, first: int) -> None:
        super().__init__(room_map, sampler, how.simulation, how.skills)
        self.left = deque(event for event in room_map.past[first:] if not event.failed)

    def execute(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Replay the next recorded step or, after the last, act. Raise RobotError if the call differs."""
        if not self.left:
            return super().execute(skill, arguments)
        row, past = self.skills[skill], self.left[0]
        event = attempted_event(row, arguments, place=past.place, time=self.now)
        if event is None:
            here, self.room = self.room, self.room_for(past.place) or self.room
            try:
                return super().execute(skill, arguments)
            finally:
                self.room = here
        if (event.kind, event.text.casefold()) != (past.kind, past.text.casefold()):
            raise RobotError(SKILL_FAILED, "the call failed in the interrupted mission")
        self.left.popleft()
        if not event.options:
            return past.found
        texts = [option.text.casefold() for option in event.options]
        if (past.answer or "").casefold() not in texts:
            raise RobotError(SKILL_FAILED, "nobody answered")
        return texts.index((past.answer or "").casefold())
