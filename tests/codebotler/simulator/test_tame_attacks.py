"""Attacks on the verifier of tame programs, on the child that they share, and on the replay.

Each file of tests/hostile_tame is one. Its first line names the attack, and `# tame: yes` or `# tame: no` the
expected verdict of the verifier. A tame one runs in a shared child with honest programs before, between and
after its runs, in three worlds each, and every outcome must be that of a process of its own. With
`# decided: alone`, the child must leave the program to a process of its own.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.declaration import skill
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.simulation import Simulation
from codebotler.core.skills.table import Parameter, Recording, Skill
from codebotler.core.skills.values import NO_VALUE
from codebotler.core.trace import Outcome, Status, trace_data
from codebotler.core.world import Person, Room, World
from codebotler.simulator.batches.replay import outcomes
from codebotler.simulator.process.errors import LostProcessError, ProtocolError
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.sandbox.fuel import prepared
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.skill_protocol import arguments_of
from codebotler.simulator.worker import NewRobot, Worker
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot
from haste import hasten

FOLDER = Path(__file__).parents[2] / "hostile_tame"
PROGRAMS = {path.stem: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.py"))}
TAME = [name for name, source in PROGRAMS.items() if "\n# tame: yes\n" in source]
ONE_A_KIND = {name.partition("_")[0]: name for name in reversed(TAME)}.values()
WILD = [name for name, source in PROGRAMS.items() if "\n# tame: no\n" in source]
AS_WRITTEN = SimulationSettings(literals="as-written")
AMY = Person("amy", ("yes", "no", ".*"))
BOB = Person(".*", ("no", "yes"))
WORLDS = (
    World((Room("start", ("mug",), (BOB,)), Room("kitchen", ("apple", "mug"), (AMY,))), "start"),
    World((Room("start"), Room("amy's lab", ("apple",), (AMY, BOB)), Room("kitchen")), "start"),
    World((Room("kitchen", (), (AMY,)), Room("start")), "kitchen"),
)
HONEST = """
asked = []

def depth(n):
    return 0 if n == 0 else 1 + depth(n - 1)

def remember(text, kept=[]):
    kept.append(text)
    return kept

def task_program():
    for room in get_all_rooms():
        go_to(room)
        if is_in_room("mug"):
            pick("mug")
            asked.append(room)
    say(str([asked, remember("a"), depth(100), time.time(), time.ctime(), time.monotonic()]))
    say(str([sorted({"b": 1, "a": 2}.items()), [room for room in get_all_rooms()], "x".upper(), len(asked)]))
    print("x" * 100)
    time.sleep(1.5)
    try:
        asked.append(ask("", "Is it yes?", ["Yes", "No"]))
    except Exception as error:
        say(repr(error))
    say(f"{asked!r} {0.1 + 0.2} {[1] == [1]} {max([3, 1, 2], key=abs)}")
    raise
"""
ALSO_HONEST = """
def task_program():
    found = {room: is_in_room("amy") for room in get_all_rooms() if go_to(room) is None}
    say(str(found))
    try:
        place("mug")
    except Exception as error:
        say(str(error))
    pick("nothing")
"""

# `@` may be replaced by data but not by a function, and by a generator only if the line begins with `~`.
PLACES = r"""
@
x = @
x += @
x: int = @
x[@] = 1
x[@]: int = 1
x[@:x] = 1
x[x:@:@] = 1
del x[@]
for x[@] in x: pass
~for y in @: pass
for y in x: @
for y in x: pass\nelse: @
while @: pass
while x: @
while x: pass\nelse: @
if @: pass
if x: @
if x: pass\nelse: @
try: @\nfinally: pass
try: pass\nexcept ValueError: @
try: pass\nexcept ValueError: pass\nelse: @
try: pass\nfinally: @
raise @
raise ValueError(@)
raise ValueError(x=@)
raise ValueError from @
assert @
assert x, @
def f(): @
def f(): return @
def f(y=@): pass
def f(*, y=@): pass
(@ or x)
(x or @)
(@ + x)
(x % @)
-@
not @
(@ if x else x)
(x if @ else x)
(x if x else @)
@[0]
x[@]
{@: 1}
{1: @}
{**@}
[@]
(@,)
~[*@]
[@ for y in x]
~[1 for y in @]
~[1 for y in x for z in @]
[1 for y in x if @]
[1 for x[@] in x]
{@: 1 for y in x}
{1: @ for y in x}
~{1: 1 for y in @}
list(@ for y in x)
x < @
@ < x
x < @ < x
~x in @
~x not in @
@ in x
@ is None
f'{@}'
f'{x:{@}}'
~len(@)
~list(@)
~dict(@)
~next(@)
next(x, @)
str(@)
print(@)
int(x, base=@)
dict(a=@)
~max(@)
max(@, x)
max(x, @)
~max(@, key=str)
max(x, default=@)
sorted(x, reverse=@)
sorted(x, **@)
max(x, key=lambda y: @)
max(x, key=lambda y=@: 1)
~list(map(str, @))
~list(map(str, x, @))
~list(filter(None, @))
~list(zip(@))
~list(zip(*@))
list(zip(x, strict=@))
list(@.items())
say(@)
~say(*@)
say(**@)
say(message=@)
own(@)
own(key=@)
x(@)
x(key=@)
x.append(@)
x.append(key=@)
~x.extend(@)
~x.update(@)
~'a'.join(@)
x.get(1, @)
x.sort(reverse=@)
@.append(1)
time.sleep(@)
time.sleep(seconds=@)
'{}'.format(@)
'{a}'.format(a=@)
""".strip().splitlines()
ANNOTATIONS = r"""
x: @ = 1
x: list[@] = 1
x: @[int] = 1
x: int | @ = 1
x: @ | int = 1
x: (int, @) = 1
def f(y: @): pass
def f(*y: @): pass
def f(*, y: @): pass
def f() -> @: pass
""".strip().splitlines()
NOT_ALLOWED = r"""
def f(__builtins__): pass
def f(own): pass
def len(y): pass
def open(): pass
def say(): pass
@x\ndef f(): pass
global __builtins__
def f():\n    global own
try: pass\nexcept x: pass
try: pass\nexcept (ValueError, x): pass
try: pass\nexcept ConnectionError: pass
try: pass\nexcept ValueError as len: pass
max(x, key=lambda len: 1)
max(x, key=lambda *len: 1)
max(x, key=lambda **time: 1)
max(x, key=str.encode)
max(x, key=x.append)
max(x, key=x.get.get)
max(x, kez=str)
next(map(next, x))
list(map(*x))
list(map(key=str))
isinstance(x)
isinstance(x, object)
isinstance(x, (int, object))
isinstance(x, int, y=1)
isinstance(*x)
time.tzset()
time.time_ns()
time.strptime(x)
time
time.time
x = ValueError
x = ValueError(1)
[1 for len in x]
[1 for y, (len, z) in x]
list(1 for time in x)
[1 for y in x if (len := y)]
(say := 1)
def f(len): (len := 1)
def f(len): [1 for len in x]
x.y: int = 1
(own := 1)
x is x
x is 1
x is None is not x is x
x.y
x.tm_year = 1
x.tm_year += 1
del x.tm_year
time.localtime().tm_zone
x = b'1'
x = 1j
x.translate(x)
x.format(x)
x.format_map(x)
x.encode()
x.__len__()
x.items()
{1}
{y for y in x}
lambda: 1
exit()
quit
sys
__file__
__builtins__
import os
import time as clock
from time import sleep
with x: pass
""".strip().splitlines()


@pytest.fixture(scope="module")
def batches() -> Iterator[Worker]:
    """Yield a worker that runs tame programs together."""
    worker = Worker()
    yield worker
    worker.close()


@pytest.fixture(scope="module")
def alone() -> Iterator[Worker]:
    """Yield a worker with a process for each run."""
    worker = Worker(one_process_per_run=True)
    yield worker
    worker.close()


@pytest.fixture(scope="module")
def honest(alone: Worker) -> dict[str, list[str]]:
    """Return the complete outcomes of honest programs in processes of their own."""
    return {source: run_alone(alone, source) for source in (HONEST, ALSO_HONEST)}


@cache
def robots() -> tuple[NewRobot, ...]:
    return tuple(partial(SimulatedRobot, world, AS_WRITTEN) for world in WORLDS)


def run_alone(worker: Worker, source: str) -> list[str]:
    return [all_of(worker.run_alone(source, new_robot)) for new_robot in robots()]


def run_together(worker: Worker, *sources: str) -> list[list[str | None]]:
    """Return the complete outcomes of programs in one child, None for runs that it did not decide."""
    known = worker.run_tame([(source, robots()) for source in sources])
    return [
        [all_of(known[number, run]) if (number, run) in known else None for run in range(len(WORLDS))]
        for number in range(len(sources))
    ]


def all_of(outcome: Outcome) -> str:
    """Return everything in an outcome, including the places and times that equality ignores."""
    return repr((outcome, outcome.trace))


def is_tame(source: str) -> bool:
    with warnings.catch_warnings(action="ignore"):
        return prepared(source, lowercase=False, skills=frozenset(SKILLS))[1]


def with_line(line: str) -> str:
    """Return a program with this line in its module."""
    return f"x = []\n\ndef own(y):\n    pass\n\n{line}\n\ndef task_program():\n    pass\n".replace(
        "\\n", "\n"
    )


@pytest.mark.parametrize("place", PLACES)
def test_functions_are_never_data(place: str) -> None:
    line, takes_iterators = place.removeprefix("~"), place.startswith("~")
    assert is_tame(with_line(line.replace("@", "x")))
    for function in ("say", "own", "print", "time", "(lambda: 1)", "x.append", "__builtins__"):
        assert not is_tame(with_line(line.replace("@", function))), function
    for iterator in ("(y for y in x)", "map(str, x)", "x.items()"):
        assert is_tame(with_line(line.replace("@", iterator))) is takes_iterators, iterator


@pytest.mark.parametrize("line", ANNOTATIONS)
def test_annotations_may_name_only_types(line: str) -> None:
    assert is_tame(with_line(line.replace("@", "str")))
    for name in ("x", "say", "own", "print", "time", "(lambda: 1)", "x.append", "__builtins__"):
        assert not is_tame(with_line(line.replace("@", name))), name


@pytest.mark.parametrize("line", NOT_ALLOWED)
def test_unlisted_statement_is_wild(line: str) -> None:
    assert not is_tame(with_line(line))


def test_every_program_starts_with_a_docstring_and_has_a_verdict() -> None:
    assert len(TAME) + len(WILD) == len(PROGRAMS) > 100
    for source in PROGRAMS.values():
        assert source.startswith('"""'), source


@pytest.mark.parametrize("name", WILD)
def test_wild_program_does_not_run_in_the_shared_child(name: str, batches: Worker) -> None:
    assert not is_tame(PROGRAMS[name])
    before, wild, after = run_together(batches, HONEST, PROGRAMS[name], HONEST)
    assert wild == [None] * len(WORLDS)
    assert before == after


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in ONE_A_KIND)) for name in TAME]
)
def test_tame_program_does_not_affect_other_runs(
    name: str, batches: Worker, alone: Worker, honest: Mapping[str, list[str]]
) -> None:
    source = PROGRAMS[name]
    assert is_tame(source)
    order = (HONEST, source, ALSO_HONEST, source, HONEST)
    together = run_together(batches, *order)
    wanted: list[str | None] = [*run_alone(alone, source)]
    if "\n# decided: alone\n" in source:
        wanted = [None] * len(WORLDS)
    assert together == [honest.get(each, wanted) for each in order]


# --- custom skills


def wave(robot: SimulatedRobot, person: str) -> None:
    """Wave, let time pass, and move to the first room."""
    robot.sleep_until(robot.now + 30)
    robot.record("wave", person)
    robot.room = robot.rooms[0]
    if person == "nobody":
        raise RobotError("WaveNoPerson", "nobody is here")


@pytest.mark.parametrize(
    "lines",
    [
        ("time.sleep(10)", "wave('amy')", "time.sleep(1)", "wave('bob')", "say(str(time.time()))"),
        ("wave('amy')", "say(get_current_location())", "go_to('kitchen')", "wave('nobody')"),
        (
            "try:",
            "    wave('nobody')",
            "except Exception as error:",
            "    say(str(error))",
            "go_to('nowhere')",
        ),
    ],
)
def test_own_skill_affects_only_its_own_run(lines: tuple[str, ...], batches: Worker, alone: Worker) -> None:
    skills = SKILLS.with_skill(
        Skill("wave", (Parameter("person"),), NO_VALUE, "Wave.", Recording("wave", "person"), does=wave)
    )
    new = [partial(SimulatedRobot, world, AS_WRITTEN, skills) for world in WORLDS]
    source = "\n    ".join(("def task_program():", *lines))
    together = batches.run_all([(source, new), (HONEST, new)])[0]
    wanted = [alone.run_alone(source, new_robot) for new_robot in new]
    assert [all_of(outcome) for outcome in together] == [all_of(outcome) for outcome in wanted]
    assert all(event.time > 0 for outcome in together for event in outcome.trace)


class Polite(SimulatedRobot):
    """Add a word to every event."""

    def record(self, kind: str, text: str, *more: object, **others: object) -> None:
        """Record the text with "please"."""
        super().record(kind, f"{text}, please", *more, **others)  # type: ignore[arg-type]  # only passed on


def test_robot_of_an_own_class_uses_its_methods(batches: Worker) -> None:
    outcome = batches.run("def task_program():\n    say('come')\n", partial(Polite, WORLDS[0], AS_WRITTEN))
    assert [event.text for event in outcome.trace] == ["come, please"]


def test_robots_in_sampled_worlds_are_copied_too(batches: Worker, alone: Worker) -> None:
    room_map = RoomMap(("kitchen", "lab"), "lab")
    new = [partial(SampledRobot, room_map, FactSampler(1, number)) for number in range(8)]
    known = batches.run_tame([(ALSO_HONEST, new)])
    assert [all_of(known[0, run]) for run in range(8)] == [
        all_of(alone.run_alone(ALSO_HONEST, new_robot)) for new_robot in new
    ]


# --- frames of a child that a program controls


class HijackedChild(IsolatedProcess):
    """A child that sends the given frames."""

    def __init__(self, *frames: bytes) -> None:
        self.frames = list(frames)

    def send(self, message: object) -> None:
        """Ignore the message."""

    def receive_bytes(self, most: int) -> bytes | None:  # noqa: ARG002 - the signature of the base class
        """Return the next frame."""
        return self.frames.pop(0) if self.frames else None


SAY = b'["say",["x"],0,"ok",null]'
FAILS = b'["pick",["x"],0,"error",%s]'
END = b'{"end":"finished"}'
DEEP = b"[" * 100_000 + b"]" * 100_000
LONG = b"1" * 900_000
TRANSCRIPT = b"[[%s],%s,%s]"
MALFORMED = {
    "nothing": b"",
    "two": b"null null",
    "no end": TRANSCRIPT % (SAY, b"0", b"null"),
    "an end that is none": TRANSCRIPT % (SAY, b"0", b"[]"),
    "too few parts": b"[[],0]",
    "too many parts": b"[[],0,{},5]",
    "no UTF-8": TRANSCRIPT % (b'["say",["\xff"],0,"ok",null]', b"0", END),
    "half a character": TRANSCRIPT % (b'["say",["\\ud800"],0,"ok",null]', b"0", END),
    "a deep argument": TRANSCRIPT % (b'["say",[%s],0,"ok",null]' % DEEP, b"0", END),
    "a deep answer": TRANSCRIPT % (b'["say",["x"],0,"ok",%s]' % DEEP, b"0", END),
    "a deep end": TRANSCRIPT % (SAY, b"0", b'{"end":%s}' % DEEP),
    "a moment that is none": TRANSCRIPT % (SAY, b"NaN", END),
    "a moment of no end": TRANSCRIPT % (SAY, b"1e999", END),
    "a moment of a number that is too long": TRANSCRIPT % (SAY, LONG, END),
    "no such skill": TRANSCRIPT % (b'["fly",[],0,"ok",null]', b"0", END),
    "too few arguments": TRANSCRIPT % (b'["say",[],0,"ok",null]', b"0", END),
    "an argument of another type": TRANSCRIPT % (b'["say",[["x"]],0,"ok",null]', b"0", END),
    "an option that is none": TRANSCRIPT % (b'["ask",["","",[["x",1]]],0,"ok",0]', b"0", END),
    "options that are texts": TRANSCRIPT % (b'["ask",["","",["x"]],0,"ok",0]', b"0", END),
    "a number for a string": TRANSCRIPT % (b'["say",[3],0,"ok",null]', b"0", END),
    "another answer": TRANSCRIPT % (b'["say",["x"],0,"ok",true]', b"0", END),
    "an answer to wait for": TRANSCRIPT % (b'["say",["x"],0,"ask",null]', b"0", END),
    "an error that is none": TRANSCRIPT % (FAILS % b"5", b"0", END),
    "an error that says nothing": TRANSCRIPT % (FAILS % b"null", b"0", END),
    "an error of another kind": TRANSCRIPT % (FAILS % b'["PlaceNoObject","x"]', b"0", END),
    "more than all calls": TRANSCRIPT % (b",".join([SAY] * 1_006), b"0", END),
    "more than all time": TRANSCRIPT % (SAY + b"," + SAY.replace(b"0", b"9999.0"), b"9999.0", END),
}


@pytest.mark.parametrize("frame", MALFORMED.values(), ids=MALFORMED)
def test_malformed_transcript_is_no_outcome(frame: bytes) -> None:
    robots = [SimulatedRobot(world, AS_WRITTEN) for world in WORLDS]
    good = TRANSCRIPT % (SAY + b"," + SAY.replace(b"0", b"5.0"), b"5.0", END)
    results = outcomes(HijackedChild(good, frame, good), [(b"", robots)])
    first = next(results)
    assert first is not None
    assert (first.status, [event.time for event in first.trace]) == (Status.FINISHED, [0.0, 5.0])
    with pytest.raises(ProtocolError):
        next(results)


@skill
def paint(_: Simulation, colour: Literal["red", "blue"], coats: int, litres: float, walls: list[str]) -> None:
    """Paint."""


PAINT = SKILLS.with_skill(paint)
WRONG_ARGUMENTS = {
    "no choice": ["green", 1, 0.5, ["a"]],
    "a truth value for a number": ["red", True, 0.5, ["a"]],
    "a fraction for a whole number": ["red", 1.5, 0.5, ["a"]],
    "too large a number": ["red", 2**60, 0.5, ["a"]],
    "a string for a number": ["red", 1, "0.5", ["a"]],
    "a string for a list": ["red", 1, 0.5, "a"],
    "a number in a list of texts": ["red", 1, 0.5, [1]],
    "a list in a list": ["red", 1, 0.5, [["a", True]]],
    "too few": ["red", 1, 0.5],
}


@pytest.mark.parametrize("values", WRONG_ARGUMENTS.values(), ids=WRONG_ARGUMENTS)
def test_wrong_arguments_of_an_own_skill_are_refused_outside_of_the_sandbox(values: list[Any]) -> None:
    robots = [SimulatedRobot(WORLDS[0], AS_WRITTEN, PAINT)] * 2
    asked = TRANSCRIPT % (b'["paint",%s,0,"ask",null]', b"0", b"null")
    good = asked % json.dumps(["red", 1, 2, ["a"]]).encode()
    results = outcomes(HijackedChild(good, TRANSCRIPT % (b"", b"0", END)), [(b"", robots[:1])])
    outcome = next(results)
    assert outcome is not None
    assert trace_data(outcome.trace) == [["paint", "red", ["1", "2", "a"]]]
    with pytest.raises(ProtocolError):
        next(outcomes(HijackedChild(asked % json.dumps(values).encode()), [(b"", robots[1:])]))
    with pytest.raises(ProtocolError):
        arguments_of(paint, values)


def test_silent_child_is_lost() -> None:
    results = outcomes(
        HijackedChild(b"null"), [(b"", [SimulatedRobot(world, AS_WRITTEN) for world in WORLDS])]
    )
    assert next(results) is None
    with pytest.raises(LostProcessError):
        next(results)


@pytest.mark.slow
def test_program_that_computes_for_too_long_does_not_affect_the_others(
    batches: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    hasten(monkeypatch)
    source = "def task_program():\n    say('x')\n    say(str(sum(range(10**12))))\n"
    assert is_tame(source)
    before, endless, after = run_together(batches, HONEST, source, HONEST)
    assert endless == [None] * len(WORLDS)
    assert before == after
    assert None not in before
