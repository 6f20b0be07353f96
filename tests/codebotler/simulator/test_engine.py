"""Runs of many programs: ordered, once each, reproducible, and without leftovers."""

import gc
import os
import platform
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from itertools import count, islice, takewhile
from pathlib import Path
from tempfile import TemporaryFile

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome, RunError, Status
from codebotler.core.world import Room, World
from codebotler.simulator import pool
from codebotler.simulator.engine import digest, run
from codebotler.simulator.ledger import SkillAnswer
from codebotler.simulator.pool import MAX_KEYS_AHEAD, MIN_BATCH_KEYS, WorkerPool, map_batches
from codebotler.simulator.process import spawn
from codebotler.simulator.process.errors import LostProcessError
from codebotler.simulator.process.fork_server_client import BatchServer
from codebotler.simulator.process.isolated_call import IDLE_PROCESSES, end_all
from codebotler.simulator.process.spawn import compiled_file
from codebotler.simulator.settings import Limits, SimulationSettings
from codebotler.simulator.skill_protocol import OVERRUN, SkillProtocol
from codebotler.simulator.worker import EngineError, Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from other_functions import with_functions
from processes import are_gone, children_of, engine_processes, fork_servers

WORLD = World((Room("start_loc"), Room("lab")), "start_loc")
OTHER = World((Room("elsewhere"),), "elsewhere")
AS_WRITTEN = SimulationSettings(literals="as-written")
FUTEX = {"x86_64": 202, "aarch64": 98}
LIBRARY = 'sys.modules["_ctypes"].dlopen(None, 0)'


def saying(text: str) -> str:
    return f"def task_program():\n    say({text!r})\n"


def texts_of(outcome: Outcome) -> list[str]:
    assert outcome.status == Status.FINISHED, outcome
    return [event.text for event in outcome.trace]


def with_say(say: Callable[..., None]) -> SkillTable:
    """Return the eight skills with another function for `say`."""
    return with_functions(SKILLS, say=say)


def links_in(folder: Path) -> list[Path]:
    """Return the links of a folder, without the one of the listing itself."""
    return [link for link in list(folder.iterdir()) if link.is_symlink()]


def held_resources() -> tuple[set[object], ...]:
    """Return the file descriptors, children and threads of this process."""
    descriptors = {f"{link.name} {link.readlink()}" for link in links_in(Path("/proc/self/fd"))}
    return {*descriptors}, {*engine_processes()}, {thread.name for thread in threading.enumerate()}


@pytest.fixture
def check_leftovers() -> Iterator[None]:
    """Fail if this process holds more resources after the test than before."""
    compiled_file()  # this file stays open
    end_all()
    before = held_resources()
    yield
    end_all()  # idle processes are not leftovers
    assert [after - earlier for after, earlier in zip(held_resources(), before, strict=True)] == [set()] * 3


# --- order


@pytest.mark.slow
def test_outcomes_come_in_the_order_of_the_pairs() -> None:
    texts = [str(number) for number in range(40)]
    slow = "def task_program():\n    for i in range(150_000): pass\n    say('{}')\n"
    programs = [slow.format(text) if int(text) % 7 == 0 else saying(text) for text in texts]
    outcomes = run(((program, WORLD) for program in programs), workers=3)
    assert [texts_of(outcome) for outcome in outcomes] == [[text] for text in texts]


@pytest.mark.shared_engine
def test_equal_pairs_are_run_once_and_have_equal_outcomes() -> None:
    ran: list[str] = []

    def say(robot: SimulatedRobot, message: str) -> None:
        robot.record("say", message)
        ran.append(f"{robot.room} {message}")

    same_world = World((Room("start_loc"), Room("lab")), "start_loc")
    pairs = [(saying("a"), WORLD), (saying("b"), WORLD), (saying("a"), OTHER), (saying("a"), same_world)]
    outcomes = list(run(pairs * 30, workers=2, skills=with_say(say)))
    assert [texts_of(outcome) for outcome in outcomes] == [["a"], ["b"], ["a"], ["a"]] * 30
    assert sorted(ran) == ["elsewhere a", "start_loc a", "start_loc b"]


def test_digest_depends_on_where_one_text_ends_and_the_next_begins() -> None:
    assert (
        len({digest("say(1)", "23"), digest("say(1)2", "3"), digest("say(1)23"), digest("", "say(1)23")}) == 4
    )


@pytest.mark.shared_engine
def test_no_pairs_give_no_outcomes() -> None:
    assert list(run([], workers=1)) == []


def test_pool_survives_the_thread_that_made_it() -> None:
    made: list[WorkerPool] = []
    maker = threading.Thread(target=lambda: made.append(WorkerPool(1)))
    maker.start()
    maker.join()
    with made[0] as pool:
        started = fork_servers()
        assert texts_of(pool.here().run(saying("hi"), lambda: SimulatedRobot(WORLD))) == ["hi"]
        assert len(pool._workers) == 1
        assert fork_servers() == started


def test_shared_pool_that_could_not_start_is_tried_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail_to_start(_: BatchServer) -> None:
        raise LostProcessError("no memory")

    monkeypatch.setattr(pool, "SHARED_POOL", shared := pool.SharedPool())
    with monkeypatch.context() as broken:
        broken.setattr(BatchServer, "_set_up", fail_to_start)
        with pytest.raises(EngineError, match="cannot start"):
            pool.shared_pool()
    try:
        assert texts_of(pool.shared_pool().here().run(saying("hi"), lambda: SimulatedRobot(WORLD))) == ["hi"]
    finally:
        shared.end()


@pytest.mark.slow
def test_pool_that_is_never_entered_ends_with_the_process() -> None:
    script = "from codebotler.simulator.pool import WorkerPool; WorkerPool(1)"
    began = fork_servers()
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)
    assert fork_servers() <= began


@pytest.mark.shared_engine
@pytest.mark.parametrize(("batches", "most"), [(2, 100), (10_000, MAX_KEYS_AHEAD + 30)])
def test_pairs_are_read_only_a_little_ahead(batches: int, most: int) -> None:
    """Only the first batches get results."""
    read, sent = count(), count(1)

    def submit(some: Sequence[int]) -> Future[Sequence[int]]:
        future = Future[Sequence[int]]()
        if next(sent) <= batches:
            future.set_result(some)
        return future

    results = map_batches(submit, read, workers=1, name=lambda number: number.to_bytes(2))
    assert [*islice(results, 30)] == [*range(30)]
    results.close()  # type: ignore[attr-defined]  # it is a generator
    assert next(read) < most


@pytest.mark.shared_engine
def test_work_continues_while_the_first_result_is_late() -> None:
    others_done = threading.Semaphore(0)

    def work(number: int) -> int:
        if number:
            others_done.release()
            return number
        return sum(1 for _ in takewhile(lambda _: others_done.acquire(timeout=20), range(500)))

    with WorkerPool(2) as pool:
        results = pool.map_distinct(
            lambda some: list(map(work, some)), range(600), name=lambda number: number.to_bytes(2)
        )
        assert list(results) == [500, *range(1, 600)]


SENDS_SIGNAL = """
import os, signal, threading, time
from concurrent.futures import Future
import polars  # after which a signal ends no wait
from codebotler.simulator.pool import map_batches

late = Future()
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
threading.Timer(30, late.set_result, ([0],)).start()
began = time.monotonic()
try:
    next(map_batches(lambda _: late, [0], workers=1, name=bytes))
except KeyboardInterrupt:
    print(time.monotonic() - began < 10, flush=True)
    os._exit(0)
"""


def test_signal_interrupts_the_wait_for_a_result() -> None:
    ended = subprocess.run([sys.executable, "-c", SENDS_SIGNAL], check=True, capture_output=True, text=True)
    assert ended.stdout == "True\n"


@pytest.mark.shared_engine
def test_keys_read_before_a_failure_have_results() -> None:
    def keys() -> Iterator[int]:
        yield from range(20)
        raise ValueError("no more")

    with WorkerPool(2) as pool:
        results = pool.map_distinct(
            lambda some: [number * 2 for number in some], keys(), name=lambda number: number.to_bytes(2)
        )
        assert [next(results) for _ in range(20)] == list(range(0, 40, 2))
        with pytest.raises(ValueError, match="no more"):
            next(results)


COMPARES_IDENTITIES = """
def task_program():
    go_to('kitchen')
    here = get_current_location()
    say(str([here is get_all_rooms()[1], here is 'kitchen']))
"""


@pytest.mark.slow
def test_identities_do_not_depend_on_strings_of_the_engine() -> None:
    hall, kitchen = str(b"hall", "ascii"), str(b"kitchen", "ascii")
    worlds = [World((Room("hall"), Room("kitchen")), "hall"), World((Room(hall), Room(kitchen)), hall)]
    worker = Worker()
    outcomes = [worker.run(COMPARES_IDENTITIES, partial(SimulatedRobot, world)) for world in worlds]
    worker.close()
    assert outcomes[0] == outcomes[1]


@pytest.mark.shared_engine
def test_room_with_an_invalid_regex_does_not_affect_programs_without_drives() -> None:
    world = World((Room("hall"), Room("[")), "hall")
    assert texts_of(next(run([(saying("a"), world)], workers=1))) == ["a"]


@pytest.mark.shared_engine
def test_program_has_only_the_skills_of_the_table() -> None:
    table = SkillTable(tuple(skill for skill in SKILLS.values() if skill.name != "pick"))
    (outcome,) = run([("def task_program(): pick('x')", WORLD)], workers=1, skills=table)
    assert outcome.error is not None
    assert outcome.error.kind == "NameError"


# --- reproducibility

NONDETERMINISTIC = """
import random, datetime, uuid, os, secrets, tempfile, logging, threading
class A: pass
def task_program():
    say(str(object()) + str(A()) + repr(task_program))
    say(str(id([])) + str(id("x")) + str(id(say)))
    say(str(hash("x")) + str(hash(("a", 1.5))) + str(hash(A())))
    say(str({"alpha", "beta", "gamma", "delta"}) + str(set("abcdef")))
    say(str(random.random()) + str(random.choice("abcdef")) + str(random.Random().random()))
    random.seed(7)
    say(str(random.random()))
    random.seed()
    say(str(random.randint(1, 10**9)))
    items = list(range(9))
    random.shuffle(items)
    say(str(items))
    say(str(time.time()) + str(time.perf_counter()) + str(datetime.datetime.now()))
    say(str(uuid.uuid4()) + str(uuid.uuid1()) + secrets.token_hex() + str(os.urandom(8)))
    say(next(tempfile._get_candidate_names()) + str(random._inst.__class__().random()))
    say(str(logging.LogRecord("", 0, "", 0, "", (), None).__dict__))
    say(str(threading.get_native_id()) + str(threading.get_ident()) + str(os.getppid()))
    say("NUMBER")
"""


@pytest.mark.slow
def test_outcome_depends_neither_on_workers_nor_on_earlier_runs() -> None:
    programs = [NONDETERMINISTIC.replace("NUMBER", f"unseen_{number}") for number in range(10, 22)]
    pairs = [(program, WORLD) for program in programs]
    first = list(run(pairs, workers=1, settings=AS_WRITTEN))
    assert list(run(pairs, workers=4, settings=AS_WRITTEN)) == first
    before = [(saying("x" * number), WORLD) for number in range(5)]
    assert list(run([*before, *reversed(pairs)], workers=1, settings=AS_WRITTEN))[5:] == first[::-1]
    assert len({tuple(texts_of(outcome)[:-1]) for outcome in first}) == 1
    assert len(texts_of(first[0])) == 14


ADDRESSES = """
def task_program():  # NUMBER
    say(str([id(bytes(size)) for size in range(0, 700, 16)]))
    new = [], {}, {1}, object(), 1.5e3, task_program.__get__(1), [i for i in range(50)]
    say(str(list(map(id, new))))
"""


@pytest.mark.slow
@pytest.mark.parametrize("imports", ["", "import json\n"])
def test_addresses_are_the_same_in_every_run(imports: str) -> None:
    programs = [(imports + ADDRESSES.replace("NUMBER", str(number)), WORLD) for number in range(150)]
    outcomes = run(programs, workers=1)
    assert len({tuple(texts_of(outcome)) for outcome in outcomes}) == 1


# --- leftovers


@pytest.mark.usefixtures("check_leftovers")
def test_reading_all_outcomes_leaves_nothing() -> None:
    assert len(list(run(((saying(str(number)), WORLD) for number in range(20)), workers=2))) == 20


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_consumer_that_stops_early_leaves_nothing() -> None:
    outcomes = run(((saying(str(number)), WORLD) for number in count()), workers=2)
    next(outcomes)
    assert engine_processes()
    outcomes.close()  # type: ignore[attr-defined]  # it is a generator


LONG_RUNS = [
    *((saying(str(number)), WORLD) for number in range(MIN_BATCH_KEYS)),  # the first batch is quick
    *(
        (f"def task_program():\n    sum(range(10**12))\n    say('{number}')\n", WORLD)
        for number in range(2 * MIN_BATCH_KEYS)
    ),
]


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_consumer_that_stops_does_not_wait_for_long_runs() -> None:
    outcomes = run(LONG_RUNS, workers=2)
    next(outcomes)
    while sum(bool(children_of(fork_server)) for fork_server in fork_servers()) < 2:
        time.sleep(0.05)
    time.sleep(0.5)
    start = time.monotonic()
    outcomes.close()  # type: ignore[attr-defined]  # it is a generator
    assert time.monotonic() - start < 3


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_consumer_that_stops_does_not_wait_for_a_starting_fork_server() -> None:
    outcomes = run(LONG_RUNS, workers=2)
    next(outcomes)
    start = time.monotonic()
    outcomes.close()  # type: ignore[attr-defined]  # it is a generator
    assert time.monotonic() - start < 3


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_failing_pairs_leave_nothing() -> None:
    def pairs() -> Iterator[tuple[str, World]]:
        for number in range(20):
            yield saying(str(number)), WORLD
        raise LookupError("no more")

    with pytest.raises(LookupError, match="no more"):
        list(run(pairs(), workers=2))


@pytest.mark.usefixtures("check_leftovers")
def test_failing_skill_leaves_nothing() -> None:
    def say(robot: SimulatedRobot, message: str) -> None:
        raise LookupError(message + robot.room)

    with pytest.raises(LookupError, match="astart_loc"):
        list(run([(saying("a"), WORLD), (saying("b"), WORLD)], workers=1, skills=with_say(say)))


def start_script() -> tuple[subprocess.Popen[str], set[int]]:
    """Start a script that runs programs endlessly; return it and the processes below it."""
    code = (
        "from itertools import count\n"
        "from codebotler.simulator.engine import run\n"
        "from codebotler.core.world import Room, World\n"
        "world = World((Room('a'),), 'a')\n"
        "long = 'def task_program():\\n    for i in range(190_000): str({})\\n'\n"
        "for n, outcome in enumerate(run(((long.format(n), world) for n in count()), workers=2)):\n"
        "    if n == 3: print('going', flush=True)\n"
    )
    script = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert script.stdout is not None
    assert script.stdout.readline() == "going\n"
    return script, children_of(script.pid)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_stopped_script_leaves_no_process(number: signal.Signals) -> None:
    script, below = start_script()
    assert len(below) >= 2
    script.send_signal(number)
    script.communicate(timeout=10)
    assert are_gone(below)


# --- crashes


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_fork_server_killed_between_runs_loses_no_outcome() -> None:
    outcomes = run(((saying(str(number)), WORLD) for number in range(60)), workers=1)
    assert texts_of(next(outcomes)) == ["0"]
    for pid in fork_servers():
        os.kill(pid, signal.SIGKILL)
    assert [texts_of(outcome) for outcome in outcomes] == [[str(number)] for number in range(1, 60)]


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_fork_server_killed_while_idle_is_replaced_without_an_open_socket() -> None:
    def pairs() -> Iterator[tuple[str, World]]:
        yield saying("a"), WORLD
        time.sleep(0.5)
        idle = fork_servers()
        for pid in idle:
            os.kill(pid, signal.SIGKILL)
        assert are_gone(idle)
        yield saying("b"), WORLD

    assert [texts_of(outcome) for outcome in run(pairs(), workers=1)] == [["a"], ["b"]]
    gc.collect()  # an open socket would cause a warning here, which is an error


def say_and_kill(times: int) -> Callable[..., None]:
    """Return a `say` that kills the fork server during the run, in its first few calls."""
    left = iter(range(times))

    def say(robot: SimulatedRobot, message: str) -> None:
        if next(left, None) is not None:
            family = engine_processes()
            for pid in fork_servers():
                os.kill(pid, signal.SIGKILL)
            assert are_gone(family)
        robot.record("say", message)

    return say


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_run_whose_fork_server_is_killed_is_repeated() -> None:
    program = "def task_program():\n    say('a')\n    say('b')\n"
    outcomes = list(
        run([(program, WORLD), (saying("c"), WORLD)], workers=1, skills=with_say(say_and_kill(1)))
    )
    assert [texts_of(outcome) for outcome in outcomes] == [["a", "b"], ["c"]]


@pytest.mark.usefixtures("check_leftovers")
def test_run_on_a_robot_that_has_acted_is_not_repeated() -> None:
    program = "def task_program():\n    say('a')\n    say('b')\n"
    with WorkerPool(1) as workers:

        def run_on(robot: SimulatedRobot) -> Outcome:
            return workers.submit(lambda: workers.here().run_on(program, robot)).result()

        assert texts_of(run_on(SimulatedRobot(WORLD))) == ["a", "b"]
        with pytest.raises(EngineError, match="run the command again"):
            run_on(SimulatedRobot(WORLD, skills=with_say(say_and_kill(1))))


@pytest.mark.slow
@pytest.mark.usefixtures("check_leftovers")
def test_fork_server_that_is_killed_repeatedly_is_an_engine_error() -> None:
    with pytest.raises(EngineError, match="so did the retry"):
        list(run([(saying("a"), WORLD)], workers=1, skills=with_say(say_and_kill(99))))


@pytest.mark.shared_engine
def test_skill_may_take_longer_than_the_wait_for_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.simulator.process.isolated_process.PROCESS_WAIT_SECONDS", 1.0)

    def say_slowly(robot: SimulatedRobot, message: str) -> None:
        time.sleep(2.5)
        robot.record("say", message)

    (outcome,) = run([(saying("a"), WORLD)], workers=1, skills=with_say(say_slowly))
    assert texts_of(outcome) == ["a"]


def test_stop_ends_the_child_while_its_robot_is_busy() -> None:
    is_busy, may_go_on = threading.Event(), threading.Event()

    def say_later(robot: SimulatedRobot, message: str) -> None:
        is_busy.set()
        assert may_go_on.wait(30)
        robot.record("say", message)

    others = engine_processes()  # other tests keep these open
    worker = Worker()
    with ThreadPoolExecutor(1) as thread:
        running = thread.submit(
            worker.run, saying("a"), lambda: SimulatedRobot(WORLD, skills=with_say(say_later))
        )
        assert is_busy.wait(30)
        family = engine_processes() - others
        worker.stop()
        assert are_gone(family)
        may_go_on.set()
        assert isinstance(running.exception(30), EngineError)
    worker.close()


SHORT_WAITS = """
def task_program():  # NUMBER
    lock = sys.modules["_thread"].allocate_lock()
    lock.acquire()
    for _ in range(40):
        lock.acquire(True, 0.05)
    say(f"{time.monotonic():.2f}")
    call = sys.modules["_ctypes"].dlsym(LIBRARY, "syscall")
    word, a_while = bytes(8), (0).to_bytes(8, "little") + (50_000_000).to_bytes(8, "little")
    for _ in range(40):
        refused = sys.modules["_ctypes"].call_function(call, (FUTEX, word, 0, 0, a_while))
    say(str(refused))
""".replace("LIBRARY", LIBRARY)


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in FUTEX, reason="the number of futex is not known here")
def test_program_with_short_waits_has_the_same_outcome_in_many_runs() -> None:
    source = SHORT_WAITS.replace("FUTEX", str(FUTEX[platform.machine()]))
    pairs = [(source.replace("NUMBER", str(number)), WORLD) for number in range(100)]
    ends = {(one.status, *(event.text for event in one.trace)) for one in run(pairs, workers=4)}
    assert ends == {(Status.FINISHED, "2.00", "-1")}


@pytest.mark.slow
@pytest.mark.shared_engine
def test_requests_beyond_a_limit_are_soon_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    answered: list[list[object]] = []
    answer = SkillProtocol._answer

    def count_and_answer(self: SkillProtocol, name: str, values: list[object], now: float) -> SkillAnswer:
        answered.append(values)
        return answer(self, name, values, now)

    monkeypatch.setattr(SkillProtocol, "_answer", count_and_answer)
    frame = b'["say",["!"],0.0]'
    program = (
        "import os\n"
        f"frame = {len(frame).to_bytes(4, 'big') + frame!r}\n"
        "def task_program():\n    for _ in range(5_000):\n"
        "        os.write(3, frame), os.read(3, int.from_bytes(os.read(3, 4), 'big'))\n"
    )
    (outcome,) = run([(program, WORLD)], workers=1)
    assert outcome.status == Status.TIMEOUT
    assert answered.count(["!"]) == 1_000 + OVERRUN + 1


def test_child_killed_from_outside_has_the_status_killed() -> None:
    def say(robot: SimulatedRobot, message: str) -> None:
        robot.record("say", message)
        for pid in fork_servers():
            for child in children_of(pid):
                os.kill(child, signal.SIGKILL)

    first, second = run(
        [(saying("a"), WORLD), ("def task_program(): pass", WORLD)], workers=1, skills=with_say(say)
    )
    assert (first.status, second.status) == (Status.KILLED, Status.FINISHED)
    assert [event.text for event in first.trace] == ["a"]


# --- the rest


@pytest.mark.shared_engine
def test_suite_sets_the_limits() -> None:
    limits = Limits(seconds=10, calls=3, ticks=50, text=5, trace=12)
    bodies = {
        "time.sleep(11)": "10 seconds of simulated time",
        "for i in range(4): say('a')": "3 skill calls",
        "for i in range(60): pass": "50 loop iterations and function calls",
        "say('abcdef')": "a text of more than 5 characters",
        "for i in range(3): say('abcde')": "texts of more than 12 characters in total",
    }
    pairs = ((f"def task_program():\n    {body}\n", WORLD) for body in bodies)
    outcomes = run(pairs, workers=1, settings=SimulationSettings(limits=limits))
    assert [outcome.error.message for outcome in outcomes if outcome.error] == list(bodies.values())


@pytest.mark.shared_engine
def test_enormous_program_is_refused() -> None:
    (outcome,) = run([("#" * 6_000_000, WORLD)], workers=1)
    assert (outcome.status, outcome.trace) == (Status.PYTHON_ERROR, ())
    assert outcome.error is not None
    assert "longer than 5,000,000 characters" in outcome.error.message


@pytest.mark.slow
def test_events_of_runs_are_logged_and_off_by_default(caplog: pytest.LogCaptureFixture) -> None:
    programs = [saying("a"), "def task_program(): go_to('x')", "import os\nos._exit(3)"]
    pairs = [(program, WORLD) for program in programs]
    list(run(pairs, workers=1))
    assert not caplog.records
    with caplog.at_level("DEBUG", logger="codebotler.engine.events"):
        list(run(pairs, workers=1))
    messages = [record.getMessage().partition(": ")[::2] for record in caplog.records]
    says, drives, ends = dict.fromkeys(program for program, _ in messages)
    assert messages == [
        (says, "started"),  # the first two share a batch
        (drives, "started"),
        (says, "finished"),
        (drives, "robot-error (GoToInvalidLocation: 'there is no room \"x\"')"),
        (ends, "started"),
        (ends, "killed (Crash: 'the process ended by itself (exit status 3)')"),
    ]


def test_macos_warns_of_less_isolation_with_the_platform_patched(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(Worker, "has_seccomp", property(lambda _: False, lambda *_: None), raising=False)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert texts_of(next(run([(saying("a"), WORLD)], workers=1))) == ["a"]
    (record,) = caplog.records
    assert "seccomp" in record.getMessage()
    with pytest.raises(EngineError, match="seccomp"):
        list(run([(saying("a"), WORLD)], workers=1, require_isolation=True))


LIKE_MACOS = """
import os, posix, resource, sys, sysconfig
sysconfig.get_config_vars()  # they lie in a file that is named by the platform
sys.platform = "darwin"
for name in ("waitid", "setresuid", "setresgid"):
    delattr(os, name)
    delattr(posix, name)
set_limit = resource.setrlimit

def with_fewer(kind, limits):
    if kind == resource.RLIMIT_AS:
        raise ValueError("current limit exceeds maximum limit")
    set_limit(kind, limits)

resource.setrlimit = with_fewer
"""


@pytest.mark.slow
def test_processes_need_only_the_features_of_macos_with_linux_patched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def compile_like_macos(file: str, shown: str) -> bytes:
        prelude = LIKE_MACOS if shown == "<codebotler.simulator.sandbox>" else ""
        source = Path(file).read_text(encoding="utf-8")
        return spawn.compiled_source(source.replace('"""The isolated', prelude + '"""The isolated', 1), shown)

    with TemporaryFile() as file:
        monkeypatch.setattr(spawn, "compiled_file", lambda *_: file)
        file.write(spawn.compiled_modules(compile_like_macos))
        file.flush()
        programs = [saying("a"), "import json\n" + saying("b"), "import os\n\ndef task_program(): os.abort()"]
        outcomes = list(run([(program, WORLD) for program in programs], workers=1))
    assert [texts_of(outcome) for outcome in outcomes[:2]] == [["a"], ["b"]]
    assert outcomes[2].error == RunError("Crash", "the process ended by itself (signal 6)")


# --- attacks


def large_program(number: int) -> str:
    """Return a program whose code does not fit into the buffer of a socket."""
    functions = "".join(f"say_{i} = lambda a, b: (a + b) * {i}\n" for i in range(2600))
    return f"{functions}# {number}\ndef task_program(): say(str([id(bytes(60_000 + i)) for i in range(9)]))\n"


@pytest.mark.slow
def test_large_programs_say_the_same_addresses_every_time() -> None:
    outcomes = run(((large_program(number), WORLD) for number in range(12)), workers=2)
    assert len({tuple(texts_of(outcome)) for outcome in outcomes}) == 1


@pytest.mark.slow
def test_short_program_with_enormous_code_is_refused() -> None:
    methods = "".join(f" def f{j}(): 0\n" for j in range(1500))
    worker = Worker()
    for number in range(3):
        source = f"class {'q' * 60_000}{number}:\n{methods}\ndef task_program(): pass\n"
        error = worker.run(source, lambda: SimulatedRobot(WORLD)).error
        assert error is not None
        assert error.kind == "MemoryError"
    worker.close()


SIZES = 15_000, 20_000, 20_800  # these fit only into a fresh process; under Python 3.11, at most the last


@pytest.mark.slow
def test_programs_compiled_before_change_no_outcome() -> None:
    greedy = [f"import {'.'.join(['a'] * parts)}\ndef task_program(): pass\n" for parts in SIZES]
    filling = [
        f"class {'q' * 59_992}{i:08}:\n" + "".join(f" __f{j}\n" for j in range(1500)) + "break\n"
        for i in range(4)
    ]
    alone = [next(run([(source, WORLD)], workers=1)) for source in greedy]
    after = list(run([(source, WORLD) for source in filling + greedy], workers=1))[len(filling) :]
    assert after == alone


def test_compiler_killed_from_outside_is_replaced() -> None:
    worker = Worker()

    def robot() -> SimulatedRobot:
        return SimulatedRobot(WORLD)

    assert texts_of(worker.run(saying("a"), robot)) == ["a"]
    os.kill(IDLE_PROCESSES["codebotler.simulator.process.compiler"][-1]._process.pid, signal.SIGKILL)
    assert texts_of(worker.run(saying("b"), robot)) == ["b"]
    worker.close()


FROM_A_SHELL = """
from codebotler.simulator import run
from codebotler.core.world import Room, World
program = '''
import signal
def f(n): return f(n + 1)
def task_program():
    say(str(object()) + str(id([])) + str(signal.getsignal(2)))
    try: f(0)
    except RecursionError as error: say(str(error))
    {end}
'''
outcome = run(program, World((Room("a"),), "a"))
print(outcome, outcome.trace)
"""


@pytest.mark.slow
def test_settings_of_the_shell_change_no_outcome() -> None:
    def run_in_shell(setting: str, end: str) -> str:
        ended = subprocess.run(
            ["bash", "-c", f'{setting}; exec "$0" -c "$1"', sys.executable, FROM_A_SHELL.format(end=end)],
            capture_output=True,
            text=True,
            check=True,
        )
        return ended.stdout

    plain = run_in_shell("true", "pass")
    assert "maximum recursion depth exceeded" in plain
    assert {run_in_shell(f"ulimit -s {size}", "pass") for size in ("1000000", "unlimited")} == {plain}
    assert "5 seconds of processor time" in run_in_shell("trap '' XCPU INT", "sum(range(10**12))")


PRINT_DIGEST = """
from hashlib import sha256
from codebotler.simulator.process.spawn import code_of, compiled_modules
print(sha256(compiled_modules(code_of)).hexdigest())
"""


@pytest.mark.slow
def test_code_for_fork_servers_does_not_depend_on_flags_of_python() -> None:
    def digest_with(*flags: str, **variables: str) -> str:
        command = [sys.executable, *flags, "-c", PRINT_DIGEST]
        environment = {**os.environ, **variables}
        return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout

    plain = digest_with(PYTHONHASHSEED="1")
    assert len(plain.strip()) == 64
    assert digest_with("-X", "frozen_modules=off", PYTHONHASHSEED="2") == plain
    assert digest_with("-O", PYTHONDONTWRITEBYTECODE="1") == plain


SAY_MODULES = """
import sys

def task_program():
    modules = [module for module in sys.modules.values() if getattr(module, "__spec__", None)]
    say(str(len(modules)))
    say(str([m.__name__ for m in modules if type(m.__spec__.loader).__name__.startswith("Source")]))
    for module in modules:
        say(str((module, module.__spec__, vars(module).get("__file__"), vars(module).get("__path__"))))
"""


def test_fork_server_compiles_almost_nothing_and_modules_name_no_folder() -> None:
    """Compiling the standard library would slow the start; paths would differ between machines."""
    worker = Worker(one_process_per_run=True)
    outcome = worker.run(
        SAY_MODULES, lambda: SimulatedRobot(WORLD, SimulationSettings(literals="as-written"))
    )
    worker.close()
    number, compiled, *modules = texts_of(outcome)
    assert int(number) > 200
    assert len(compiled.split(",")) < 30
    assert [text for text in modules if str(Path(os.__file__).parent) in text] == []


def test_interrupt_during_compilation_leaves_nothing_open(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> bytes:
        raise KeyboardInterrupt

    before = set(Path("/proc/self/fd").iterdir())
    monkeypatch.setattr(spawn, "compiled_modules", interrupt)
    monkeypatch.setattr(spawn, "_written_file", spawn._written_file.__wrapped__)
    with pytest.raises(KeyboardInterrupt):
        compiled_file()
    assert set(Path("/proc/self/fd").iterdir()) == before


def test_limit_on_the_size_of_files_is_an_engine_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spawn, "_written_file", spawn._written_file.__wrapped__)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        with pytest.raises(EngineError, match="ulimit"):
            WorkerPool(1, one_process_per_run=True).__enter__()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_forked_process_holds_no_channel_of_its_parents_workers() -> None:
    before = set(links_in(Path("/proc/self/fd")))
    with WorkerPool(1):
        pid = os.fork()
        if pid == 0:
            new = {link.readlink().name for link in set(links_in(Path("/proc/self/fd"))) - before}
            os._exit(sum(name.startswith(("pipe:", "socket:")) for name in new))
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0


def test_interrupted_start_leaves_nothing_open(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: BatchServer) -> None:
        raise KeyboardInterrupt

    before, processes = set(Path("/proc/self/fd").iterdir()), fork_servers()
    monkeypatch.setattr(BatchServer, "_set_up", interrupt)
    with pytest.raises(KeyboardInterrupt), WorkerPool(1):
        pass
    assert fork_servers() <= processes
    assert set(Path("/proc/self/fd").iterdir()) == before
