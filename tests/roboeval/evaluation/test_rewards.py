"""Rewards: 1 exactly for programs that pass, 0 for doing nothing, from any thread and any process."""

import gc
import logging
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.trace import Event, Outcome, RunError, Status
from codebotler.simulator.pool import shared_pool
from codebotler.simulator.process.spawn import START_LOCK
from codebotler.simulator.worker import Worker, run_log
from processes import are_gone, children_of
from roboeval.evaluation.judging.judge import evaluate, is_met
from roboeval.evaluation.rewards import Share, reward, total
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, load_suite
from roboeval.suites.suite import HouseRules
from small_suite import write_suite

RIGHT = """
def task_program():
    for room in get_all_rooms():
        if "lab" in room:
            go_to(room)
            if is_in_room("person"):
                say("Good day!")
"""
NOTHING = ("", "no program", "def task_program():\n    pass\n", "def task_program():\n    say('hello')\n")


def distinct(count: int, mark: str) -> list[str]:
    return [f"{RIGHT}# {mark} {number}\n" for number in range(count)]


@pytest.mark.slow
@pytest.mark.parametrize("model", ["recorded:careful", "recorded:hasty"])
def test_the_reward_is_1_exactly_for_programs_that_pass(model: str, paper: Suite) -> None:
    completions = list(recorded_completions(model, paper))
    passed = [row["passed"] for row in evaluate(completions, paper, workers=2)]
    by_task = groupby(completions, key=lambda completion: completion.task)
    results = [one for task, its in by_task for one in reward(task, 0, [c.program for c in its])]
    assert [one == 1 for one in results] == passed
    assert all(0 <= one <= 1 for one in results)
    if model == "recorded:hasty":
        assert len({round(one, 3) for one in results}) > 20  # Most are partly right.


def test_doing_nothing_earns_0_in_any_task(paper: Suite) -> None:
    assert {task: reward(task, 0, NOTHING) for task in paper.tasks} == {
        task: [0.0] * len(NOTHING) for task in paper.tasks
    }


def test_an_error_halves_the_reward() -> None:
    at_once, late = "    go_to('nowhere')\n", "    return\n"
    part = RIGHT.replace("Good day!", "Good morning!")
    returned, erred, right, spoiled = reward(
        "SayGoodDay", 0, [part + late, part + at_once, RIGHT, RIGHT + at_once]
    )
    assert 0 < returned < 1
    assert erred == pytest.approx(returned / 2)
    assert (right, spoiled) == (1, 0.5)


def test_kept_prohibitions_only_scale_the_gain(paper: Suite) -> None:
    scenario = paper.tasks["SayGoodDay"].scenarios[3]  # Nobody is in a lab.
    assert [requirement.text for requirement in scenario.require] == [
        "visits_every_lab",
        "visits_nothing_else",
        "looks_into_every_lab",
        'says_nothing_like_it("sam")',
        'says_nothing_like_it("amy")',
    ]
    trace = (Event("goto", "sam's lab"), Event("say", "good day"), Event("goto", "amy's lab"))
    at_start = [is_met(requirement, ()) for requirement in scenario.require]
    share = Share.of(Outcome(Status.FINISHED, trace), scenario, at_start)
    assert share == Share(gained=1 / 2, kept=2 / 3)
    stopped = Outcome(Status.TIMEOUT, trace, RunError("TimeoutError", "an hour"))
    assert Share.of(stopped, scenario, at_start) == Share(gained=1 / 2, kept=1 / 3)
    assert Share.of(Outcome(Status.FINISHED, ()), scenario, at_start) == Share(gained=0.0, kept=1.0)


def test_a_world_with_only_prohibitions_counts_like_the_others() -> None:
    let_be = Share(gained=None, kept=1.0)
    assert total([Share(0.0, 1.0), let_be]) == 0
    assert total([Share(0.5, 1.0), let_be]) == 0.5
    assert total([Share(1.0, 1.0), Share(None, 0.5)]) == 0.75
    assert total([let_be]) == 1  # No world requires an action.


def test_equal_programs_are_judged_once(caplog: pytest.LogCaptureFixture) -> None:
    (program,) = distinct(1, "once")
    with caplog.at_level(logging.DEBUG, logger=run_log.name):
        first = reward("SayGoodDay", 0, [program] * 50)
        assert reward("SayGoodDay", 0, [program]) == first[:1] == [1.0]
    started = [record for record in caplog.records if record.getMessage().endswith("started")]
    assert len(started) == 4  # There are four worlds.


def test_each_prompt_is_rewarded_for_what_it_asks(tmp_path: Path) -> None:
    task = """\
name: T
summary: s
prompts: [Go., Go and say nothing., Go.]
checks:
  goes: {category: Location, rtl: 'tr.Exists(goto("lab"))'}
  says: {category: SayAtLocation, rtl: 'tr.Exists(say("x"))'}
worlds:
  - about: w
    robot: hall
    rooms: [hall, lab]
    require: [goes, {check: not says, prompts: {1: say nothing}}]
"""
    suite, program = (
        load_suite(write_suite(tmp_path, task)),
        "def task_program():\n    go_to('lab')\n    say('x')\n",
    )
    assert [reward("T", prompt, [program], suite=suite) for prompt in range(3)] == [[1.0], [0.0], [1.0]]


def test_a_prompt_may_ask_for_nothing_in_a_world(tmp_path: Path) -> None:
    task = """\
name: T
summary: s
prompts: [Go., Wait.]
checks:
  goes: {category: Location, rtl: 'tr.Exists(goto("lab"))'}
worlds:
  - about: w
    robot: hall
    rooms: [hall, lab]
    require: [{check: goes, prompts: {0: go}}]
"""
    suite = load_suite(write_suite(tmp_path, task))
    assert reward("T", 1, ["def task_program():\n    pass\n"], suite=suite) == [1.0]


def test_house_rules_count_even_after_a_reward_without_them(tmp_path: Path, paper: Suite) -> None:
    file = tmp_path / "quiet.yaml"
    file.write_text('rules:\n  - {name: quiet, says: Hush., always: not tr.Exists(say(".*"))}\n')
    (program,) = distinct(1, "with and without rules")
    ruled = paper.with_house_rules(HouseRules.read(file))
    with_rules, without = (reward("SayGoodDay", 0, [program], suite=suite) for suite in (ruled, paper))
    assert with_rules < without == [1.0]
    assert reward("SayGoodDay", 0, [program], suite=ruled) == with_rules


@pytest.mark.slow
def test_many_threads_may_call_reward_at_once() -> None:
    shared = [*distinct(10, "shared"), *NOTHING]

    def reward_in_thread(number: int) -> list[float]:
        return reward("SayGoodDay", 0, [*shared, *distinct(2, f"thread {number}")])

    with ThreadPoolExecutor(12) as threads:
        results = list(threads.map(reward_in_thread, range(12)))
    assert results == [[1.0] * 10 + [0.0] * len(NOTHING) + [1.0] * 2] * 12


@pytest.fixture
def no_garbage_collection() -> Iterator[None]:
    """Collect no garbage, because Python loses an interrupt that arrives in a `__del__`."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_garbage_collection")
def test_an_interrupt_cancels_only_programs_that_nobody_else_awaits(monkeypatch: pytest.MonkeyPatch) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # This replaces polars' handler.
    pool, gate, patience = shared_pool(), threading.Event(), 60
    here, submit = pool.here, pool.submit
    monkeypatch.setattr(pool, "here", lambda: gate.wait(patience) and here())
    futures: list[Future[object]] = []

    def submit_and_record(*call: Any) -> Future[object]:  # noqa: ANN401 - passed on
        futures.append(submit(*call))
        return futures[-1]

    monkeypatch.setattr(pool, "submit", submit_and_record)
    waited_for, given_up = distinct(8, "interrupted"), distinct(300, "given up")

    def wait_for_submissions(more_than: int) -> int:
        while len(futures) <= more_than:
            time.sleep(0.01)
        time.sleep(0.1)
        return len(futures)

    def interrupt() -> None:
        wait_for_submissions(few)
        os.kill(os.getpid(), signal.SIGINT)

    with ThreadPoolExecutor(2) as threads:
        other = threads.submit(reward, "SayGoodDay", 0, waited_for)
        few = wait_for_submissions(0)
        threads.submit(interrupt)
        with pytest.raises(KeyboardInterrupt):
            reward("SayGoodDay", 0, given_up)
        assert [future.cancelled() for future in futures] == [number >= few for number in range(len(futures))]
        gate.set()
        assert other.result() == [1.0] * len(waited_for)


def test_wrong_arguments_are_refused(paper: Suite) -> None:
    with pytest.raises(UserError, match="a list"):
        reward("SayGoodDay", 0, RIGHT)
    with pytest.raises(UserError, match='"Sing"'):
        reward("Sing", 0, [RIGHT], suite=paper)
    with pytest.raises(UserError, match="prompts 0 to 4"):
        reward("SayGoodDay", 5, [RIGHT])
    with pytest.raises(UserError, match="written by hand"):
        reward("SayGoodDay", 0, [RIGHT], worlds=3)
    with pytest.raises(UserError, match=r"worlds is 0, .* 1"):
        reward("SayGoodDay", 0, [RIGHT], suite="plus", worlds=0)
    with pytest.raises(UserError, match=r"worlds is 1000000000, .* 10,000"):
        reward("SayGoodDay", 0, [RIGHT], suite="plus", worlds=10**9)
    assert reward("SayGoodDay", 0, []) == []


@pytest.mark.parametrize(
    ("task", "prompt", "programs", "named"),
    [
        ("LunchTime", "0", [], ["prompt is '0'", "0 to 4"]),
        ("LunchTime", True, [], ["prompt is True", "0 to 4"]),
        ("LunchTime", -1, [], ["LunchTime", "no prompt -1", "0 to 4"]),
        (["LunchTime"], 0, [], ['"paper"', "no task"]),
    ],
)
def test_arguments_of_another_type_are_refused(
    task: object, prompt: object, programs: object, named: list[str]
) -> None:
    wrong: Any = (task, prompt, programs)
    with pytest.raises(UserError) as error:
        reward(*wrong)
    assert all(name in error.value.sentence for name in named), error.value


# --- processes


def reward_in_child(programs: list[str], queue: "multiprocessing.SimpleQueue[object]") -> None:
    signal.alarm(60)
    queue.put((reward("SayGoodDay", 0, programs), children_of(os.getpid())))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
def test_a_forked_process_has_an_engine_of_its_own() -> None:
    programs = distinct(5, "before")
    assert reward("SayGoodDay", 0, programs) == [1.0] * 5
    ours = children_of(os.getpid())
    forking = multiprocessing.get_context("fork")
    queue = forking.SimpleQueue()
    children = [
        forking.Process(target=reward_in_child, args=([*programs, *distinct(20, f"child {n}")], queue))
        for n in range(2)
    ]
    stop = threading.Event()

    def keep_busy() -> None:
        number = 0
        while not stop.is_set():
            number += 1
            reward("SayGoodDay", 0, distinct(4, f"meanwhile {number}"))

    busy = threading.Thread(target=keep_busy)
    busy.start()
    try:
        for child in children:
            child.start()
        for child in children:
            child.join()
    finally:
        stop.set()
        busy.join()
    assert [child.exitcode for child in children] == [0, 0]
    found = [queue.get() for _ in children]
    assert [rewards for rewards, _ in found] == [[1.0] * 25] * 2
    theirs = set().union(*(pids for _, pids in found))
    assert theirs
    assert not theirs & ours
    assert are_gone(theirs)
    assert reward("SayGoodDay", 0, distinct(5, "after")) == [1.0] * 5


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
def test_a_spawned_process_can_receive_a_suite() -> None:
    asked = partial(reward, "SayGoodDay", 0, [RIGHT, *NOTHING])
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        results = pool.submit(asked, suite=load_suite("plus")).result()
    assert results == asked(suite="plus")
    assert any(results)


def test_a_fork_waits_for_the_start_of_a_process() -> None:
    began = threading.Event()

    def hold_start_lock() -> None:
        with START_LOCK:
            began.set()
            time.sleep(0.3)

    other = threading.Thread(target=hold_start_lock)
    other.start()
    assert began.wait(10)
    child = os.fork()
    if child == 0:
        os._exit(0 if START_LOCK.acquire(timeout=5) else 1)
    other.join()
    assert os.waitpid(child, 0)[1] == 0
    assert START_LOCK.acquire(timeout=5)
    START_LOCK.release()


@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
def test_a_forked_process_does_not_wait_for_its_parents_threads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pool, gate, patience = shared_pool(), threading.Event(), 60
    here, began = pool.here, threading.Event()

    def wait_at_gate() -> Worker:
        began.set()
        gate.wait(patience)
        return here()

    monkeypatch.setattr(pool, "here", wait_at_gate)
    (program,) = distinct(1, "under way")
    with ThreadPoolExecutor(1) as threads:
        other = threads.submit(reward, "SayGoodDay", 0, [program])
        assert began.wait(patience)
        child = os.fork()
        if child == 0:
            signal.alarm(patience // 2)
            os._exit(0 if reward("SayGoodDay", 0, [program]) == [1.0] else 1)
        status = os.waitpid(child, 0)[1]
        gate.set()
        assert other.result() == [1.0]
    assert status == 0


SCRIPT = """
import os, threading
from pathlib import Path
from roboeval import reward

def children():
    mine = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = stat.read_text(errors="replace")
        except OSError:
            continue
        if int(text.rpartition(")")[2].split()[1]) == os.getpid():
            mine.append(int(stat.parent.name))
    return mine

right = "def task_program():\\n    pass\\n"
first = threading.Thread(target=lambda: reward("SayGoodDay", 0, [right]))
first.start(); first.join()  # processes outlive the thread that asked for them first
assert reward("SayGoodDay", 0, [right + "# again"]) == [0.0]
parents = children()
if not (pid := os.fork()):
    assert reward("SayGoodDay", 0, [right + "# child"]) == [0.0]
    print("child", *children(), flush=True)
    raise SystemExit(0)
assert os.waitpid(pid, 0)[1] == 0
assert reward("SayGoodDay", 0, [right + "# parent"]) == [0.0]
print("parent", *parents, flush=True)
"""


@pytest.mark.slow
def test_all_processes_end_with_their_parents() -> None:
    command = [sys.executable, "-W", "error", "-W", "ignore:.*use of fork:DeprecationWarning", "-c", SCRIPT]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    pids = {name: {*map(int, rest)} for name, *rest in map(str.split, ended.stdout.splitlines())}
    assert set(pids) == {"child", "parent"}
    assert len(pids["child"]) >= 2
    assert not pids["child"] & pids["parent"]
    assert are_gone(pids["child"] | pids["parent"])
