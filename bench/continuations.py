"""Measures whether the rest of a mission agrees with what was seen, and repeats nothing that was done.

(a) MISSIONS=2000 missions, which are right and wrong programs and mutants in random worlds, and random steps
in a random house, end after a random step. Imagined worlds for the rest must not contradict what was seen:
each last look, each answer, the thing in hand, and each thing that was put down. LOGGED=200 of the missions
run on a simulated robot, and are read back from a log that ends at a random line.

(b) The right continuations in continuations.yaml, whose author had not seen the check, must be accepted, and
the wrong ones rejected. VERBOSE=1 prints the numbers of the others.

(c) Right programs are interrupted at each step in all worlds of their tasks, once after and once before the
result of the step is in the log. The continuations are the same program again, and the recorded ones. Those
that the check accepts must not repeat a step.
"""

from __future__ import annotations

import json
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import yaml

from codebotler.core.errors import RobotError
from codebotler.core.skills.kinds import ASK, CHECK, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.phrases import is_spoken
from codebotler.core.trace import Event, Trace, held_after
from codebotler.core.world import Person, Room, World
from codebotler.missions.mission import Mission
from codebotler.missions.storage.log import EVENTS_FILE, LogLine, MissionState, MissionSummary
from codebotler.missions.storage.past import MissionPast, read_past
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.matching import content_words, means_anybody
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot
from roboeval.evaluation.judging.judge import judge
from roboeval.evaluation.recording import SLEEP, Call, RecordingRobot
from roboeval.evaluation.recovery import check_rest
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions, recorded_model_for
from roboeval.mutation.mutants import mutants, originals, sample_mutants
from roboeval.mutation.operator import Context
from roboeval.suites.load import load_suite
from roboeval.suites.solutions import solutions

MISSIONS = int(os.environ.get("MISSIONS", "2000"))
LOGGED = int(os.environ.get("LOGGED", "200"))
WORLDS = 5  # Imagined worlds for the rest of each mission.
MUTANTS_PER_TASK = 40
ACCEPTED, REJECTED = 0.95, 0.99
CONTINUATIONS = Path(__file__).with_name("continuations.yaml")

SUITE = load_suite()


# --- (a) worlds that agree with the log


@dataclass
class KnownFacts:
    """The facts about the world that a trace shows, found without the measured code.

    A step forgets looks that it may contradict: those for longer and shorter names in its room, and all of
    its room if it is about any person.
    """

    looks: dict[tuple[str, str], bool] = field(default_factory=dict)
    answers: dict[tuple[str, str, str], Event] = field(default_factory=dict)

    @classmethod
    def of(cls, trace: Trace) -> KnownFacts:
        """Read a trace."""
        known = cls()
        for event in (one for one in trace if not one.failed):
            if event.kind == CHECK:
                known.see(event.place, event.text, is_there=bool(event.found))
                if not event.found:
                    known.forget_answers(event.place, event.text)
            elif event.kind == ASK and event.answer is not None:
                known.see(event.place, event.to or "person", is_there=True)
                known.answers[event.place, event.to or "", event.text] = event
            elif event.kind in {PICK, PLACE}:
                known.see(event.place, event.text, is_there=event.kind == PLACE)
                if event.kind == PICK:  # There may be another one.
                    del known.looks[event.place, event.text]
        return known

    def see(self, room: str, name: str, *, is_there: bool) -> None:
        """Add a look."""
        words = {*content_words(name)}
        for place, other in list(self.looks):
            shares = means_anybody(name) or means_anybody(other) or words & {*content_words(other)}
            if place == room and shares:
                del self.looks[place, other]
        self.looks[room, name] = is_there

    def forget_answers(self, room: str, name: str) -> None:
        """Forget the answers of people who left."""
        for place, who, text in list(self.answers):
            if place == room and (means_anybody(name) or {*content_words(who)} & {*content_words(name)}):
                del self.answers[place, who, text]


def contradictions(trace: Trace, room_map: RoomMap, place: str, seed: int) -> Iterator[str]:
    """Yield how imagined worlds for the rest contradict a trace."""
    known, held = KnownFacts.of(trace), held_after(trace)
    start = room_map.room(place) or room_map.start
    room_map = replace(room_map, past=trace, start=start)
    for number in range(WORLDS):
        sampler = FactSampler(seed, number, strict=number % 2 == 1)
        robot = SampledRobot(room_map, sampler)
        if robot.room != start or (robot.held or "") != held:
            yield f'the robot is in "{robot.room}" with "{robot.held}", not in "{start}" with "{held}"'
        for (room, name), is_there in known.looks.items():
            robot.room = room_map.room(room) or room
            if robot.look(name) is not is_there:
                yield f'"{name}" is {"not " * is_there}in "{room}"'
        for (room, who, text), event in known.answers.items():
            robot.room = room_map.room(room) or room
            chosen = event.options[robot.ask(who, text, event.options)].text
            if chosen != event.answer:
                yield f'"{who}" answers "{chosen}" to "{text}", not "{event.answer}"'
        if held:
            try:
                robot.put(held)
            except RobotError as error:
                yield str(error)


@cache
def programs_of(task: str) -> list[str]:
    """Return right and wrong programs for a task, and mutants."""
    known = SUITE.tasks[task]
    context = Context.of([scenario.world for scenario in known.scenarios], known.prompts)
    some = sample_mutants(mutants(originals(known), context), MUTANTS_PER_TASK, 1)
    return [*(one.program for one in solutions(known)), *(mutant.program for mutant in some)]


THINGS = ("mug", "red mug", "plate", "book", "green book")
PEOPLE = ("Anne", "Bob", "person")
ROOMS = ("hall", "kitchen", "lab", "office 1", "office 2")
HOUSE = World(
    (
        *(
            Room(name, THINGS[n % 3 :: 2], (Person(PEOPLE[n % 2], ("no", "yes")),) if n % 2 else ())
            for n, name in enumerate(ROOMS)
        ),
        Room("table", ("cup",), within="kitchen"),
    ),
    "hall",
)


def random_program(chance: random.Random) -> str:
    """Return a program of random steps, which ignores all errors."""
    lines = ["def task_program():"]
    for _ in range(chance.randint(3, 25)):
        call = chance.choice(
            [
                f"go_to({chance.choice([*ROOMS, 'table'])!r})",
                f"is_in_room({chance.choice([*THINGS, *PEOPLE, 'the mug'])!r})",
                f"ask({chance.choice(PEOPLE)!r}, {chance.choice(['Tea?', 'Coffee?'])!r}, ['yes', 'no'])",
                f"pick({chance.choice(THINGS)!r})",
                f"place({chance.choice(THINGS)!r})",
                "say('Hello')",
            ]
        )
        lines += ["    try:", f"        {call}", "    except Exception:", "        pass"]
    return "\n".join(lines) + "\n"


def random_mission(chance: random.Random) -> tuple[str, World]:
    """Return a program and a world."""
    if chance.random() < 0.5:  # noqa: PLR2004 - half of them
        return random_program(chance), HOUSE
    task = chance.choice(sorted(SUITE.tasks))
    return chance.choice(programs_of(task)), chance.choice(SUITE.tasks[task].scenarios).world


def imagined_mission(worker: Worker, chance: random.Random) -> tuple[Trace, RoomMap, str]:
    """Run a program in an imagined world up to a random step. Return the trace, the rooms and the place."""
    program, world = random_mission(chance)
    room_map = RoomMap.of(world)
    sampler = FactSampler(chance.randrange(1000), chance.randrange(1000))
    whole = worker.run_alone(program, lambda: SampledRobot(room_map, sampler)).trace
    trace = whole[: chance.randint(0, len(whole))]
    return trace, room_map, (trace[-1].destination or trace[-1].place) if trace else world.robot


def logged_mission(home: Path, chance: random.Random) -> tuple[Trace, RoomMap, str]:
    """Run a mission on a simulated robot, let its log end at a random line, and read what it did."""
    program, world = random_mission(chance)
    while "while" in program:  # It may wait forever.
        program, world = random_mission(chance)
    mission = Mission(home, "simulated")
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    with Reservation(Simulated(world, speed=None), home) as reserved, mission:
        mission.run(reserved, world.robot)
    log = mission.folder / EVENTS_FILE
    lines = log.read_text().splitlines(keepends=True)
    started = next(n for n, line in enumerate(lines, 1) if '"running"' in line)
    cut = chance.randint(started, len(lines))
    log.write_text("".join(lines[:cut]))
    summary = MissionSummary.read(mission.folder)
    summary.state = MissionState.INTERRUPTED
    summary.write(mission.folder)
    past = read_past(mission.folder, SKILLS)
    past = past.resolve(happened='"result"' in "".join(lines[cut : cut + 1]))
    return past.trace, RoomMap.of(world), past.place


def measure_worlds(worker: Worker) -> bool:
    """Print how many missions have an imagined world that contradicts what they saw."""
    wrong, looks, answers, held = 0, 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(MISSIONS):
            chance = random.Random(number)
            is_logged = number < LOGGED
            mission = logged_mission(Path(folder), chance) if is_logged else imagined_mission(worker, chance)
            found = next(contradictions(*mission, seed=number + 1_000), "")
            known = KnownFacts.of(mission[0])
            looks, answers = looks + len(known.looks), answers + len(known.answers)
            held += bool(held_after(mission[0]))
            wrong += bool(found)
            if found:
                print(f"    mission {number}: {found}")
    print(f"    {looks:,} looks, {answers:,} answers and {held:,} things in hand, each in {WORLDS} worlds")
    print(f"    {min(LOGGED, MISSIONS)} of the missions were read back from a log")
    return is_met(f"(a) of {MISSIONS:,} missions, contradicted", wrong, most=0)


# --- (b) continuations from an author who had not seen the check


def past_of(robot: SimulatedRobot, program: str) -> MissionPast:
    """Return what a robot did and saw."""
    return MissionPast("", "", "", program, "stopped", robot.trace, robot.place)


def calls_until(worker: Worker, program: str, world: World, events: int) -> tuple[Call, ...]:
    """Return the calls of a program in a world until it has so many events."""
    robot = RecordingRobot(world, SUITE)
    worker.run_alone(program, lambda: robot)
    count = next(n for n in range(len(robot.calls) + 1) if has_events(world, robot.calls[:n], events))
    return tuple(robot.calls[:count])


def has_events(world: World, made: Sequence[Call], events: int) -> bool:
    """Return whether calls have so many events."""
    return len(RecordingRobot(world, SUITE, earlier_calls=made).trace) >= events


def measure_continuations(worker: Worker) -> bool:
    """Print how many right continuations are accepted, and how many wrong ones rejected."""
    cases = yaml.safe_load(CONTINUATIONS.read_text())
    counts: Counter[tuple[str, bool]] = Counter()
    unfit = 0
    for number, case in enumerate(cases):
        scenario = SUITE.tasks[case["task"]].scenarios[case["world"]]
        made = calls_until(worker, case["begun"], scenario.world, case["cut"])
        past = past_of(RecordingRobot(scenario.world, SUITE, earlier_calls=made), case["begun"])
        room_map, _ = past.add_to(RoomMap.of(scenario.world), past.place)
        problems = check_rest(worker, SUITE, case["program"], room_map, case["begun"]).problems
        sort = "right" if case["right"] else case["wrong"]
        counts[sort, not problems] += 1
        outcome = worker.run_alone(
            case["program"], partial(RecordingRobot, scenario.world, SUITE, earlier_calls=made)
        )
        unfit += case["right"] and not judge(outcome, scenario).satisfied
        if os.environ.get("VERBOSE") and case["right"] is bool(problems):
            why = problems[0].sentence if problems else "accepted"
            print(f"    {number}, {case['task']}, {sort}: {why}")
    for sort in dict.fromkeys(sort for sort, _ in counts):
        accepted, rejected = counts[sort, True], counts[sort, False]
        print(f"    {sort}: {accepted} accepted, {rejected} rejected")
    print(f"    {unfit} right ones do not satisfy all prompts of their task in their world")
    right = counts["right", True], counts["right", False]
    wrong = [
        sum(n for (sort, ok), n in counts.items() if sort != "right" and ok is yes) for yes in (False, True)
    ]
    return is_met("(b) right continuations accepted", right[0] / sum(right), least=ACCEPTED) & is_met(
        "(b) wrong continuations rejected", wrong[0] / sum(wrong), least=REJECTED
    )


# --- (c) crashes at each step


class LoggingRobot(RecordingRobot):
    """A robot that keeps a log of its skills, as a mission does."""

    def __init__(self, world: World) -> None:
        super().__init__(world, SUITE)
        self.log: list[tuple[LogLine, LogLine]] = []  # the start and the end of each call

    def perform(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - of several kinds
        """Execute a skill, and log it."""
        row = self.skills[skill]
        plain = [[one.text for one in each] if isinstance(each, tuple) else each for each in arguments]
        named = dict(zip((parameter.name for parameter in row.parameters), plain, strict=True))
        which = {"number": len(self.log) + 1, "skill": skill, "time": 0.0, "clock": 0.0}
        end: LogLine = {**which, "event": "error", "kind": "", "message": ""}
        try:
            result = super().perform(skill, arguments)
            offered = [each for each in plain if isinstance(each, list)]
            answer = offered[0][int(str(result))] if offered else result
            end = {**which, "event": "result", "result": answer}
            return result
        finally:
            self.log.append(({**which, "event": "skill", "arguments": named}, end))


@dataclass(frozen=True)
class Crash:
    """A mission during which the tool crashed.

    Args:
        made: the calls that the robot really made.
        past: what is known of them.
        whole: the trace without the crash.
        world: the world.
    """

    made: tuple[Call, ...]
    past: MissionPast
    whole: Trace
    world: World


def crashes(worker: Worker, one: Completion, folder: Path) -> Iterator[Crash]:
    """Interrupt a program before and after the result of each call, in all worlds of its task."""
    task = SUITE.tasks[one.task]
    for scenario in task.scenarios:
        robot = LoggingRobot(scenario.world)
        outcome = worker.run_alone(one.program, lambda robot=robot: robot)  # type: ignore[misc]  # mypy infers no type of a default
        if outcome.error is not None or not judge(outcome, scenario.asked_by(one.prompt)).satisfied:
            continue
        calls = tuple(robot.calls)
        skills = [number for number, (name, _) in enumerate(calls) if name != SLEEP]
        crash = partial(Crash, whole=outcome.trace, world=scenario.world)
        for at, number in enumerate(skills):
            before = [line for pair in robot.log[:at] for line in pair]
            start, end = robot.log[at]
            read = partial(read_log, folder, task.prompts[one.prompt], one.program, scenario.world)
            yield crash(calls[: number + 1], read([*before, start, end]))
            unsure = read([*before, start])
            yield crash(calls[: number + 1], unsure.resolve(happened=True))
            yield crash(calls[:number], unsure.resolve(happened=False))


def read_log(
    folder: Path, instruction: str, program: str, world: World, lines: Sequence[LogLine]
) -> MissionPast:
    """Write the log of a mission that was interrupted, and read it."""
    running = {"event": "state", "state": MissionState.RUNNING, "time": 0.0, "clock": 0.0}
    (folder / EVENTS_FILE).write_text("".join(json.dumps(line) + "\n" for line in [running, *lines]))
    MissionSummary(
        "", MissionState.INTERRUPTED, "simulated", 0.0, instruction, program=program, place=world.robot
    ).write(folder)
    return read_past(folder, SKILLS)


def find_repeats(crash: Crash, rest: Trace) -> list[str]:
    """Return the steps of a continuation that were done before, unless the whole mission needs them again."""

    def keys(trace: Trace) -> Counter[tuple[str, ...]]:
        return Counter(
            (one.kind, one.text.casefold(), one.place, (one.to or "").casefold())
            for one in trace
            if is_spoken(one.kind) or one.kind in {PICK, PLACE}
        )

    done, again = keys(RecordingRobot(crash.world, SUITE, earlier_calls=crash.made).trace), keys(rest)
    needed = keys(crash.whole)
    return [" ".join(key) for key in again if done[key] and done[key] + again[key] > max(1, needed[key])]


def measure_crashes(worker: Worker) -> bool:
    """Print how many continuations after a crash are accepted, and how many of these repeat a step."""
    models = [recorded_model_for(name, SUITE) for name in ("recorded:careful", "recorded:hasty")]
    accepted: dict[tuple[object, ...], bool] = {}
    counts: Counter[str | tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for one in recorded_completions("recorded:careful", SUITE):
            for crash in crashes(worker, one, Path(folder)):
                step = (crash.past.done or ["nothing"])[-1]
                rests = (model.rests.get((crash.past.instruction, step)) for model in models)
                counts["crashes"] += 1
                for program in filter(None, [one.program, *rests]):
                    again = partial(RecordingRobot, crash.world, SUITE, earlier_calls=crash.made)
                    robot = again()
                    room_map, _ = crash.past.add_to(RoomMap.of(crash.world), robot.place)
                    places = tuple((event.place, event.to) for event in room_map.past)
                    key = program, one.program, room_map, places  # `==` of events ignores their places
                    if key not in accepted:
                        found = check_rest(worker, SUITE, program, room_map, one.program)
                        accepted[key] = not found.problems
                    rest = worker.run_alone(program, again).trace[len(robot.trace) :]
                    verdict = "accepted" if accepted[key] else "rejected"
                    steps = find_repeats(crash, rest)
                    counts[verdict] += 1
                    counts[verdict, "repeats"] += bool(steps)
                    if steps and accepted[key] and os.environ.get("VERBOSE"):
                        print(f"    {one.task}, {one.prompt}, {crash.past.steps[-1:]}: {steps[0]}")
    print(f"    {counts['crashes']:,} crashes; of {counts['rejected']:,} continuations that were rejected,")
    print(f"    {counts['rejected', 'repeats']:,} would have repeated a step")
    what = f"(c) of {counts['accepted']:,} that were accepted, repeat a step"
    return is_met(what, counts["accepted", "repeats"], most=0)


# --- the report


def is_met(what: str, value: float, *, least: float | None = None, most: float | None = None) -> bool:
    """Print a value with its target. Return whether it is met."""
    is_ok = (least is None or value >= least) and (most is None or value <= most)
    target = f"at least {least}" if least is not None else f"at most {most}"
    print(f"{what}: {value:.3f}".removesuffix(".000"), f"({target})", "ok" if is_ok else "MISSED", flush=True)
    return is_ok


def main() -> int:
    """Print all figures. Return 1 if a target is missed. Arguments such as `b` choose some of them."""
    parts: dict[str, Callable[[Worker], bool]] = {
        "a": measure_worlds,
        "b": measure_continuations,
        "c": measure_crashes,
    }
    with closing(Worker()) as worker:
        met = [parts[name](worker) for name in sys.argv[1:] or parts]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
