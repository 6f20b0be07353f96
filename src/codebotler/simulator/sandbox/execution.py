"""One run of one program, from inside: its budget, its clock, and its skills as functions."""

from __future__ import annotations

import builtins
import itertools
import sys
import types
from collections.abc import Callable
from typing import Any

from codebotler.simulator.sandbox.channel import receive, send
from codebotler.simulator.sandbox.ticks import ENTER, ENTRY, PROGRAM, TICK, prepared

# Python 3.11 counts calls into C as well: with one more, a function can call itself as often as under 3.12.
RECURSION_LIMIT = 1000 if sys.version_info >= (3, 12) else 1001
HEADROOM = 50  # for what a skill calls, so that the limit is met by the program, not on the way to the robot


class Run:
    """One run of one program: its budget, its clock and its line to the engine.

    Args:
        job: what the engine sent: source, literals, skills, ticks, clock.
    """

    def __init__(self, job: dict[str, Any]) -> None:
        self.job = job
        self.now = 0.0
        self.spent = False
        self.entered = False

    def execute(self) -> dict[str, object]:
        """Run the program to its end and say how it ended."""
        namespace = types.ModuleType("__main__")
        for name, function in self.names().items():
            setattr(namespace, name, function)
        sys.modules["__main__"] = namespace
        tick = self.ticker()
        setattr(builtins, TICK, tick)
        # One call deeper than a skill goes before it lifts the recursion limit: this meets the limit first.
        setattr(builtins, ENTRY, lambda: tick())  # noqa: PLW0108 - the call in between is what it is for
        setattr(builtins, ENTER, self.enter)
        try:
            code = prepared(self.job["source"], lowercase=self.job["literals"] == "lowercase")
            exec(code, namespace.__dict__)  # noqa: S102 - this is what the sandbox is for
            if not self.entered:
                exec("task_program()", namespace.__dict__)  # noqa: S102 - the same
        except BaseException as error:  # noqa: BLE001 - whatever ends a program is an outcome
            return self.ended_by(error)
        return {"end": "timeout", "line": None} if self.spent else {"end": "finished"}

    def ended_by(self, error: BaseException) -> dict[str, object]:
        """Describe what ended the program."""
        line = last_line(error)
        if self.spent or isinstance(error, BudgetSpentError):
            return {"end": "timeout", "line": line}
        if isinstance(error, SystemExit) and (
            error.code is None or (type(error.code) is int and error.code == 0)
        ):
            return {"end": "finished"}
        if isinstance(error, RobotError) and error.number >= 0:
            return {"end": "robot-error", "number": error.number, "line": line}
        if isinstance(error, SyntaxError) and line is None:
            line = error.lineno
        return {
            "end": "python-error",
            "kind": type.__getattribute__(type(error), "__name__")[:100],
            "message": message_of(error)[:1000],
            "line": line,
        }

    def enter(self) -> None:
        """Note that the program has started `task_program` by itself."""
        self.entered = True

    def ticker(self) -> Callable[[], None]:
        """The function that counts ticks and, once they are spent, raises each time it is called."""
        count = itertools.count(1).__next__
        limit = self.job["ticks"]

        def tick() -> None:
            if count() > limit or self.spent:
                self.spent = True
                raise BudgetSpentError

        return tick

    def names(self) -> dict[str, object]:
        """What a program can use without an import: the skills, and `sys` and `time`."""
        return {name: self.skill(name, parameters) for name, parameters in self.job["skills"]} | {
            "sys": sys,
            "time": sys.modules["time"],
        }

    def skill(self, name: str, parameters: list[list[str]]) -> object:
        """A function with a skill's name and parameters that asks the engine."""
        names = ", ".join(parameter for parameter, _ in parameters)
        arguments = "".join(f"{parameter}, " for parameter, _ in parameters)
        types_: list[tuple[str, type]] = [
            (parameter, list if kind == "list" else str) for parameter, kind in parameters
        ]
        scope = {
            "perform": lambda *values: self.perform(name, types_, values),
            "limit": sys.setrecursionlimit,
        }
        exec(  # noqa: S102 - of trusted text
            f"def {name}({names}):\n"
            f"    limit({RECURSION_LIMIT + HEADROOM})\n"
            f"    try: return perform({arguments})\n"
            f"    finally: limit({RECURSION_LIMIT})\n",
            scope,
        )
        return scope[name]

    def perform(self, name: str, parameters: list[tuple[str, type]], values: tuple[Any, ...]) -> Any:  # noqa: ANN401
        """Ask the engine for a skill; texts must be `str` and options a `list`, exactly."""
        arguments: list[object] = []
        options: list[Any] = []
        for (parameter, kind), value in zip(parameters, values, strict=True):
            given: type = type(value)
            if given is not kind:
                wanted = "a list" if kind is list else "text"
                raise TypeError(f"{name}: {parameter} must be {wanted}, not {given.__name__}")
            if kind is list:
                options = list(value)
                arguments.append([[str(option), isinstance(option, str)] for option in options])
            else:
                arguments.append(value)
        result = self.request([name, arguments])
        return options[result] if options and isinstance(result, int) else result

    def sleep(self, seconds: object, /) -> None:
        """Let simulated time pass; the engine hears of it with the next request, or when the time is up."""
        if not isinstance(seconds, int | float):
            raise TypeError(f"{type(seconds).__name__!r} object cannot be interpreted as an integer")
        if not 0 <= seconds < float("inf"):
            raise ValueError("sleep length must be non-negative and finite")
        self.now += seconds
        if self.now > self.job["seconds"]:
            self.request(["sleep", []])

    def request(self, message: list[object]) -> Any:  # noqa: ANN401 - what a skill returns
        """Send one request with the time at which it is made, and wait for its reply."""
        if self.spent:
            raise BudgetSpentError
        send([*message, self.now])
        kind, value = receive()
        if kind == "ok":
            return value
        if kind == "error":
            number, name, text = value
            error = type(name, (RobotError,), {"__module__": "robot"})(text)
            error.number = number
            raise error
        self.spent = True
        raise BudgetSpentError


def last_line(error: BaseException) -> int | None:
    """The line of the program at which an exception arose."""
    line, traceback = None, error.__traceback__
    while traceback is not None:
        if traceback.tb_frame.f_code.co_filename == PROGRAM:
            line = traceback.tb_lineno
        traceback = traceback.tb_next
    return line


def message_of(error: BaseException) -> str:
    """What an exception says; its class may be the program's own."""
    if isinstance(error, SyntaxError) and error.filename == PROGRAM and isinstance(error.msg, str):
        return error.msg  # without the place, which is said beside it
    try:
        return str.__str__(str(error))
    except BaseException:  # noqa: BLE001 - the program's own __str__ may raise anything
        return ""


class BudgetSpentError(BaseException):
    """The run has reached a limit; every further tick and skill call raises it again."""


class RobotError(Exception):
    """The robot could not do what the program asked for."""

    number = -1
