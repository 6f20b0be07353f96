"""The child that is forked ahead of the next batch survives interrupts and dead servers."""

import marshal
import os
import py_compile
import signal
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from importlib.util import cache_from_source
from pathlib import Path
from types import CodeType

import pytest

from codebotler.checking.check import check, check_on
from codebotler.simulator.pool import SHARED_POOL, WorkerPool, shared_pool
from codebotler.simulator.process import spawn
from codebotler.simulator.process.fork_server_client import BatchServer, ForkServer
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.worker import Worker
from processes import are_gone

PROGRAM = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"


@pytest.fixture
def own_worker() -> Iterator[Worker]:
    worker = Worker()
    yield worker
    worker.close()


def server_of(worker: Worker) -> BatchServer:
    server = worker._fork_servers[BatchServer]
    assert isinstance(server, BatchServer)
    return server


def test_child_forked_ahead_runs_all_worlds_of_a_check(
    own_worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready = server_of(own_worker)._next
    assert ready is not None
    forked: list[int] = []
    fork = ForkServer.fork

    def note_and_fork(server: ForkServer, *, is_live: bool = False) -> IsolatedProcess:
        child = fork(server, is_live=is_live)
        forked.append(child.pid)
        return child

    monkeypatch.setattr(ForkServer, "fork", note_and_fork)
    check_on(own_worker, "def task_program():\n    if is_in_room('mug'): pick('mug')\n")
    after = server_of(own_worker)._next
    assert after is not None
    assert forked == [after.pid], "exactly one child must be forked, for the next check"
    assert are_gone({ready.pid})


@pytest.mark.slow
def test_child_of_a_dead_server_is_never_signalled(
    own_worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = server_of(own_worker)
    assert server._next is not None
    ready = server._next.pid
    os.kill(server._process.pid, signal.SIGKILL)
    assert are_gone({server._process.pid, ready})
    signalled: list[int] = []
    kill = os.kill

    def note_and_kill(pid: int, number: int) -> None:
        signalled.append(pid)
        kill(pid, number)

    monkeypatch.setattr(os, "kill", note_and_kill)
    for _ in range(2):  # the first check finds no batch server
        assert check_on(own_worker, PROGRAM).problems == ()
    assert ready not in signalled
    assert server_of(own_worker) is not server


def test_code_compiled_ahead_is_never_used_for_another_program(own_worker: Worker) -> None:
    for text in (
        "def task_program(",
        PROGRAM,
        "def task_program(:",
        PROGRAM.replace("hello", "bye"),
        PROGRAM,
    ):
        found = check_on(own_worker, text)
        said = {
            event.text for sample in found.samples for event in sample.outcome.trace if event.kind == "say"
        }
        assert said == ({"bye"} if "bye" in text else {"hello"} if "hello" in text else set())


def test_check_in_a_thread_of_the_pool_does_not_deadlock() -> None:
    with WorkerPool(1) as pool:
        assert pool.submit(check, PROGRAM, pool=pool).result(30).problems == ()
        assert pool.submit(check, PROGRAM, pool=pool, samples=20).result(30).problems == ()


def test_interrupt_ends_the_shared_pool_and_the_next_check_gets_a_new_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = shared_pool()
    with monkeypatch.context() as patch:
        patch.setattr(WorkerPool, "call", interrupt)
        with pytest.raises(KeyboardInterrupt):
            check(PROGRAM)
    assert SHARED_POOL.pool is None
    assert check(PROGRAM).problems == ()
    assert shared_pool() is not before


def test_bytecode_without_columns_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "module.py"
    file.write_text('"""A module."""\n\nx = 1 + len("a")\n', encoding="utf-8")
    wanted = spawn.compiled_source(file.read_text(encoding="utf-8"), "module")
    assert spawn.code_of(str(file), "module") == wanted
    get_code = SourceFileLoader.get_code

    def remove_columns(self: SourceFileLoader, name: str) -> CodeType | None:
        code = get_code(self, name)
        return code and code.replace(co_linetable=b"")

    monkeypatch.setattr(SourceFileLoader, "get_code", remove_columns)
    assert spawn.code_of(str(file), "module") == wanted


def test_damaged_bytecode_is_not_used(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text('"""A module."""\n\nx = 1 + len("a")\n', encoding="utf-8")
    wanted = spawn.compiled_source(file.read_text(encoding="utf-8"), "module")
    cached = Path(cache_from_source(str(file)))
    py_compile.compile(str(file), doraise=True)
    whole = cached.read_bytes()
    for damaged in (whole[:20], whole[:16] + b"\xff" * 9, whole[:16] + marshal.dumps(1)):
        cached.write_bytes(damaged)
        assert spawn.code_of(str(file), "module") == wanted
