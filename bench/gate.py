"""Measures whether calls outside an approved contract reach a robot, and what judging a call costs.

For programs of models (the corpus at CODEBOTLER_CORPUS, or else the recorded ones), the contract is derived
in the rooms of the first world of their task. Then a robot is sent calls that lie outside of it by
construction: to other rooms in several spellings, about other things, people, texts and options, in wrong
places, one call too many, and of skills that the contract lacks. The targets: of CALLS such calls, none
reaches the robot, and the 95th percentile of the time to judge an allowed call, with ten house rules as well,
is below MILLISECONDS.
"""

from __future__ import annotations

import sys
import time
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

from check import Source, real
from codebotler.checking.check import check_on, extend_check
from codebotler.checking.house_rules.file import read_rules
from codebotler.checking.sampled import CheckSettings
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Event, to_options
from codebotler.missions.live import LiveRobot, StoppedError
from codebotler.robots.base import Feedback, RobotArgument, RobotResult, ignore_feedback
from codebotler.robots.clock import Clock
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.house_rule import RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import Argument
from codebotler.simulator.worlds.room_map import RoomMap
from roboeval.suites.load import load_suite

CALLS, MILLISECONDS = 3_000, 1.0
RULES = Path(__file__).with_name("rules.yaml")
COUNT_OF_RULES = 10
RESULTS: Mapping[str, RobotResult] = MappingProxyType({"is_in_room": True, "get_current_location": ""})
SPELLINGS: tuple[Callable[[str], str], ...] = (
    str,
    str.upper,
    lambda name: f"  {name.replace(' ', '  ')} ",
    lambda name: f"the {name}",
    lambda name: unicodedata.normalize("NFD", name),
    lambda name: f"{name} or somewhere else",
    lambda name: f"^{name}$",
)


EXAMPLES: Mapping[str, list[Argument]] = MappingProxyType(
    {
        "pick": ["mug"],
        "place": ["mug"],
        "say": ["hello"],
        "go_to": ["start_loc"],
        "is_in_room": ["mug"],
        "ask": ["", "Tea?", to_options(["yes"])],
    }
)


class CountingRobot:
    """A robot that does nothing but keep the calls that reach it."""

    name, address, if_tool_dies = "counting", "", "it ended with the tool"
    rooms_are_regexes = has_pose = False
    missing: Mapping[str, str] = MappingProxyType({})

    def __init__(self) -> None:
        self.clock, self.skills = Clock(None), SKILLS
        self.reached: list[tuple[str, Sequence[RobotArgument]]] = []

    def connect(self) -> None:
        """Do nothing."""

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], on_feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Keep a call."""
        del on_feedback
        self.reached.append((skill, arguments))
        return arguments[2][0] if skill == "ask" else RESULTS.get(skill)  # type: ignore[index]  # the options

    def cancel(self) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Do nothing."""


Call: TypeAlias = tuple[str, list[Argument]]


def ask(person: str, question: str, options: Sequence[str]) -> Call:
    """Return a call that asks a question."""
    return "ask", [person, question, to_options(options)]


@dataclass(frozen=True)
class Approved:
    """A contract, and the rooms for which it was derived."""

    contract: Contract
    room_map: RoomMap

    def allowed(self, skill: str, parameter: str) -> list[str]:
        """Return exact texts that the contract allows for an argument."""
        bound = self.contract.skills.get(skill)
        texts = dict(bound.texts).get(parameter, ()) if bound is not None else ()
        return [one.parts[0] for one in texts if len(one.parts) == 1]

    def outside(self) -> Iterator[tuple[str, list[Call]]]:
        """Yield kinds of calls outside of the contract, each with the allowed calls that lead to it."""
        rooms = self.allowed("go_to", "location")
        known = {room.casefold() for room in rooms}
        others = [room for room in self.room_map.goals if room.casefold() not in known]
        for room in others if rooms else ():
            for spell in SPELLINGS:
                yield "another room", [("go_to", [spell(room)])]
        yield from self._outside_of_picks(rooms)
        for skill, parameter in (("say", "message"), ("is_in_room", "entity")):
            for text in self.allowed(skill, parameter):
                yield "another text", [(skill, [f"not {text}"])]
                often = self.contract.skills[skill].at_most
                if often is not None:
                    yield "one call too many", [(skill, [text])] * (often + 1)
        yield from self._outside_of_questions()
        for skill, arguments in EXAMPLES.items():
            if skill not in self.contract.skills:
                yield "another skill", [(skill, arguments)]

    def _outside_of_picks(self, rooms: Sequence[str]) -> Iterator[tuple[str, list[Call]]]:
        for thing in self.allowed("pick", "obj"):
            yield "another thing", [("pick", [f"{thing} holder"])]
            places = self.contract.skills["pick"].places
            for room in rooms if places is not None else ():
                if room not in (places or ()):
                    yield "the wrong place", [("go_to", [room]), ("pick", [thing])]

    def _outside_of_questions(self) -> Iterator[tuple[str, list[Call]]]:
        options = self.allowed("ask", "options")
        for person in self.allowed("ask", "person"):
            for question in self.allowed("ask", "question"):
                yield "another person", [ask(f"{person} x", question, options[:1])]
                yield "another question", [ask(person, f"{question}?", options[:1])]
                if options:
                    yield "another option", [ask(person, question, [*options, "never"])]


def send(approved: Approved, calls: Sequence[Call]) -> bool:
    """Send calls to a robot, and return whether the last one reached it."""
    robot = CountingRobot()
    guard = RuleGuard((), contracts=[approved.contract])
    room_map = approved.room_map
    live = LiveRobot(robot, lambda *_, **__: None, place=room_map.start, guard=guard, room_map=room_map)
    with suppress(RuleViolationError, StoppedError):
        for skill, arguments in calls:
            live.perform(skill, arguments)
    return len(robot.reached) >= len(calls)


def contracts(worker: Worker, sources: Sequence[Source]) -> Iterator[Approved]:
    """Derive the contracts of programs."""
    suite = load_suite()
    for task, program in sources:
        room_map = RoomMap.of(suite.tasks[task].scenarios[0].world)
        room_map = RoomMap(room_map.rooms, room_map.start, plain=True, plan=room_map.plan)
        settings = CheckSettings(1)
        found = extend_check(worker, program, check_on(worker, program, room_map, settings), settings)
        if found.contract is not None:
            yield Approved(found.contract, room_map)


def milliseconds(approved: Sequence[Approved]) -> float:
    """Return the 95th percentile of the time to judge an allowed call with ten house rules."""
    rules = read_rules(RULES)[:COUNT_OF_RULES]
    times = []
    for one in approved:
        guard = RuleGuard(rules, one.room_map, [one.contract])
        for room in one.allowed("go_to", "location"):
            row, arguments = SKILLS["go_to"], [room]
            began = time.perf_counter()
            try:
                guard.judge_call(row, arguments, one.room_map.possible_rooms(room), one.room_map.start)
                guard.judge(Event("goto", room, place=one.room_map.start), is_drive=True)
            except RuleViolationError:
                continue
            times.append(time.perf_counter() - began)
    return sorted(times)[int(len(times) * 0.95)] * 1_000


def main() -> bool:
    """Send all calls, print the figures, and return whether the targets are reached."""
    worker = Worker()
    sources = list(dict.fromkeys(real(load_suite())))
    sent: Counter[str] = Counter()
    reached: Counter[str] = Counter()
    approved = []
    for one in contracts(worker, sources[:: max(1, len(sources) // 150)]):
        approved.append(one)
        for kind, calls in one.outside():
            sent[kind] += 1
            if send(one, calls):
                reached[kind] += 1
                print(f"reached the robot: {calls} {one.contract}")
    worker.close()
    for kind, count in sent.items():
        print(f"{kind}: {count:,} calls, {reached[kind]:,} of which reached the robot")
    spent = milliseconds(approved)
    print(f"{sent.total():,} calls outside a contract, {reached.total():,} of which reached the robot")
    print(f"judging a call, 95th percentile: {spent:.3f} ms")
    return sent.total() >= CALLS and not reached and spent < MILLISECONDS


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
