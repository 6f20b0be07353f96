"""Calls in closed processes return plain data, reach nothing outside, and fail on their own."""

import ast
import builtins
import os
import signal
import symtable
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

import closed_functions as closed
from codebotler.checking.check import check
from codebotler.core.program import MAX_PROGRAM_LENGTH, SOURCE_NAME
from codebotler.prompts.extract import program_in, program_of
from codebotler.simulator.process.isolated_call import IsolatedCallError, end_all
from codebotler.simulator.worker import EngineError
from roboeval.mutation.program_tree import apply_edit, parse_tree
from roboeval.training.rollouts import Rollout, judge

TASK = "def task_program():\n    say('hello')\n"
ENDLESS = str(10**12)


def test_function_gets_its_arguments_and_returns_plain_data() -> None:
    assert closed.echo("half \ud800 a character\0", times=2) == ["half \ud800 a character\0"] * 2


def test_calls_share_one_process_that_is_not_this_one() -> None:
    first = closed.process_number("")
    assert first == closed.process_number("") != os.getpid()


def test_function_reaches_no_file_no_socket_and_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    end_all()  # the next call starts a process with this environment
    monkeypatch.setenv("SOME_API_KEY", "secret")
    assert closed.reach(__file__) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "kind"),
    [
        (lambda: closed.fill(str(10**9)), "MemoryError"),
        (lambda: closed.fail("a"), "KeyError"),
        (lambda: closed.end("a"), "Crash"),
    ],
)
def test_failed_call_does_not_affect_the_next_one(call: Callable[[], Any], kind: str) -> None:
    with pytest.raises(IsolatedCallError) as error:
        call()
    assert error.value.kind == kind
    assert closed.echo("a") == ["a"]


@pytest.mark.slow
def test_call_that_computes_for_too_long_ends() -> None:
    number = closed.process_number("")  # after the end of one that was used before, a new one is tried
    threading.Timer(0.2, os.kill, [number, signal.SIGXCPU]).start()
    with pytest.raises(IsolatedCallError) as error:
        closed.compute(ENDLESS)
    assert error.value.kind == "TimeoutError"


def test_killed_process_is_replaced() -> None:
    number = closed.process_number("")
    os.kill(number, signal.SIGKILL)
    assert closed.process_number("") != number


@pytest.mark.slow
def test_next_call_does_not_get_the_answer_of_an_interrupted_one() -> None:
    closed.echo("warm")

    def call() -> None:
        threading.Timer(0.2, signal.raise_signal, [signal.SIGINT]).start()
        closed.compute(ENDLESS)

    with pytest.raises(KeyboardInterrupt):
        call()
    assert closed.echo("a") == ["a"]


def test_process_that_cannot_start_is_an_engine_error(monkeypatch: pytest.MonkeyPatch) -> None:
    end_all()
    monkeypatch.setattr("codebotler.simulator.process.isolated_call.SERVE_CODE", "raise SystemExit(1)")
    with pytest.raises(EngineError):
        closed.echo("a")


def test_threads_call_at_the_same_time() -> None:
    found: dict[int, list[str]] = {}

    def call(number: int) -> None:
        found[number] = closed.echo(str(number))

    threads = [threading.Thread(target=call, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {number: [str(number)] for number in range(2)}


def test_forked_process_has_processes_of_its_own() -> None:
    closed.echo("warm")
    pid = os.fork()
    if pid == 0:
        os._exit(0 if closed.echo("in the child") == ["in the child"] else 1)
    assert closed.echo("in the parent") == ["in the parent"]
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0


# --- foreign programs


@pytest.fixture(name="no_compiler")
def no_compiler_(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail if this process compiles a program or looks for its names."""
    real = builtins.compile

    def parse_only(source: Any, filename: str, mode: str, flags: int = 0, *args: Any, **more: Any) -> Any:  # noqa: ANN401 - as the builtin
        assert filename != SOURCE_NAME or flags & ast.PyCF_ONLY_AST, "this process compiles a program"
        return real(source, filename, mode, flags, *args, **more)

    def refuse(*_: object) -> None:
        raise AssertionError("a program is read in this process by what may take long")

    monkeypatch.setattr(builtins, "compile", parse_only)
    monkeypatch.setattr(symtable, "symtable", refuse)
    monkeypatch.setattr("pyflakes.checker.Checker", refuse)


@pytest.mark.slow
@pytest.mark.usefixtures("no_compiler")
def test_this_process_never_compiles_foreign_programs() -> None:
    assert not check(TASK).problems
    assert [problem.line for problem in check(TASK + "return\n").problems] == [3]
    assert program_of(f"Here:\n```\n{TASK}```\n").source == TASK
    assert program_in(TASK) == TASK
    tree = parse_tree(TASK)
    assert tree is not None
    assert apply_edit(tree, {}) == "def task_program():\n    say('hello')"
    (whole, cut) = judge([Rollout("CountRooms", 0, 0, one) for one in (TASK, TASK + "return\n")])
    assert (whole.parses, cut.parses) == (1.0, 0.0)


@pytest.mark.slow
def test_too_long_program_is_not_read() -> None:
    long = TASK + "# " + "x" * MAX_PROGRAM_LENGTH
    assert [problem.kind for problem in check(long).problems] == ["MemoryError"]


def nested_returns(depth: int = 4, returns: int = 30) -> str:
    """Return a short program with enormous code, since each `return` copies each `finally`."""
    lines, pad = ["def task_program():"], "    "
    for _ in range(depth):
        lines += [f"{pad}try:", *[f"{pad}    if x: return 1"] * returns, f"{pad}finally:"]
        pad += "    "
    return "\n".join([*lines, f"{pad}pass", ""])


def redefinitions(count: int = 1_050) -> str:
    """Return a program that pyflakes reads in quadratic time."""
    return "if 1:\n" + "    def f(): pass\n" * count


@pytest.mark.slow
@pytest.mark.parametrize("program", [nested_returns(), redefinitions()], ids=["returns", "definitions"])
def test_program_that_is_slow_to_compile_or_to_read_is_a_problem(program: str) -> None:
    before = time.process_time()
    assert check(program).problems
    assert program_of(f"```\n{program}```\n").source
    assert time.process_time() - before < 2  # the closed processes take five seconds each, this one does not
