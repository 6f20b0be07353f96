"""Find out which steps house rules would have stopped, in simulated programs and in logged missions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from codebotler.checking.check import room_map_for
from codebotler.checking.sampled import CheckSettings, first_samplers
from codebotler.core.errors import VIOLATION, RobotError, UserError
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.phrases import phrase
from codebotler.core.trace import Outcome, trace_from
from codebotler.core.world import World
from codebotler.missions.storage.log import LogLine, MissionState, find_skill_end, read_log
from codebotler.missions.storage.map_event import map_from
from codebotler.missions.storage.past import LoggedRobot, arguments_in
from codebotler.robots.simulated import SIMULATION
from codebotler.simulator.engine import digest
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.pool import WorkerPool, cores
from codebotler.simulator.settings import Limits
from codebotler.simulator.worlds.robot import Argument, Result, SimulatedRobot
from codebotler.simulator.worlds.room_map import NO_ROOMS, RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot

LIMITED_SIMULATION = replace(SIMULATION, limits=Limits())  # nobody waits to stop an endless program


@dataclass(frozen=True)
class RuleEffect:
    """How a run ended, and the house rule that stopped it or else the first rule that refused a step."""

    ended: str  # finished, stopped, the kind of the error, or the final state of a logged mission
    rule: str = ""
    when: str = ""  # before or late (after the result of the step), or at the end
    line: int | None = None  # where the run ended, from 1
    step: str = ""  # the step that breaks the rule, in words
    error: str = ""  # the sentence of an error that no rule caused

    @classmethod
    def of(cls, broken: RuleViolationError, ended: str, line: int | None = None) -> RuleEffect:
        """Describe a broken rule and the run, which ended as `ended` says, such as `stopped`, at `line`."""
        if broken.event is None:
            return cls("finished", broken.rule.name, "at the end")
        when = "late" if broken.is_late else "before"
        return cls(ended, broken.rule.name, when, line, phrase(broken.event, "ing"))


class NotingGuard(RuleGuard):
    """A rule guard that also collects the rule violations that it raises, in the list `violations`."""

    def __init__(self, rules: Sequence[Rule], world: World | None) -> None:
        super().__init__(rules, NO_ROOMS if world is None else RoomMap.of(world))
        self.violations: list[RuleViolationError] = []

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute a skill on a robot and return its result. Record a rule violation before raising it."""
        try:
            return super().perform(robot, skill, arguments)
        except RuleViolationError as broken:
            self.violations.append(broken)
            raise

    def find_first_unkept(self) -> RuleViolationError | None:
        """If ending now would break a rule, record and return the violation; otherwise return None."""
        broken = super().find_first_unkept()
        self.violations += [broken] if broken else []
        return broken


def find_program_effects(
    programs: Iterable[str], rules: Sequence[Rule], world: World | None, skills: SkillTable
) -> Iterator[RuleEffect]:
    """Run each program once in `world`, or in a sampled world if it is None. Yield the effects in order."""
    sampler = first_samplers(CheckSettings())[0]
    with WorkerPool(cores()) as pool:

        def run_some(some: Sequence[str]) -> list[RuleEffect]:
            maps = {} if world else {program: room_map_for(program, skills=skills) for program in some}
            guards: dict[str, NotingGuard] = {}  # of each program's last run, since a worker may repeat runs

            def new_robot(program: str) -> SimulatedRobot:
                guard = guards[program] = NotingGuard(rules, world)
                if world is None:
                    return SampledRobot(maps[program], sampler, skills=skills, guard=guard)
                return SimulatedRobot(world, LIMITED_SIMULATION, skills, guard=guard)

            ended = pool.here().run_all([(program, [partial(new_robot, program)]) for program in some])
            outcomes = zip(some, ended, strict=True)
            return [_effect(end, guards[source].violations) for source, (end,) in outcomes]

        yield from pool.map_distinct(run_some, programs, name=digest)


def _effect(outcome: Outcome, violations: Sequence[RuleViolationError]) -> RuleEffect:
    ended = "finished" if outcome.error is None else outcome.error.kind
    if ended == VIOLATION:
        return RuleEffect.of(violations[-1], "stopped", outcome.line)
    if violations:  # a refusal that the program caught
        return RuleEffect.of(violations[0], ended)
    return RuleEffect(ended, line=outcome.line, error="" if outcome.error is None else outcome.error.message)


# --- logs


def find_log_effect(path: Path, rules: Sequence[Rule], world: World | None, skills: SkillTable) -> RuleEffect:
    """Return the first effect that rules would have had on the mission whose log is at `path`.

    If `world` is None, use the map in the log. Raise UserError if the log is invalid or has unknown skills.
    """
    events = read_log(path)
    try:
        world = world or next((map_from(line) for line in events if line["event"] == "map"), None)
        return _log_effect(events, NotingGuard(rules, world), LoggedRobot(world, skills))
    except (AttributeError, LookupError, TypeError, ValueError, re.error):
        sentence = "the log does not match the known skills; name the files of custom skills with --skills"
        raise UserError(sentence, file=path) from None


def _log_effect(events: Sequence[LogLine], guard: RuleGuard, robot: LoggedRobot) -> RuleEffect:
    state: LogLine = {"state": MissionState.DONE}
    for number, line in enumerate(events, 1):
        try:
            if line["event"] == "skill":
                robot.end = find_skill_end(events, number) or {"event": "cancelled"}
                guard.perform(robot, line["skill"], arguments_in(line, robot.skills))
            elif line["event"] == "rule" and line.get("prevented"):  # the log has no skill for this step
                step = trace_from([line["what"]])[0]
                attempt = replace(step, place=robot.place, holding=robot.held or "")
                recording = robot.skills.recordings.get(step.kind)
                guard.judge(attempt, is_drive=recording is not None and recording.is_drive)
            elif line["event"] == "state":
                state = line
        except RuleViolationError as broken:
            return RuleEffect.of(broken, "stopped", line.get("line"))
        except RobotError:  # it is in the log as well
            pass
    if state["state"] != MissionState.DONE:
        return RuleEffect(str(state["state"]), line=state.get("line"), error=str(state.get("reason", "")))
    unkept = guard.find_first_unkept()
    return RuleEffect("finished") if unkept is None else RuleEffect.of(unkept, "finished")
