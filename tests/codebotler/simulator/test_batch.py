"""Tame programs that share a child have the same outcomes as in processes of their own."""

import json
import os
import signal
import threading
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing
from functools import partial
from itertools import islice
from types import MappingProxyType
from typing import Any
from unittest.mock import Mock

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Recording, Skill, SkillTable
from codebotler.core.skills.values import TEXT_TYPE
from codebotler.core.trace import Event, Option, RunError, Status, Trace
from codebotler.core.world import Person, Room, World
from codebotler.simulator.batches.replay import Replay, Transcript, key_of, parse_transcript
from codebotler.simulator.ledger import Ledger, RememberingLedger, SkillAnswer
from codebotler.simulator.pool import MAX_BATCH_KEYS, MAX_KEYS_AHEAD, MIN_BATCH_KEYS, DistinctKeys, WorkerPool
from codebotler.simulator.process.errors import LostProcessError, ProtocolError
from codebotler.simulator.process.fork_server_client import BatchServer, ForkServer
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.sandbox import MAX_FRAME
from codebotler.simulator.settings import Limits, SimulationSettings
from codebotler.simulator.worker import EngineError, Job, Worker
from codebotler.simulator.worlds.robot import Argument, Result, SimulatedRobot
from in_process import all_of
from other_functions import with_functions
from processes import are_gone, children_of

WORLDS = (
    World((Room("hall", ("mug",)), Room("lab", ("apple",), (Person("amy", ("yes", "no")),))), "hall"),
    World((Room("lab"), Room("hall", ("apple", "mug"), (Person("bob", ("no",)),))), "hall"),
    World((Room("hall", (), (Person("eve"),)),), "hall"),
)
WORLD = WORLDS[0]
SETTINGS = SimulationSettings(limits=Limits(seconds=600, calls=60, ticks=2_000, text=200, trace=2_000))
TABLE = SKILLS.with_skill(
    Skill("wave", (Parameter("person"),), TEXT_TYPE, "Wave at a person.", Recording("wave", "person"))
)


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    yield from close_after(Worker())


@pytest.fixture(scope="module")
def other_worker() -> Iterator[Worker]:
    """Yield a worker that gives each run a process of its own."""
    yield from close_after(Worker(one_process_per_run=True))


def close_after(worker: Worker) -> Iterator[Worker]:
    yield worker
    worker.close()


def robot(world: World = WORLD, settings: SimulationSettings = SETTINGS) -> SimulatedRobot:
    return SimulatedRobot(world, settings)


def job(program: str, worlds: Sequence[World] = WORLDS) -> Job:
    return program, [partial(robot, world) for world in worlds]


def task(*lines: str) -> str:
    return "def task_program():\n" + "".join(f"    {line}\n" for line in lines)


def saying(text: str) -> str:
    return task(f"say({text!r})")


# --- outcomes

# A shared child can run these programs; the values are their ends in the first world.
RUN_TOGETHER: dict[str, tuple[Status, str | None]] = {
    task("rooms = get_all_rooms()", "for room in rooms: go_to(room)", "say(', '.join(rooms))"): (
        Status.FINISHED,
        None,
    ),
    task("here = get_current_location()", "go_to('lab')", "go_to(here)", "say(str(here is None))"): (
        Status.FINISHED,
        None,
    ),
    task("if is_in_room('mug'): pick('mug')", "go_to('lab')", "place('mug')", "pick('mug')"): (
        Status.FINISHED,
        None,
    ),
    task("go_to('lab')", "say(ask('amy', 'Tea?', ['yes', 'no']) + str(ask('', 'Tea?', [1, 'no'])))"): (
        Status.FINISHED,
        None,
    ),
    task("go_to('lab')", "x = [2, 'yes', None]", "say(repr(ask('', 'Tea?', x)) + str(x))"): (
        Status.FINISHED,
        None,
    ),
    task("start = time.time()", "time.sleep(1.5)", "say(str(time.time() - start) + time.strftime('%c'))"): (
        Status.FINISHED,
        None,
    ),
    task("for n in range(9):", "    time.sleep(n)", "    say(str(time.monotonic()))"): (
        Status.FINISHED,
        None,
    ),
    task("while not is_in_room('unicorn') and time.time() % 100 < 50:", "    time.sleep(1)"): (
        Status.FINISHED,
        None,
    ),
    "import time\nx = [1]\n\ndef f(n=[]):\n    n.append(1)\n    return n\n\nfor _ in x: f()\nsay(str(f()))\n"
    "task_program = 1": (Status.PYTHON_ERROR, "TypeError"),
    "say(__name__)\nif __name__ == '__main__':\n    say('a')\n": (Status.PYTHON_ERROR, "NameError"),
    "def task_program():\n    say('a')\ntask_program()\n": (Status.FINISHED, None),
    task("say(undefined)"): (Status.PYTHON_ERROR, "NameError"),
    task("say('a')", "say('b', 'c')"): (Status.PYTHON_ERROR, "TypeError"),
    task("say(1)"): (Status.PYTHON_ERROR, "TypeError"),
    task("assert is_in_room('unicorn'), 'none'"): (Status.PYTHON_ERROR, "AssertionError"),
    task("x = {}", "say('a')", "x['key']"): (Status.PYTHON_ERROR, "KeyError"),
    task("raise ValueError('a') from KeyError('b')"): (Status.PYTHON_ERROR, "ValueError"),
    task("x = [1]", "x.append(x)", "say(str(x) + str({1: x}))", "x.upper()"): (
        Status.PYTHON_ERROR,
        "AttributeError",
    ),
    task("say(str(1 / 0))"): (Status.PYTHON_ERROR, "ZeroDivisionError"),
    task("try:", "    go_to('moon')", "except Exception as error:", "    say(repr(error))", "    raise"): (
        Status.ROBOT_ERROR,
        "GoToInvalidLocation",
    ),
    task(
        "for _ in range(3):",
        "    try: pick('moon')",
        "    except Exception as error: e = [error]",
        "raise e[0]",
    ): (
        Status.ROBOT_ERROR,
        "PickInvalidObject",
    ),
    task("ask('amy', 'Tea?', ['yes'])"): (Status.ROBOT_ERROR, "AskNoPerson"),
    task("ask('amy', 'Tea?', [])"): (Status.ROBOT_ERROR, "AskEmptyOptions"),
    task("go_to('lab')", "ask('amy', 'Tea?', ['tea', 'milk'])"): (Status.ROBOT_ERROR, "AskInvalidOptions"),
    task("pick('mug')", "pick('mug')"): (Status.ROBOT_ERROR, "PickWhileHolding"),
    task("place('mug')"): (Status.ROBOT_ERROR, "PlaceNoObject"),
    task("while True: pass"): (Status.TIMEOUT, "TimeoutError"),
    task("while True:", "    try: say(''.join(str(n) for n in range(99)))", "    except: continue"): (
        Status.TIMEOUT,
        "TimeoutError",
    ),
    task("for n in range(61): say(str(n))"): (Status.TIMEOUT, "TimeoutError"),
    task("for n in range(60): say(str(n))"): (Status.FINISHED, None),
    task("while True: is_in_room('unicorn')"): (Status.TIMEOUT, "TimeoutError"),
    task("while True:", "    try: go_to('moon')", "    except Exception: say('a')"): (
        Status.TIMEOUT,
        "TimeoutError",
    ),
    task("say('x' * 200)", "say('y' * 201)"): (Status.TIMEOUT, "TimeoutError"),
    task("go_to('lab')", "ask('', 'Tea?', ['yes'] * 15)", "ask('', 'Tea?', ['yes'] * 150)", "say('a')"): (
        Status.TIMEOUT,
        "TimeoutError",
    ),
    task("for n in range(11): say(str(n % 10) * 200)"): (Status.TIMEOUT, "TimeoutError"),
    task("for n in range(11): say('x' * 200)"): (Status.TIMEOUT, "TimeoutError"),
    task("say('a')", "time.sleep(600)", "say('b')", "time.sleep(1)"): (Status.TIMEOUT, "TimeoutError"),
    task("while not is_in_room('unicorn'): time.sleep(30)"): (Status.TIMEOUT, "TimeoutError"),
    task("try:", "    while True: say('a')", "finally:", "    say('b')", "    go_to('lab')"): (
        Status.TIMEOUT,
        "TimeoutError",
    ),
    task("try: time.sleep(1000)", "except BaseException: pass", "say('a')"): (Status.TIMEOUT, "TimeoutError"),
}
# The end of these programs depends on the memory and the stack of the process, so each needs its own.
DEEP = "def f(n):\n    say(str(n)) if n % 100 == 0 else None\n    return f(n + 1)\n"
RUN_ALONE: dict[str, tuple[Status, str | None]] = {
    DEEP + task("f(1)"): (Status.PYTHON_ERROR, "RecursionError"),
    DEEP + task("try: f(1)", "except RecursionError as error: say(str(error))"): (Status.FINISHED, None),
    DEEP + task("try: f(1)", "except Exception: say('a')"): (Status.FINISHED, None),
    DEEP + task("for _ in '1':", "    try: f(1)", "    finally: break"): (Status.FINISHED, None),
    "def f(n): return n and f(n - 1)\n" + task("say(str(f(600)))"): (Status.FINISHED, None),
    task("x = 'x' * 10 ** 12"): (Status.PYTHON_ERROR, "MemoryError"),
    task("try: x = [1] * 10 ** 12", "except MemoryError: say(str(get_all_rooms()))"): (Status.FINISHED, None),
    task("raise MemoryError('a')"): (Status.PYTHON_ERROR, "MemoryError"),
    task("say('half \\ud800 a character')"): (Status.FINISHED, None),
}


def id_of(program: str) -> str:
    return program.removeprefix("def task_program():\n")[:60]


@pytest.mark.parametrize(("program", "end"), RUN_TOGETHER.items(), ids=map(id_of, RUN_TOGETHER))
def test_shared_child_gives_the_outcomes_of_separate_processes(
    worker: Worker, other_worker: Worker, program: str, end: tuple[Status, str | None]
) -> None:
    known = worker.run_tame([job(program)])
    assert list(known) == [(0, number) for number in range(len(WORLDS))]
    alone = [other_worker.run(program, new_robot) for new_robot in job(program)[1]]
    assert list(map(all_of, known.values())) == list(map(all_of, alone))
    assert (known[0, 0].status, known[0, 0].error and known[0, 0].error.kind) == end


@pytest.mark.parametrize(("program", "end"), RUN_ALONE.items(), ids=map(id_of, RUN_ALONE))
def test_program_that_depends_on_its_process_runs_alone(
    worker: Worker, other_worker: Worker, program: str, end: tuple[Status, str | None]
) -> None:
    assert worker.run_tame([job(program), job(saying("next"))]).keys() == {(1, 0), (1, 1), (1, 2)}
    outcome = worker.run(program, robot)
    assert all_of(outcome) == all_of(other_worker.run(program, robot))
    assert (outcome.status, outcome.error and outcome.error.kind) == end


@pytest.mark.parametrize(
    "shows", ["say(str(len(str(x))))", "say(str(x == y))", "ask('', 'Tea?', [x, 'yes'])"]
)
def test_shared_child_nests_data_as_deep_or_leaves_the_program(
    worker: Worker, other_worker: Worker, shows: str
) -> None:
    """Python limits nesting by the depth of its stack, which differs between the two kinds of process."""

    def nest(depth: int) -> str:
        return task("go_to('lab')", "x, y = [], []", f"for _ in range({depth}): x, y = [x], [y]", shows)

    def new_robot() -> SimulatedRobot:
        return SimulatedRobot(WORLD, SimulationSettings(limits=Limits(text=1_000_000)))

    fits, fails = 1, 50_000
    while fails - fits > 1:
        depth = (fits + fails) // 2
        error = other_worker.run(nest(depth), new_robot).error
        fits, fails = (fits, depth) if error and error.kind == "RecursionError" else (depth, fails)
    assert fails < 50_000
    for depth in range(fits - 10, fits + 10):
        for outcome in worker.run_tame([(nest(depth), [new_robot])]).values():
            assert (depth, all_of(outcome)) == (depth, all_of(other_worker.run(nest(depth), new_robot)))


@pytest.mark.parametrize("character", ["a", "\x7f", "é", "\U0001f600"])
def test_long_transcript_has_the_same_outcome_alone(
    worker: Worker, other_worker: Worker, character: str
) -> None:
    """A process of its own writes calls in ASCII, where some characters take twelve bytes."""
    program = task(f"x = {character!r} * 9000", "ask('', 'q', [x for n in range(30)])")
    alone = other_worker.run(program, lambda: robot(WORLD, SimulationSettings()))
    assert worker.run(program, lambda: robot(WORLD, SimulationSettings())) == alone


@pytest.mark.slow
def test_program_that_computes_too_long_loses_only_its_own_outcome(worker: Worker) -> None:
    computes = task("say('a')", "pow(3, 10 ** 9)")
    jobs = [job(saying("first"), [WORLD]), job(computes, [WORLD]), job(saying("next"), [WORLD])]
    assert worker.run_tame(jobs).keys() == {(0, 0), (2, 0)}


@pytest.mark.slow
def test_programs_of_a_batch_have_the_same_outcomes_alone(worker: Worker, other_worker: Worker) -> None:
    programs = [*RUN_TOGETHER, *RUN_ALONE, "class A: pass\ntask_program = A", "def task_program(:"]
    for jobs in ([job(program) for program in programs], [job(program) for program in reversed(programs)]):
        alone = [[other_worker.run(program, new_robot) for new_robot in robots] for program, robots in jobs]
        for (program, _), outcomes, expected in zip(jobs, worker.run_all(jobs), alone, strict=True):
            assert [program, *map(all_of, outcomes)] == [program, *map(all_of, expected)]


@pytest.fixture
def replays(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Forget all replays, and return the start rooms of the runs that are replayed from now on."""
    rooms: list[str] = []
    follow = Replay.follow

    def note_and_follow(replay: Replay, transcript: Transcript) -> SkillAnswer:
        rooms.append(replay.robot.room)
        return follow(replay, transcript)

    monkeypatch.setattr(Replay, "follow", note_and_follow)
    monkeypatch.setattr("codebotler.simulator.batches.replay.REPLAYED", {})
    return rooms


def test_equal_transcripts_in_a_world_are_replayed_once(
    worker: Worker, other_worker: Worker, replays: list[str]
) -> None:
    looks = task("for room in get_all_rooms():", "    go_to(room)", "    say(str(is_in_room('mug')))")
    jobs = [job(f"# {number}\n{looks}") for number in range(3)]
    results = worker.run_all(jobs)
    assert len(replays) == len(WORLDS)
    expected = [other_worker.run(looks, new_robot) for new_robot in jobs[0][1]]
    assert [list(map(all_of, outcomes)) for outcomes in results] == [list(map(all_of, expected))] * 3


def test_equal_transcripts_in_other_worlds_or_settings_are_replayed_again(
    worker: Worker, other_worker: Worker, replays: list[str]
) -> None:
    says = saying("hello, everybody")
    short = SimulationSettings(limits=Limits(calls=1))
    new_robots = [partial(robot, WORLDS[0]), partial(robot, WORLDS[1]), partial(robot, WORLDS[0], short)]
    (results,) = worker.run_all([(says, new_robots)])
    assert len(replays) == len(new_robots)
    assert list(map(all_of, results)) == [all_of(other_worker.run(says, new)) for new in new_robots]


def test_robots_with_other_skills_share_no_replay() -> None:
    cannot_say = SkillTable(tuple(skill for skill in SKILLS.rows if skill.name != "say"))
    robots = robot(), SimulatedRobot(WORLD, SETTINGS, cannot_say)
    assert len({key_of(b"[]", each) for each in robots}) == 2


def test_only_a_few_short_outcomes_are_cached(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    known: dict[object, object] = {}
    monkeypatch.setattr("codebotler.simulator.batches.replay.REPLAYED", known)
    monkeypatch.setattr("codebotler.simulator.batches.replay.MAX_REPLAYS", 5)
    monkeypatch.setattr("codebotler.simulator.batches.replay.MAX_REPLAY_BYTES", 100)
    worker.run_all([job(saying(str(number)), [WORLD]) for number in range(23)])
    assert len(known) == 23 % 5
    worker.run_all([job(saying("x" * 100), [WORLD])])
    assert len(known) == 23 % 5


def test_next_program_finds_no_trace_of_the_one_before(worker: Worker) -> None:
    leaves = "left = 1\ndef other(): pass\n" + task("say('a')", "time.sleep(9)", "go_to('moon')")
    finds = task(
        "say(str(time.monotonic()))",
        "try: say(str(left))",
        "except NameError as error: say(str(error))",
        "try: other()",
        "except NameError as error: say(str(error))",
    )
    known = worker.run_tame([job(leaves), job(finds)])
    texts = [event.text for event in known[1, 0].trace]
    assert texts == ["0.0", "name 'left' is not defined", "name 'other' is not defined"]


# --- custom skills


class Waves:
    """Make robots with the skill `wave`, and list the processes and people of its calls."""

    def __init__(self, wave: Callable[..., Result], **others: Callable[..., Result]) -> None:
        self.processes: list[int] = []
        self.people: list[str] = []
        self.wave, self.others = wave, others

    def robot(self) -> SimulatedRobot:
        return SimulatedRobot(WORLD, SETTINGS, with_functions(TABLE, wave=self._wave, **self.others))

    def _wave(self, robot: SimulatedRobot, person: str) -> Result:
        self.processes.append(os.getpid())
        self.people.append(person)
        robot.record("wave", person)
        return self.wave(robot, person)


def answer_wave(robot: SimulatedRobot, person: str) -> str:
    if person == "nobody":
        raise RobotError("WaveNoPerson", f"nobody waves back in {robot.room} after {robot.now}")
    if person == "slow":
        robot.now += 100
    return f"{person} in {robot.room} at {robot.now}"


WAVING_PROGRAMS = {
    "once": task("say('a')", "say(wave('amy'))", "go_to('lab')"),
    "often": task(
        "for n in range(5):", "    say(wave('amy'))", "    time.sleep(n)", "go_to('lab')", "say(wave('amy'))"
    ),
    "in vain": task(
        "try: wave('nobody')", "except Exception as error: say(repr(error))", "wave('bob')", "go_to('moon')"
    ),
    "in vain, and the first error again": task(
        *("errors = []", "for name in ['nobody', 'moon', 'nobody']:"),
        *(
            "    try: go_to(name) if name == 'moon' else wave(name)",
            "    except Exception as e: errors.append(e)",
        ),
        "raise errors[0]",
    ),
    "in vain, and the second error again": task(
        *("errors = []", "for name in ['nobody', 'moon', 'nobody']:"),
        *(
            "    try: go_to(name) if name == 'moon' else wave(name)",
            "    except Exception as e: errors.append(e)",
        ),
        "raise errors[1]",
    ),
    "until a limit": task("while True: wave('amy')"),
    "until a string is too long": task("wave('x' * 200)", "wave('y' * 201)", "wave('z')"),
    "until time is up": task("wave('a')", "time.sleep(601)", "wave('b')"),
    "slowly": task("say(wave('slow'))", "say(str(time.monotonic()))", "time.sleep(5)", "say(wave('slow'))"),
    "too slowly": task("while True: wave('slow')"),
    "with nothing": task("wave(1)"),
}


@pytest.mark.parametrize("program", WAVING_PROGRAMS.values(), ids=WAVING_PROGRAMS)
def test_own_skill_runs_in_this_process_once_per_call(
    worker: Worker, other_worker: Worker, program: str
) -> None:
    together, alone = Waves(answer_wave), Waves(answer_wave)
    known = worker.run_tame([(program, [together.robot, together.robot])])
    assert list(known) == [(0, 0), (0, 1)]
    outcome = other_worker.run(program, alone.robot)
    assert [all_of(each) for each in known.values()] == [all_of(outcome)] * 2
    assert together.people == alone.people * 2
    assert {*together.processes} <= {os.getpid()}


def test_robot_with_its_own_way_to_drive_has_the_same_outcome_alone(
    worker: Worker, other_worker: Worker
) -> None:
    def drive(robot: SimulatedRobot, location: str) -> None:
        robot.record("goto", location)
        robot.room = "lab"

    program = task("say('a')", "go_to('moon')", "say(get_current_location() + str(is_in_room('apple')))")
    outcomes = [each.run(program, Waves(answer_wave, go_to=drive).robot) for each in (worker, other_worker)]
    assert all_of(outcomes[0]) == all_of(outcomes[1])
    assert [event.text for event in outcomes[0].trace] == ["a", "moon", "apple", "labTrue"]


def test_exception_of_an_own_skill_reaches_the_caller(worker: Worker) -> None:
    def raise_a_bug(_robot: SimulatedRobot, _person: str) -> None:
        raise LookupError("a bug")

    with pytest.raises(LookupError, match="a bug"):
        worker.run_tame([(WAVING_PROGRAMS["once"], [Waves(raise_a_bug).robot])])
    assert worker.run_tame([job(saying("next"))])


# --- children that fail


def test_killed_child_loses_only_the_program_that_it_ran(worker: Worker) -> None:
    fork_server = worker._fork_server(BatchServer)._process.pid
    killed: list[int] = []

    def kill_the_child(_robot: SimulatedRobot, person: str) -> str:
        if person == "killer" and not killed:
            killed.extend(children_of(fork_server))
            for pid in killed:
                os.kill(pid, signal.SIGKILL)
        return "done"

    waves = Waves(kill_the_child)
    killer = task("say('a')", "say(wave('killer'))")
    programs = [saying("first"), task("say(wave('amy'))"), killer, saying("next"), task("say(wave('bob'))")]
    known = worker.run_tame([(program, [waves.robot, waves.robot]) for program in programs])
    assert len(killed) == 1
    assert known.keys() == {(number, run) for number in range(5) for run in range(2)} - {(2, 0), (2, 1)}
    assert {outcome.status for outcome in known.values()} == {Status.FINISHED}
    killed.clear()
    outcomes = worker.run_all([(program, [waves.robot, waves.robot]) for program in programs])
    said = [[[event.text for event in outcome.trace][-1] for outcome in each] for each in outcomes]
    assert said == [["first"] * 2, ["done"] * 2, ["done"] * 2, ["next"] * 2, ["done"] * 2]


def test_killed_fork_server_loses_no_outcome() -> None:
    def kill_the_server(_robot: SimulatedRobot, _person: str) -> str:
        if not killed:
            killed.append(worker._fork_server(BatchServer)._process.pid)
            os.kill(killed[0], signal.SIGKILL)
        return "done"

    killed: list[int] = []
    waves = Waves(kill_the_server)
    worker = Worker()
    try:
        programs = [saying("first"), WAVING_PROGRAMS["once"], saying("next")]
        outcomes = worker.run_all([(program, [waves.robot]) for program in programs])
    finally:
        worker.close()
    assert [outcome.status for each in outcomes for outcome in each] == [Status.FINISHED] * 3


FORGED_FRAMES = {
    "no JSON": b"nonsense",
    "nothing": b"",
    "no transcript": b"[]",
    "half of one": b'[[],0,{"end":"fin',
    "a transcript and more": b'[[],0,{"end":"finished"},1]',
    "an end of another kind": b'[[],0,"finished"]',
    "an unknown end": b'[[],0,{"end":"again"}]',
    "no end": b"[[],0,{}]",
    "an error of the robot that there was not": b'[[],0,{"end":"robot-error","number":0,"line":1}]',
    "an error without a name": b'[[],0,{"end":"python-error","kind":1,"message":"a"}]',
    "a drive that cannot be": b'[[["go_to",["moon"],0,"ok",null]],0,{"end":"finished"}]',
    "too much": b" " * (MAX_FRAME + 1),
}


@pytest.mark.parametrize("forged", FORGED_FRAMES.values(), ids=FORGED_FRAMES)
def test_forged_frame_loses_only_the_program_of_its_child(
    worker: Worker, monkeypatch: pytest.MonkeyPatch, forged: bytes
) -> None:
    honest = IsolatedProcess.receive_bytes
    heard: list[bytes | None] = []

    def receive(self: IsolatedProcess, most: int) -> bytes | None:
        frame = honest(self, most)
        if most == MAX_FRAME and frame is not None and b"finished" in frame:
            heard.append(frame)
            if len(heard) == 3:
                if len(forged) > most:
                    raise ProtocolError("a frame is too long")
                return forged
        return frame

    monkeypatch.setattr(IsolatedProcess, "receive_bytes", receive)
    jobs = [job(saying(text), WORLDS[:2]) for text in ("first", "second", "third")]
    known = worker.run_tame(jobs)
    assert known.keys() == {(0, 0), (0, 1), (2, 0), (2, 1)}
    outcomes = {**known, (1, 0): worker.run_alone(jobs[1][0], jobs[1][1][0])}
    assert [outcomes[number, 0].trace[0].text for number in range(3)] == ["first", "second", "third"]


@pytest.mark.parametrize("error", [TimeoutError, LostProcessError, None])
def test_silent_child_loses_only_the_program_that_it_ran(
    worker: Worker, monkeypatch: pytest.MonkeyPatch, error: type[Exception] | None
) -> None:
    honest = IsolatedProcess.receive_bytes
    frames = Counter[int]()

    def receive(self: IsolatedProcess, most: int) -> bytes | None:
        frames[most] += most == MAX_FRAME
        if frames[MAX_FRAME] == 2 and most == MAX_FRAME:
            if error is None:
                return None
            raise error
        return honest(self, most)

    monkeypatch.setattr(IsolatedProcess, "receive_bytes", receive)
    assert worker.run_tame([job(saying(text), [WORLD]) for text in "abc"]).keys() == {(0, 0), (2, 0)}


def test_child_that_breaks_the_protocol_is_ended_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = IsolatedProcess.receive_bytes

    def receive(child: IsolatedProcess, most: int) -> bytes | None:
        frame = honest(child, most)
        if most != MAX_FRAME:  # the frame comes from a compiler
            return frame
        begun.append(child.pid)  # the child waits for an answer
        os.kill(child.pid, signal.SIGSTOP)  # a stopped child cannot end by itself
        raise ProtocolError("nonsense")

    begun: list[int] = []
    monkeypatch.setattr(IsolatedProcess, "receive_bytes", receive)
    with closing(Worker()) as worker:
        assert not worker.run_tame([(WAVING_PROGRAMS["once"], [Waves(lambda *_: "done").robot])])
        assert len(begun) == 1
        assert are_gone(set(begun))


# --- replay


def follow(
    calls: Sequence[list[Any]],
    order: Sequence[int],
    moments: Mapping[int, float] = MappingProxyType({}),
    settings: SimulationSettings = SETTINGS,
) -> Replay:
    now, made = 0.0, []
    for place, number in enumerate(order):
        now = moments.get(place, now)
        name, arguments, kind, value = calls[number]
        made.append([name, arguments, now, kind, value])
    now = moments.get(len(order), now)
    transcript = parse_transcript(json.dumps([made, now, {"end": "finished"}]).encode())
    assert transcript is not None
    replay = Replay(robot(settings=settings))
    replay.follow(transcript)
    return replay


A: list[Any] = ["say", ["a"], "ok", None]
TIGHT = SimulationSettings(limits=Limits(seconds=10, calls=2, text=5, trace=20))
LONG: list[Any] = ["say", ["x" * 6], "stop", None]
IMPOSSIBLE_TRANSCRIPTS: dict[str, Callable[[], object]] = {
    "an answer that is none": lambda: follow([["get_current_location", [], "ok", None]], [0]),
    "another answer": lambda: follow([["get_current_location", [], "ok", "lab"]], [0]),
    "another list": lambda: follow([["get_all_rooms", [], "ok", ["hall"]]], [0]),
    "another sight": lambda: follow([["is_in_room", ["mug"], "ok", False]], [0]),
    "an error where there is none": lambda: follow([["say", ["a"], "error", ["Kind", "why"]]], [0]),
    "no error where there is one": lambda: follow([["go_to", ["moon"], "ok", None]], [0]),
    "another kind of error": lambda: follow(
        [["go_to", ["moon"], "error", ["PickInvalidObject", 'there is no room "moon"']]], [0]
    ),
    "another error": lambda: follow([["go_to", ["moon"], "error", ["GoToInvalidLocation", "why"]]], [0]),
    "an error that is a number": lambda: follow([["go_to", ["moon"], "error", 5]], [0]),
    "an unknown kind of answer": lambda: follow([["say", ["a"], "maybe", None]], [0]),
    "a limit where there is none": lambda: follow([["say", ["a"], "stop", None]], [0]),
    "an answer of later": lambda: follow(
        [["get_current_location", [], "ok", "lab"], ["go_to", ["lab"], "ok", None]], [0, 1]
    ),
    "a call that is beyond a limit": lambda: follow([A], [0, 0, 0], settings=TIGHT),
    "a call after a limit": lambda: follow([A, ["say", ["a"], "stop", None]], [0, 0, 1, 1], settings=TIGHT),
    "a call after a string that was too long": lambda: follow([A, LONG], [1, 0], settings=TIGHT),
    "a call after the time": lambda: follow([A], [0, 0], {1: 11.0}, settings=TIGHT),
    "a call for an answer after a limit": lambda: follow(
        [LONG, ["say", ["a"], "ask", None]], [0, 1], settings=TIGHT
    ),
    "an unknown skill": lambda: follow([["fly", ["a"], "ok", None]], [0]),
    "too few arguments": lambda: follow([["say", [], "ok", None]], [0]),
    "too many arguments": lambda: follow([["say", ["a", "b"], "ok", None]], [0]),
    "an argument that is no text": lambda: follow([["say", [1], "ok", None]], [0]),
    "a list for a string": lambda: follow([["say", [[["a", True]]], "ok", None]], [0]),
    "a string for a list": lambda: follow([["ask", ["a", "b", "c"], "ask", None]], [0]),
    "an option that is none": lambda: follow([["ask", ["a", "b", ["c"]], "ask", None]], [0]),
    "an option of other types": lambda: follow([["ask", ["a", "b", [["c", 1]]], "ask", None]], [0]),
    "a question for a robot that can answer itself": lambda: follow([["say", ["a"], "ask", None]], [0]),
    "a look remembered after the time": lambda: follow(
        [["is_in_room", ["unicorn"], "ok", False]],
        [0] * 60,
        {59: 11.0},
        settings=SimulationSettings(limits=Limits(seconds=10)),
    ),
    "time that goes back": lambda: follow([A], [0, 0, 0], {1: 2.0, 2: 1.0}),
    "time that goes back at the end": lambda: follow([A], [0, 0], {1: 2.0, 2: 1.0}),
}


@pytest.mark.parametrize("attempt", IMPOSSIBLE_TRANSCRIPTS.values(), ids=IMPOSSIBLE_TRANSCRIPTS)
def test_replay_refuses_impossible_transcripts(attempt: Callable[[], object]) -> None:
    with pytest.raises(ProtocolError):
        attempt()


def test_replay_repeats_every_call() -> None:
    calls = [
        A,
        ["go_to", ["lab"], "ok", None],
        ["go_to", ["moon"], "error", ["GoToInvalidLocation", 'there is no room "moon"']],
        ["get_all_rooms", [], "ok", ["hall", "lab"]],
        ["ask", ["amy", "Tea?", [["no", True], ["yes", True]]], "ok", 1],
        ["is_in_room", ["apple"], "ok", True],
    ]
    replay = follow(calls, [0, 1, 0, 3, 2, 4, 5], {2: 1.5, 4: 3.0, 7: 9.0})
    events = [
        (event.kind, event.text, event.answer, event.found, event.place, event.time)
        for event in replay.robot.trace
    ]
    assert events == [
        ("say", "a", None, None, "hall", 0.0),
        ("goto", "lab", None, None, "hall", 0.0),
        ("say", "a", None, None, "lab", 1.5),
        ("goto", "moon", None, None, "lab", 3.0),
        ("ask", "Tea?", "yes", None, "lab", 3.0),
        ("check", "apple", None, True, "lab", 3.0),
    ]
    assert replay.ledger.limit is None
    assert (replay.ledger.calls, replay.robot.now) == (7, 9.0)


@pytest.mark.parametrize(
    ("calls", "order", "moments"),
    [
        ([A, ["say", ["a"], "stop", None]], [0, 0, 1], {}),
        ([A, LONG], [0, 1], {}),
        ([A], [0], {1: 11.0}),
    ],
)
def test_replay_reaches_the_same_limits(
    calls: Sequence[list[Any]], order: Sequence[int], moments: Mapping[int, float]
) -> None:
    ledger = follow(calls, order, moments, TIGHT).ledger
    assert ledger.limit is not None
    outcome = ledger.outcome_at_end({"end": "finished"})
    assert (outcome.status, outcome.error) == (Status.TIMEOUT, RunError("TimeoutError", ledger.limit))


def test_robot_of_an_own_class_performs_every_call(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.simulator.ledger.UNREMEMBERED_CALLS", 0)
    performed: list[str] = []

    class NotingRobot(SimulatedRobot):
        """List the skills that the robot performs."""

        def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
            performed.append(skill)
            return super().perform(skill, arguments)

    known = worker.run_tame([(task("say('a')", "say('a')", "say('a')"), [partial(NotingRobot, WORLD)])])
    assert known[0, 0].status is Status.FINISHED
    assert performed == ["say"] * 3


class GreetingRobot(SimulatedRobot):
    """Start every trace with a greeting."""

    @property
    def trace(self) -> Trace:
        """Return the greeting and the events of the program."""
        return (Event("say", "hello"), *super().trace)


def test_robot_of_an_own_class_shares_no_outcome(worker: Worker) -> None:
    idle = task("pass")
    for kind in (SimulatedRobot, GreetingRobot, SimulatedRobot, GreetingRobot):
        (outcome,) = worker.run_tame([(idle, [partial(kind, WORLD)])]).values()
        assert len(outcome.trace) == (kind is GreetingRobot)


@pytest.mark.parametrize(("question", "options"), [(200, []), (201, []), (190, [11]), (5, [200]), (5, [201])])
def test_limit_of_characters_applies_to_each_text_of_a_call(question: int, options: list[int]) -> None:
    ledger = Ledger(SimulatedRobot(WORLD, SimulationSettings(limits=Limits(text=200))))
    ledger.perform("ask", ("", "q" * question, tuple(Option("o" * size) for size in options)))
    is_too_long = max(question, *options, 0) > 200
    assert (ledger.limit == "a text of more than 200 characters") == is_too_long


# --- frequent looks


Call = tuple[float, str, tuple[Any, ...]]
LOOKS: list[Call] = [(number // 3, "is_in_room", ("unicorn",)) for number in range(1_000)]
HISTORIES: dict[str, list[Call]] = {
    "looks": LOOKS,
    "looks and says": [
        call for look in LOOKS[:500] for call in (look, (look[0], "say", (f"not here {look[0] % 2}",)))
    ],
    "looks from room to room": [
        call
        for number, look in enumerate(LOOKS)
        for call in (look, (look[0], "go_to", (("lab", "hall")[number // 100 % 2],)))
        if call is look or number % 100 == 0
    ],
    "asks": [
        (0, skill, arguments)
        for _ in range(400)
        for skill, arguments in (
            ("go_to", ("lab",)),
            ("is_in_room", ("person",)),
            ("ask", ("", "Tea?", (Option("yes"), Option("no")))),
            ("is_in_room", ("person",)),
        )
    ],
    "picks": [
        (0, skill, ("mug",)) for _ in range(400) for skill in ("is_in_room", "pick", "is_in_room", "place")
    ],
    "tells": [(number, "get_all_rooms", ()) for number in range(1_001)],
    "speaks at length": [(number, "say", ("x" * (300 + number % 3),)) for number in range(1_000)],
}


@pytest.mark.parametrize("history", HISTORIES.values(), ids=HISTORIES)
def test_remembered_calls_have_the_same_effects_as_performed_ones(
    history: list[Call], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.simulator.ledger.UNREMEMBERED_CALLS", 0)
    settings = SimulationSettings(limits=Limits(trace=250_000))
    results = []
    for kind in (Ledger, RememberingLedger):
        ledger = kind(SimulatedRobot(WORLD, settings))
        answers = []
        for now, skill, arguments in history:
            ledger.let_time_pass(now)
            answers.append(ledger.perform(skill, arguments))
        results.append((answers, repr(ledger.robot.trace), ledger.calls, ledger.text, ledger.limit))
    assert results[0] == results[1]


@pytest.mark.parametrize(("few", "performed"), [(0, 1), (50, 51)])
def test_repeated_looks_are_performed_once(monkeypatch: pytest.MonkeyPatch, few: int, performed: int) -> None:
    monkeypatch.setattr("codebotler.simulator.ledger.UNREMEMBERED_CALLS", few)
    perform = Mock(return_value=False)
    monkeypatch.setattr(SimulatedRobot, "perform", perform)
    looking = SimulatedRobot(WORLD)
    ledger = RememberingLedger(looking)
    for now, skill, arguments in LOOKS:
        ledger.let_time_pass(now)
        assert ledger.perform(skill, arguments) == ("ok", False)
    assert perform.call_count == performed


@pytest.mark.parametrize("seconds", [0, 1])
def test_program_that_looks_a_thousand_times_has_the_same_outcome_alone(
    worker: Worker, other_worker: Worker, seconds: int
) -> None:
    program = task("while not is_in_room('unicorn'):", f"    time.sleep({seconds})", "    say('not here')")

    def new_robot() -> SimulatedRobot:
        return SimulatedRobot(WORLD)

    known = worker.run_tame([(program, [new_robot])])
    assert all_of(known[0, 0]) == all_of(other_worker.run(program, new_robot))
    assert (len(known[0, 0].trace), known[0, 0].status) == (1_000, Status.TIMEOUT)


# --- workers and pools


def test_events_of_batches_are_logged(worker: Worker, caplog: pytest.LogCaptureFixture) -> None:
    programs = {
        saying("a"): ["finished"],
        task("go_to('moon')"): ["robot-error"],
        task("x = 1 / 0"): ["python-error"],
        task("while True: pass"): ["timeout"],
    }
    worker.run_tame([job(program) for program in programs])
    assert not caplog.records
    with caplog.at_level("DEBUG", logger="codebotler.engine.events"):
        assert len(worker.run_tame([job(program) for program in programs])) == 12
    for program, ends in programs.items():
        number = f"program {zlib.crc32(program.encode()):08x}: "
        own = [
            r.getMessage().removeprefix(number) for r in caplog.records if r.getMessage().startswith(number)
        ]
        assert Counter(message.partition(" ")[0] for message in own) == Counter(["started", *ends] * 3)
    assert len(caplog.records) == 24


def test_one_process_per_run_starts_no_batch_server(other_worker: Worker) -> None:
    jobs = [job(saying(text)) for text in "abc"]
    assert other_worker.run_tame(jobs) == {}
    outcomes = other_worker.run_all(jobs)
    assert [[each.trace[0].text for each in of_one] for of_one in outcomes] == [
        ["a"] * 3,
        ["b"] * 3,
        ["c"] * 3,
    ]
    assert BatchServer not in other_worker._fork_servers
    assert ForkServer in other_worker._fork_servers


@pytest.mark.slow
def test_pool_passes_one_process_per_run_to_its_workers() -> None:
    for alone, role in ((False, BatchServer), (True, ForkServer)):
        with WorkerPool(1, one_process_per_run=alone) as pool:
            assert list(pool.here()._fork_servers) == [role]


def test_pool_that_cannot_start_accepts_no_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.simulator.pool.Worker", Mock(side_effect=EngineError("no processes")))
    pool = WorkerPool(1)
    with pytest.raises(EngineError, match="no processes"), pool:
        pytest.fail("the pool has started")
    with pytest.raises(RuntimeError, match="after shutdown"):
        pool.submit(print)


def test_worker_that_starts_while_its_pool_ends_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    first, starts, ends = Mock(), threading.Event(), threading.Event()

    def start_late(**_: bool) -> Mock:
        starts.set()
        assert ends.wait(60)
        return Mock()

    monkeypatch.setattr("codebotler.simulator.pool.Worker", Mock(return_value=first))
    pool = WorkerPool(2)
    with pool:
        first.stop.side_effect = ends.set
        assert pool.submit(pool.here).result() is first
        monkeypatch.setattr(pool, "_new_worker", start_late)
        pool._idle.clear()
        pool._local = threading.local()
        second: Future[Any] = pool.submit(pool.here)
        assert starts.wait(60)
    assert second.result().stop.called


def test_calls_get_growing_batches_of_distinct_keys() -> None:
    calls: list[list[int]] = []

    def work(numbers: Sequence[int]) -> list[int]:
        calls.append(list(numbers))
        return [number * 2 for number in numbers]

    keys = [number % 300 for number in range(700)]
    with WorkerPool(1) as pool:
        results = list(pool.map_distinct(work, keys, name=lambda number: number.to_bytes(2)))
    assert results == [number * 2 for number in keys]
    assert [number for call in calls for number in call] == list(range(300))
    sizes = list(map(len, calls))
    assert sizes[:-1] == sorted(sizes[:-1])
    assert (sizes[0], max(sizes)) == (MIN_BATCH_KEYS, MAX_BATCH_KEYS)


def test_failing_result_leaves_the_results_before_it_in_place() -> None:
    def use(number: int) -> int:
        if number == 77:
            raise ValueError("not this one")
        return number

    with WorkerPool(1) as pool:
        results = pool.map_distinct(list, range(200), name=lambda number: number.to_bytes(2), then=use)
        assert list(islice(results, 77)) == list(range(77))
        with pytest.raises(ValueError, match="not this one"):
            next(results)


def to_two_bytes(number: int) -> bytes:
    return number.to_bytes(2)


@pytest.mark.parametrize("width", [2, 8, 32])
def test_batches_grow_first_and_shrink_at_the_end(width: int) -> None:
    keys = DistinctKeys(iter(range(3_000)), to_two_bytes)
    sizes = []
    while batch := keys.batch(width):
        sizes.append(len(batch))
    assert sum(sizes) == 3_000
    top = sizes.index(max(sizes))
    assert sizes[: top + 1] == sorted(sizes[: top + 1])
    assert sizes[top:-1] == sorted(sizes[top:-1], reverse=True)
    assert (sizes[0], max(sizes)) == (MIN_BATCH_KEYS, MAX_BATCH_KEYS)
    assert sizes[-1] <= MIN_BATCH_KEYS


def test_few_keys_are_spread_over_all_calls() -> None:
    keys = DistinctKeys(iter(range(12)), to_two_bytes)
    sizes = [len(keys.batch(8)) for _ in range(10)]
    assert (sum(sizes), max(sizes)) == (12, 2)


def test_keys_are_read_only_a_little_ahead_of_their_consumer() -> None:
    keys = DistinctKeys(iter([1, 1, 2, 1, 3, 2, *range(4, 10_000)]), to_two_bytes)
    assert list(keys.batch(1).values()) == list(range(1, 1 + MIN_BATCH_KEYS))
    assert [int.from_bytes(name) for name in keys.waiting] == [
        1,
        1,
        2,
        1,
        3,
        2,
        *range(4, 1 + MIN_BATCH_KEYS),
    ]
    while keys.batch(1):
        pass
    assert len(keys.waiting) == MAX_KEYS_AHEAD
    keys.waiting.clear()
    assert len(keys.batch(1)) == MAX_BATCH_KEYS
