"""Batches of tame programs: a child runs them, and what it says of them is replayed on robots of our own."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import msgspec

from codebotler.core.trace import Outcome
from codebotler.simulator.isolated_process import IsolatedProcess, LostProcessError, ProtocolError
from codebotler.simulator.ledger import RememberingLedger
from codebotler.simulator.robot import Argument, Setup, SimulatedRobot
from codebotler.simulator.sandbox import MAX_FRAME, ONLY_TIME
from codebotler.simulator.skill_protocol import Description, arguments_of, described

Programs: TypeAlias = Sequence[
    tuple[bytes, Sequence[SimulatedRobot]]
]  # code of each, and a robot for each run


class Transcript(msgspec.Struct, array_like=True, forbid_unknown_fields=True):
    """What a child says of a run: what the program asked of its robot, and how it ended."""

    calls: list[tuple[str, list[Any], str, Any]]  # different ones: skill, arguments, kind of answer, answer
    order: list[int]  # of each call that was made, its place in `calls`
    moments: list[tuple[int, float]]  # from which call on the program's clock shows what
    end: dict[str, Any] | None  # None where the child waits for the answer to the last call


DECODER = msgspec.json.Decoder(Transcript | None)


def message(programs: Programs) -> tuple[Description, tuple[str, ...], bytes, list[tuple[bytes, list[int]]]]:
    """What a child is told of programs whose robots all have the same skills."""
    robot = programs[0][1][0]
    setups: dict[tuple[int, ...], Setup] = {}
    told = []
    for code, robots in programs:
        keys = [tuple(map(id, each.setup[1])) for each in robots]
        setups.update(zip(keys, (each.setup for each in robots), strict=True))
        told.append((code, keys))
    numbers = {key: number for number, key in enumerate(setups)}
    numbered = [(code, [numbers[key] for key in keys]) for code, keys in told]
    return described(robot), robot.own_skills, pickle.dumps(list(setups.values()), protocol=5), numbered


def outcomes(child: IsolatedProcess, programs: Programs) -> Iterator[Outcome | None]:
    """Let a child run programs; the outcome of each run in order, None where another process must decide.

    Raises LostProcessError, ProtocolError or TimeoutError where the child says no more that can be used.
    """
    child.send(message(programs))
    for _, robots in programs:
        for robot in robots:
            yield _outcome(child, robot)


def _outcome(child: IsolatedProcess, robot: SimulatedRobot) -> Outcome | None:
    replay = Replay(robot)
    while True:
        frame = child.receive_bytes(MAX_FRAME)
        if frame is None:
            raise LostProcessError("a child ended in the middle of a batch")
        try:
            transcript = DECODER.decode(frame)
        except msgspec.DecodeError:
            raise ProtocolError("a transcript is malformed") from None
        if transcript is None:
            return None
        answer = replay.follow(transcript)
        if transcript.end is not None:
            return replay.ledger.ended(transcript.end)
        child.send(answer)


class Replay:
    """Does on the engine's own robot what a child says that a program asked of its copy."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot, self.ledger = robot, RememberingLedger(robot)

    def follow(self, transcript: Transcript) -> tuple[str, object]:
        """Perform what was asked and return the last answer; a ProtocolError where one is not as was said."""
        calls = [self._performed(call) for call in transcript.calls]
        ledger, now = self.ledger, self.robot.now
        moments = iter((*transcript.moments, (len(transcript.order), now)))
        changes, later = next(moments)
        told: tuple[str, object] = ("ok", None)
        for number, place in enumerate(transcript.order):
            if ledger.limit is not None:
                raise ProtocolError("the program goes on beyond a limit")
            if number == changes:
                ledger.let_time_pass(later)
                changes, later = next(moments)
            if place == ONLY_TIME:
                continue
            name, arguments, expected = calls[place]
            told = kind, value = ledger.perform(name, arguments)
            if expected is not None and expected != (kind, value[1:] if kind == "error" else value):
                raise ProtocolError("the robot answers otherwise")
        return told

    def _performed(
        self, call: tuple[str, list[Any], str, Any]
    ) -> tuple[str, list[Argument], tuple[str, object] | None]:
        name, values, kind, value = call
        if name not in self.robot.skills:
            raise ProtocolError("there is no such skill")
        expected = None if kind == "ask" else (kind, tuple(value) if kind == "error" else value)
        return name, arguments_of(self.robot.skills[name], values), expected
