"""Replays the transcripts of a batch on the engine's own robots, and rejects false transcripts."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import msgspec

from codebotler.core.skills.table import Parameter, SkillTable
from codebotler.core.skills.values import Scalar
from codebotler.core.trace import Option, Outcome, Status
from codebotler.simulator.ledger import RememberingLedger, SkillAnswer, judge_end
from codebotler.simulator.process.errors import LostProcessError, ProtocolError
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.sandbox import MAX_FRAME
from codebotler.simulator.skill_protocol import SkillDescriptions, describe_skills
from codebotler.simulator.worlds.robot import Argument, Setup, SimulatedRobot

Programs: TypeAlias = Sequence[tuple[bytes, Sequence[SimulatedRobot]]]
"""Each program's code, with one robot for each run. All robots have the same skills."""


class Call(NamedTuple):
    """A skill call, and the answer that the program got from the copy of the robot in its process."""

    skill: str
    arguments: tuple[Scalar | tuple[Option | Scalar, ...], ...]
    now: float  # the time on the program's clock
    kind: str  # kind of answer; `ask` if only the engine can give it
    value: Any


class Transcript(msgspec.Struct, array_like=True, forbid_unknown_fields=True):
    """A process's record of one run of a program: its skill calls with their answers, and how it ended."""

    calls: list[Call]
    now: float  # the time on the clock when the report was written
    end: dict[str, Any] | None  # None if the child is waiting for the answer to the last call


ReplayKey: TypeAlias = tuple[Any, ...]  # a received transcript, and the ids of the parts of its robot
MAX_REPLAYS, MAX_REPLAY_BYTES = 2_048, 4_096  # cached transcripts, and bytes of each
# Cached outcomes. Each entry keeps the objects of its key alive so that their ids are not reused.
REPLAYED: dict[ReplayKey | None, tuple[Outcome, SkillTable, Setup]] = {}
TRANSCRIPT_DECODER = msgspec.json.Decoder(Transcript | None)


def message(
    programs: Programs,
) -> tuple[SkillDescriptions, tuple[str, ...], bytes, list[tuple[bytes, list[int]]]]:
    """Return the message that sends a batch of programs to the process that runs them.

    Its four parts are the descriptions of all skills, the names of those that only the engine can execute,
    the pickled robots, and a list of each program's code with the indexes of its robots.
    """
    robot = programs[0][1][0]
    setups: dict[tuple[int, ...], Setup] = {}
    keyed = []
    for code, robots in programs:
        keys = [tuple(map(id, each.setup[1])) for each in robots]
        setups.update(zip(keys, (each.setup for each in robots), strict=True))
        keyed.append((code, keys))
    numbers = {key: number for number, key in enumerate(setups)}
    numbered = [(code, [numbers[key] for key in keys]) for code, keys in keyed]
    return describe_skills(robot), robot.own_skills, pickle.dumps(list(setups.values()), protocol=5), numbered


def outcomes(child: IsolatedProcess, programs: Programs) -> Iterator[Outcome | None]:
    """Run programs in a child process, and yield their outcomes in order.

    An outcome is None if the run must be repeated in its own process. Raise LostProcessError, ProtocolError
    or TimeoutError if the child can no longer be used.
    """
    child.send(message(programs))
    for _, robots in programs:
        for robot in robots:
            yield _outcome(child, robot)


def _outcome(child: IsolatedProcess, robot: SimulatedRobot) -> Outcome | None:
    frame = _frame(child)
    key = key_of(frame, robot)
    if (known := REPLAYED.get(key)) is not None:  # another thread may clear the cache
        return known[0]
    replay = Replay(robot)
    while (transcript := parse_transcript(frame)) is not None:
        answer = replay.follow(transcript)
        if replay.ledger.broken is not None:
            if transcript.end is None:
                raise ProtocolError("a rule has ended the run, but the program's process tries to go on")
            return None  # repeat the run in its own process, to learn at which line the rule ended it
        if transcript.end is not None:
            outcome = judge_end(replay.ledger.outcome_at_end(transcript.end), robot)
            if outcome.status is Status.KILLED:
                raise ProtocolError("the program's process sent an invalid report on how the run ended")
            if key is not None:
                if len(REPLAYED) >= MAX_REPLAYS:
                    REPLAYED.clear()
                REPLAYED[key] = outcome, robot.skills, robot.setup
            return outcome
        child.send((*answer, robot.now))
        frame = _frame(child)
    return None


def _frame(child: IsolatedProcess) -> bytes:
    frame = child.receive_bytes(MAX_FRAME)
    if frame is None:
        raise LostProcessError("the process that runs a batch exited before the batch was finished")
    return frame


def key_of(frame: bytes, robot: SimulatedRobot) -> ReplayKey | None:
    """Return the cache key of a transcript (`frame`) for this robot, or None if it must not be cached."""
    if len(frame) > MAX_REPLAY_BYTES or robot.setup[0] != "simulated" or robot.own_skills or robot.guard:
        return None
    return frame, id(robot.skills), *map(id, robot.setup[1])


def parse_transcript(frame: bytes) -> Transcript | None:
    """Parse a transcript. Return None if the run must be repeated. Raise ProtocolError if it is invalid."""
    try:
        return TRANSCRIPT_DECODER.decode(frame)  # type: ignore[no-any-return]  # the decoder returns this type
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        raise ProtocolError("the program's process sent an invalid record of a run") from None


class Replay:
    """Checks the record of a run: repeats its skill calls on the engine's robot, and compares the answers."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot, self.ledger = robot, RememberingLedger(robot)
        self._own = robot.own_skills

    def follow(self, transcript: Transcript) -> SkillAnswer:
        """Repeat a transcript's calls. Return the last answer. Raise ProtocolError if any answer differs."""
        calls = [self._expected(call) for call in transcript.calls]
        if transcript.end is None and (not calls or calls[-1][-1] is not None):
            raise ProtocolError("the record of a run has neither an end nor an unanswered skill call")
        ledger = self.ledger
        answer: SkillAnswer = ("ok", None)
        for skill, arguments, now, expected in calls:
            if now != self.robot.now:
                self._let_time_pass(now)
            if ledger.limit is not None:
                raise ProtocolError("the record of a run has skill calls after the run reached a limit")
            answer = ledger.perform(skill, arguments)
            if ledger.broken is not None:
                return answer
            answered = answer if answer[0] != "error" else ("error", answer[1][1:])
            if expected is not None and expected != answered:
                raise ProtocolError(f"{skill} answered differently in the program's process and the engine")
        if transcript.end is not None:
            self._let_time_pass(transcript.now)
        return answer

    def _let_time_pass(self, now: float) -> None:
        if now < self.robot.now:
            raise ProtocolError("the record of a run has a time that is earlier than the one before it")
        if self.ledger.limit is None:
            self.ledger.let_time_pass(now)

    def _expected(self, call: Call) -> tuple[str, Sequence[Argument], float, SkillAnswer | None]:
        """Return a call with its time and expected answer, which is None if only the engine knows it."""
        skill = self.robot.skills.get(call.skill)
        known = () if skill is None else skill.parameters
        if skill is None or len(known) != len(call.arguments) or not all(map(_fits, known, call.arguments)):
            raise ProtocolError(f'the record of a run has an invalid call of the skill "{call.skill[:100]}"')
        if call.kind == "ask" and call.skill not in self._own:
            raise ProtocolError(f"the program's process must execute {call.skill} itself, not ask the engine")
        value = tuple(call.value) if call.kind == "error" and isinstance(call.value, list) else call.value
        arguments: Any = call.arguments  # checked above
        return call.skill, arguments, call.now, None if call.kind == "ask" else (call.kind, value)


def _fits(parameter: Parameter, given: object) -> bool:
    if parameter.is_options:
        return isinstance(given, tuple) and all(isinstance(each, Option) for each in given)
    return parameter.type.fits(given)
