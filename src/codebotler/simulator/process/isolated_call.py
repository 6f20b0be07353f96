"""Calls our own functions on untrusted text, in closed processes with limits.

CPython's compiler needs minutes and gigabytes for some short texts. Such a call cannot be interrupted and
blocks all threads, even the one that stops a robot. So untrusted text is compiled, or parsed by code that is
slower than linear, in these processes only. They never execute it.
"""

from __future__ import annotations

import atexit
import json
import os
import pickle
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any, Generic, NoReturn, ParamSpec, TypeVar

from codebotler.simulator.process.errors import EngineError, LostProcessError, ProtocolError, cause_of_death
from codebotler.simulator.process.isolated_process import IsolatedProcess, channel_pair
from codebotler.simulator.process.spawn import start_module
from codebotler.simulator.sandbox import CHANNEL, CPU_SECONDS
from codebotler.simulator.sandbox.channel import receive, send_frames
from codebotler.simulator.sandbox.isolation import enclose, give_up_rights, usable_filter
from codebotler.simulator.sandbox.start import reset_inherited_settings

MAX_RESULT = 64_000_000  # bytes of JSON
RESULT, FAILURE = b"+", b"-"  # the first byte of an answer
SERVE_CODE = f"from {__name__} import serve; serve(*sys.argv[1:])"

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


class IsolatedCallError(Exception):
    """An isolated function raised an error, or exceeded the time or memory limit of a call.

    Args:
        kind: the kind of failure, such as `TimeoutError` or `MemoryError`.
        message: what went wrong, in one sentence.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(kind, message)
        self.kind, self.message = kind, message

    def __str__(self) -> str:
        return f"{self.kind}: {self.message}"


class IsolatedFunction(Generic[_Arguments, _Result]):
    """A function that runs in an isolated process when it is called; made by the decorator `isolated`."""

    def __init__(self, function: Callable[_Arguments, _Result], rehearsal: tuple[Any, ...]) -> None:
        self.function, self.rehearsal = function, rehearsal
        self.__doc__, self.__wrapped__ = function.__doc__, function
        self.__module__, self.__name__ = function.__module__, function.__name__

    def __call__(self, *args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        """Call the function in a closed process. If a process that was used before fails, retry in a new one.

        Raises:
            IsolatedCallError: the function failed, or exceeded its time or memory limit.
            EngineError: no isolated process can be started.
        """
        call = (self.__name__, pickle.dumps((args, kwargs)))
        idle = IDLE_PROCESSES.setdefault(self.__module__, [])
        with suppress(IndexError, IsolatedCallError, LostProcessError):
            return self._call(idle.pop(), call)
        try:
            with suppress(LostProcessError):
                return self._call(ClosedProcess(self.__module__), call)
            return self._call(ClosedProcess(self.__module__), call)
        except (LostProcessError, OSError) as error:
            raise EngineError(f"an isolated process failed, and so did the retry: {error}") from None

    def _call(self, process: ClosedProcess, call: tuple[str, bytes]) -> _Result:
        try:
            result = process.call(*call)
        except BaseException:  # such as an interrupt: the next call must not get this answer
            process.end()
            raise
        IDLE_PROCESSES[self.__module__].append(process)
        return result  # type: ignore[no-any-return]  # from JSON


def isolated(
    *rehearsal: object,
) -> Callable[[Callable[_Arguments, _Result]], IsolatedFunction[_Arguments, _Result]]:
    """Return a decorator that makes a module's function run in an isolated process.

    The function's arguments are pickled, and its result is returned as JSON, in which tuples become lists.
    Each new process first calls the function with the arguments `rehearsal`, to complete its imports.
    """
    return lambda function: IsolatedFunction(function, rehearsal)


class ClosedProcess:
    """An isolated process that calls functions of one module. It can reach only its channel to us."""

    def __init__(self, module: str) -> None:
        ours, theirs = channel_pair()
        with theirs:
            self._process = start_module(SERVE_CODE, [module], [theirs.fileno()])
        self._channel = IsolatedProcess(lambda: self._process.pid, ours, self._process.wait)
        if self._channel.receive_bytes(len(RESULT)) != RESULT:
            self.end()
            raise LostProcessError("the process did not start; memory may have run out")

    def call(self, name: str, arguments: bytes) -> Any:  # noqa: ANN401 - a function may return any type
        """Call a function in the process, and return its result. `arguments` are pickled (args, kwargs)."""
        self._channel.send((name, arguments))
        try:
            answer = self._channel.receive_bytes(len(RESULT) + MAX_RESULT)
        except TimeoutError:  # our own functions never wait, so the machine is to blame
            raise LostProcessError("the process was too slow; the machine may be overloaded") from None
        except ProtocolError as error:
            raise IsolatedCallError("MemoryError", f"the result is too large: {error}") from None
        self._channel.restart_wait()
        if not answer:
            status = self._channel.end_gently()
            if status == -signal.SIGKILL:
                raise LostProcessError("the process was killed from outside; memory may have run out")
            _, fault = cause_of_death(status)
            raise IsolatedCallError(fault.kind, fault.message)
        data = json.loads(answer[1:])
        if answer[:1] == FAILURE:
            raise IsolatedCallError(*data)
        return data

    def end(self) -> None:
        """Kill the process, even during a call."""
        self._channel.end()


IDLE_PROCESSES: dict[str, list[ClosedProcess]] = {}
"""Idle processes by the module whose functions they call."""


def end_all() -> None:
    """Kill all idle processes. Call this only while no call is in progress."""
    for processes in IDLE_PROCESSES.values():
        while processes:
            processes.pop().end()


atexit.register(end_all)
os.register_at_fork(after_in_child=IDLE_PROCESSES.clear)


# --- in the closed process


def serve(module: str, descriptor: str) -> NoReturn:
    """Call a module's functions when the engine asks, until the engine closes the channel `descriptor`."""
    import unicodedata as _  # noqa: F401, PLC0415 - needed to parse "\N{...}", and cannot be imported later

    reset_inherited_settings()
    members = vars(import_module(module)).items()
    functions = {name: one for name, one in members if isinstance(one, IsolatedFunction)}
    for function in functions.values():  # completes their imports
        function.function(*function.rehearsal)
    give_up_rights()
    seccomp = usable_filter()
    os.dup2(int(descriptor), CHANNEL)
    os.closerange(CHANNEL + 1, 256)
    enclose(seccomp, round(time.process_time()) + CPU_SECONDS)
    send_frames([RESULT])  # tells the engine that this process is ready
    while True:
        name, call = receive()
        send_frames([_answer(functions[name], call)])


def _answer(function: IsolatedFunction[..., object], call: bytes) -> bytes:
    try:
        args, kwargs = pickle.loads(call)  # noqa: S301 - sent by our own process
        return RESULT + json.dumps(function.function(*args, **kwargs)).encode()
    except Exception as error:  # noqa: BLE001 - a function may raise any error
        return FAILURE + json.dumps([type(error).__name__, str(error)[:1000]]).encode()
